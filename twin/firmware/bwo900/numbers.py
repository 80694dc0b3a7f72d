"""Names for the numbers of the manual: path conditions G, M functions, parameters P and q. Section in brackets.

Plain integers, so that they cost nothing in the analysis of a block and stand in `match` by their dotted names.
Messages have theirs in messages.py, beside their texts.
"""

from __future__ import annotations


class G:
    """Path conditions and cycles (chapters 4 and 5)."""

    RAPID = 0
    LINE = 1
    CIRCLE_CLOCKWISE = 2
    CIRCLE_COUNTER_CLOCKWISE = 3
    DWELL = 4
    ROTARY_POSITIVE = 5
    ROTARY_NEGATIVE = 6
    ROTARY_SHORTEST = 7
    EXACT_STOP_HERE = 8
    NO_EXACT_STOP_HERE = 9
    POLAR_ON = 10
    POLAR_OFF = 11
    CORNER = 12  # chamfer or rounding
    TANGENT_OFF = 13
    TANGENT_ON = 14
    POLAR_TRANSFORMATION_OFF = 15
    POLAR_TRANSFORMATION_ON = 16
    PLANE_XY = 17
    PLANE_ZX = 18
    PLANE_YZ = 19
    EXACT_STOP_ON = 28
    EXACT_STOP_OFF = 29
    RADIUS_OFF = 40
    RADIUS_LEFT = 41
    RADIUS_RIGHT = 42
    AXIS_CORRECTION_OFF = 43
    AXIS_CORRECTION_ON = 44
    ROTATION_ON = 45
    ROTATION_OFF = 46
    MACHINE_COORDINATES = 47
    TOOL_COORDINATES = 48
    WORKPIECE_COORDINATES = 49
    SPLINE = 50
    SPLINE_FEED = 51
    POLYNOMIAL = 52
    MACHINE_ZERO = 53
    ZERO_1 = 54
    ZERO_6 = 59
    MIRROR_OFF = 60
    MIRROR_FIRST = 61
    MIRROR_SECOND = 62
    OVERRIDE_FIXED = 63
    OVERRIDE_FREE = 64
    BARE = 66  # all corrections off in this block
    MEASURING = 69
    RECTANGLE = 71
    RECTANGLE_ZIGZAG = 72
    RECTANGLE_FINISHED = 73
    CIRCULAR_POCKET = 74
    CIRCULAR_POCKET_FINISHED = 75
    DRILLING_OFF = 80
    DRILLING = 81
    DRILLING_WITH_DWELL = 82  # DIN's number: G81 with P30
    DEEP_HOLE = 83
    TAPPING = 84
    BORING = 85
    RAY = 86
    PERIMETER = 87
    GRID = 88
    CIRCLE_OF_PLACES = 89
    ABSOLUTE = 90
    INCREMENTAL = 91
    SHIFT = 92
    FEED_PER_MINUTE = 94
    FEED_PER_TURN = 95
    CUTTING_SPEED = 96
    TURNS_PER_MINUTE = 97
    FREE_PLANE_1 = 117
    FREE_PLANE_2 = 118
    FREE_PLANE_3 = 119
    THREE_POINTS = 123
    NO_TRANSFORMATION = 147
    WEIGHTING_1 = 151  # named at P8836 only
    WEIGHTING_2 = 152
    NO_ZERO = 153
    ZERO_7 = 154  # the first of the additional zero points (8.3, q174)
    INCH_OFF = 170
    INCH_METRIC = 171


class M:
    """M functions that the control knows itself (6.1), and those that its first table defines (6.2)."""

    HALT = 0
    SYNCHRONISE = 1
    RETURN = 2
    SPINDLE_RIGHT = 3
    SPINDLE_LEFT = 4
    SPINDLE_OFF = 5
    TOOL_CHANGE = 6
    COOLANT_1_ON = 7
    COOLANT_2_ON = 8
    COOLANT_OFF = 9
    TOOL_DATA = 16
    JUMP = 23
    LOOP = 24
    LOOP_END = 25
    DELETE_DISTANCE = 26
    CALL = 28
    REPEAT = 29
    END = 30


class SC:
    """System calls `sc:n` (3.6)."""

    GO_ON = 0
    STAY = 1  # blocks are kept (supervision)
    STAY_AND_WAIT = 2  # as `STAY`, once the path of the last block has begun
    GO_NOW = 100  # those that are kept come now
    ALL = (GO_ON, STAY, STAY_AND_WAIT, GO_NOW)


class P:
    """Parameters of a channel (8.4 to 8.7); those of an axis: `Axis`, status by block: `Cell`."""

    # cycles (5.2 to 5.4; 8.4)
    CYCLES_FIRST, CYCLES_LAST = 10, 39
    SIZE_1 = 11
    INNER_RADIUS = 11  # of a circular pocket: the radius drilled before
    SIZE_2 = 12
    POCKET_DEPTH = 13
    POCKET_RADIUS = 14  # of a rectangular pocket's corners, or of the circular pocket
    ALLOWANCE = 15
    INFEED_ACROSS = 16
    INFEED_DEPTH = 17
    DEPTH_ALLOWANCE = 18
    POCKET_SAFETY = 19
    FINISHING_INFEED = 20
    PLUNGING_FEED = 21
    HOLE_DWELL = 30
    THREAD = 31
    HOLE_FEED = 32
    HOLE_DEPTH = 33
    APPROACH_PLANE = 34
    RETRACT_PLANE = 35
    STROKES = 36
    FIRST_STROKE = 37
    HOLE_SAFETY = 38
    DEGRESSIVE = 39
    CHAMFER, ROUNDING = 70, 71
    PATTERNS_FIRST, PATTERNS_LAST = 100, 159
    RAY_1, RAY_2 = 100, 110  # the first parameter of a ray; `Ray` has the rest
    CENTRE_X, CENTRE_Y, DIAMETER = 120, 121, 122
    START_ANGLE, TRAVEL_ANGLE, DIVISION_ANGLE, PLACES = 123, 124, 125, 126
    ROTATION_U0, ROTATION_V0, ROTATION_ANGLE = 160, 161, 163
    ROTATION_DU, ROTATION_DV, ROTATION_DANGLE = 165, 166, 168
    # areas (8.1)
    FIXED_FIRST, FIXED_LAST = 7_000, 9_999
    COMMON_FIRST, COMMON_LAST = 11_000, 11_999
    AXES_FIRST = 12_000
    BLOCK_2, BLOCK_3 = 20_000, 30_000
    # tools (8.5)
    TOOL_LOCK = 8_040  # 1: a block with T waits
    TOOL_TAKE, TOOL_COPY, TOOL_PUT_BACK = 8_045, 8_046, 8_047
    TOOL_ASKED, TOOL_INFO = 8_048, 8_049
    """T of a block that has been executed; of a block with T: 6 with M06, 16 with M16."""
    TOOL_REQUESTED, TOOL_SPINDLE, TOOL_PATH, TOOL_REAL_TIME = 8_050, 8_100, 8_150, 8_200
    """The first of a record each: that T has asked for, in the spindle, of the path, executed T."""
    TOOL_RADIUS, TOOL_LENGTH, TOOL_RADIUS_CORRECTION, TOOL_LENGTH_CORRECTION = 8_160, 8_161, 8_162, 8_163
    TOOL_QUADRANT = 8_164
    M_TABLE = 8_250  # definitions of M functions of the channel, four in each
    # messages, locks, what the channel is (8.5)
    MESSAGE_SYSTEM, MESSAGE_HIGH, MESSAGE_LOW, MESSAGE_SHOWN = 8_500, 8_501, 8_502, 8_503
    MESSAGE_AXIS, MESSAGE_INFO_1, MESSAGE_INFO_2, MESSAGE_INFO_3 = 8_504, 8_505, 8_506, 8_507
    ACKNOWLEDGE = 8_508
    LOCKS_SET, LOCKS_LIFTED = 8_510, 8_511
    CHANNEL, AXES, LAST_AXIS = 8_550, 8_551, 8_552
    MAP_P, MAP_Q = 8_553, 8_554  # a P is written, its q is answered
    WORKSPACE, ZERO_MASK = 8_555, 8_556
    M_WAITS = 8_559
    FED_LEVEL = 8_561
    ALL_REFERENCED = 8_579
    HANDED_WHOLE, HANDED_LIST = 8_640, 8_642
    START_G_FIRST, START_G_LAST = 8_650, 8_659
    # to and from the PLC (8.5)
    START_KEY = 8_682
    MODE_TO_PLC, START_TO_PLC = 8_683, 8_684
    PROGRAM_ACTIVE = 8_685
    RESTART_STATE = 8_686
    PROGRAM_RUNS = 8_687
    MODE_ACTIVE = 8_688
    M_CODE = 8_690
    DELETED, KEPT = 8_695, 8_696
    TRAVEL_RELEASE, SAFETY_HALT = 8_701, 8_702
    MODE, START, ABORT = 8_703, 8_704, 8_705
    REFERENCED = 8_709
    DELETE, KEEP = 8_715, 8_716
    TEACH_RADIUS = 8_748
    # HAND (8.5)
    HAND_KIND, HAND_AXIS, HAND_MOVE = 8_750, 8_751, 8_752
    HAND_FASTEST, HAND_FEED, HAND_FEED_NOW = 8_754, 8_755, 8_756
    HAND_PLANE, HAND_ZERO, HAND_COORDINATES = 8_757, 8_758, 8_759
    STEP, NEXT_STEP, STEP_POINTER, STEPS_FIRST = 8_760, 8_761, 8_762, 8_763
    # start of a program (8.5)
    PROGRAM, START_BLOCK = 8_800, 8_801
    BROKEN_PROGRAM, BROKEN_BLOCK, RESTART = 8_802, 8_803, 8_804
    START_FLAGS_1, START_FLAGS_2 = 8_806, 8_807
    SKIP, FED = 8_810, 8_811
    WITHOUT_MOVING, WITHOUT_M, SINGLE_EVERY = 8_812, 8_813, 8_814
    TEST_FEED, RAPID, FEED_NOW, FEED_SHARE = 8_815, 8_816, 8_817, 8_818
    START_ZERO = 8_830
    # what controls programs (8.5)
    FREE_PLANE_1, FREE_PLANE_2, FREE_PLANE_3 = 8_840, 8_841, 8_842
    CENTRE_ERROR = 8_843
    CORNER_ARC = 8_845
    CONVEX, CONCAVE, FEED_DYNAMICS = 8_848, 8_849, 8_850
    CORNER_DYNAMICS, CIRCLE_DYNAMICS = 8_851, 8_852
    START_COORDINATES = 8_853
    MEASURED_DISPLAY = 8_855
    CONTOUR_DYNAMICS = 8_857
    RAPID_END = 8_858
    ROTATION_ORDER = 8_859
    EXCHANGE, EXCHANGE_FIRST, EXCHANGE_LAST = 8_880, 8_881, 8_889
    BLOCK_LOCK, MIRRORED, NOT_INTERPOLATING, WITHOUT_DYNAMICS, KEEP_MASK = 8_891, 8_892, 8_893, 8_894, 8_895
    # status (8.5)
    EXECUTED = 8_900  # `Cell` of the block that is executed
    ABORTED_PROGRAM, ABORTED_BLOCK = 8_906, 8_907
    FAULTY_PROGRAM, FAULTY_BLOCK = 8_910, 8_911
    SHIFT_EXECUTED = 9_100
    ANALYSED = 9_300  # `Cell` of the block that is analysed
    SHIFT_ANALYSED = 9_500
    # handed to user cycles (8.5)
    HANDED_AXES = 9_700
    HANDED_I, HANDED_J, HANDED_K, HANDED_R, HANDED_T, HANDED_END_FEED, HANDED_FEED = (
        9_732, 9_733, 9_734, 9_735, 9_736, 9_738, 9_739,
    )  # fmt: skip
    HANDED_G, HANDED_EXTENSION = 9_740, 9_748
    HANDED_M, HANDED_SPEEDS = 9_750, 9_780
    HANDED_OWN, HANDED_LAST = 9_790, 9_799
    # common to all channels (8.6)
    SOFTWARE_LOCK_1, SOFTWARE_LOCK_2 = 11_008, 11_009
    LOCKS_OF_1, LOCKS_OF_2 = 11_018, 11_019
    M_TABLE_COMMON = 11_050
    BAUD, DATA_BITS, STOP_BITS, PARITY, HANDSHAKE = 11_172, 11_173, 11_174, 11_175, 11_176
    END_OF_FILE, TRANSFER_OPTIONS = 11_177, 11_178
    PUT_OUT = 11_181
    OVERRIDE = 11_310  # the first of 8 overrides, 5 parameters each
    OVERRIDE_5, OVERRIDE_6, OVERRIDE_7, OVERRIDE_8 = 11_330, 11_335, 11_340, 11_345
    OVERRIDE_TABLE = 11_370


class Ray:
    """Of a ray of places: behind P100 or P110 (5.4)."""

    X, Y, ANGLE, LENGTH, DIVISION, PLACES = 0, 1, 3, 4, 5, 6


class Axis:
    """Of an axis: behind P12000, and 200 more for each further axis (8.7)."""

    SPEED = 4
    SLOPE_SPEED_1, SLOPE_SPEED_2 = 5, 6
    DYNAMICS_1, DYNAMICS_2, DYNAMICS_KIND = 8, 9, 10
    INCREMENTS, INCREMENTS_PER = 12, 13  # so many increments in so many mm
    WINDOW_FINE, WINDOW_COARSE = 16, 17
    SETTLING_MS = 18
    KV = 20
    LAG_PERCENT, LAG_MS = 24, 25
    LIMIT_HIGH, LIMIT_LOW = 30, 31
    REFERENCE_MM = 40
    PROBE_LOGIC = 45
    HAND_SPEED = 120
    OVERRIDE = 125
    REFERENCE_RUN = 130
    STRUCK = 135
    SLOPE = 136
    MACHINE_PLACE, SET_PLACE, ACTUAL_PLACE, MEASURED_PLACE = 150, 151, 152, 153
    SHOWN_PLACE, PROGRAMMED_PLACE, DELTA_PLACE, SHOWN_SHIFT = 154, 155, 156, 157
    LAG = 160
    ACTUAL_SPEED, SPEED_NOW = 168, 170
    REFERENCED = 180
    MEASURED = 181
    AT_LIMIT = 185
    DRIVEN = 188
    MESSAGE = 197
    CHANNEL, LOGICAL = 198, 199


class Cell:
    """Of the block that is executed (behind P8900) or analysed (behind P9300): 8.5."""

    PROGRAM, BLOCK = 0, 1
    DEPTH_ANALYSED = 3
    CYCLE, CYCLE_BLOCK = 4, 5
    DEPTH, CALLER, CALLER_BLOCK = 12, 13, 14
    PASSES, PASS = 34, 35
    LOOPS = 34  # of the block that is analysed
    FEED, END_FEED, SPEED = 36, 37, 38
    MOTION = 40
    DWELL, DWELL_LEFT = 41, 42
    POLAR = 45
    PLANE = 50
    FIRST_AXIS, SECOND_AXIS, THIRD_AXIS = 51, 52, 53
    EXACT_STOP = 58
    RADIUS = 64
    AXIS_CORRECTION = 65
    ROTATION = 66
    COORDINATES = 67
    ZERO = 69
    MIRROR_FIRST, MIRROR_SECOND = 70, 71
    OVERRIDE = 72
    DIMENSION = 78
    SHIFT = 79
    FEED_KIND, SPEED_KIND = 80, 81


class Q:
    """The system's own parameters (8.3)."""

    LANGUAGE = 1
    CHANNELS = 2
    LINE_MODE = 41
    CHANNEL_1 = 100  # the first of a channel's descriptor; `Descriptor` has the rest
    AXIS_1, SPINDLE_1 = 110, 142  # the descriptors of 32 axes and 8 spindles
    POLAR_RADIUS, POLAR_ANGLE = 150, 151  # letters, by their ASCII
    PLANE_XY, PLANE_ZX, PLANE_YZ = 152, 153, 154
    M_IN_CHANNEL = 158
    DECIMALS = 159
    ZERO_TABLE, ZERO_SETS, ZERO_GROUPS, ZERO_AXES, ZERO_MORE = 170, 171, 172, 173, 174
    TOOL_TABLE, TOOLS, TOOL_SUB_RECORDS, TOOL_SIZE = 175, 176, 177, 178
    COMMON_FIRST, COMMON_END = 1_000, 2_000
    AXES_FIRST = 2_000


class Descriptor:
    """Of a channel: behind q100, q200 ... (8.3)."""

    NUMBER = 1
    USER_1, SIZE_1, USER_2, SIZE_2, USER_3, SIZE_3 = 2, 3, 4, 5, 6, 7
    AXES = 10
