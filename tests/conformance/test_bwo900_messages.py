"""BWO 900, chapter 9: every message that can occur: its condition, number, effect and place, from the manual alone."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from conformance.bwo900_desk import T1, Lagging, file, fresh, mm, parameters, put_out, said, start, value
from conformance.rows import shows

from isel_twin.firmware.bwo900.messages import MESSAGES, Effect

CELL = {"SA": 8_500, "KA": 8_501, "KS": 8_502, "A": 8_503}
TOOLS = {**T1, "p21060": 4.0, "p21068": 1.0}
"""T4: its life is over (P21068)."""


@dataclass(frozen=True)
class Case:
    """What is wrong with a program, from N20 on; the word at which it is, and parameters that are set for it."""

    number: int
    text: str
    word: str = ""
    effect: str = "KA"
    values: dict[str, float] = field(default_factory=dict)
    block: int = 20
    infos: tuple[float, ...] = ()


def many(count: int, word: str) -> str:
    return " ".join(word.format(n) for n in range(count))


G41 = "N20 tr:5 F500|N30 G41 G1 X10|N40 X30|"
GENERAL = [
    Case(1050, "N20 G0 X1 T9", "T9"),
    Case(1053, "N20 T4", "T4"),
]
CORRECTION = [
    Case(1152, G41 + "N50 G3 X34 Y0 R2|N60 G1 X60", "R2", block=50),
    Case(1153, "N20 tr:5 F500|N30 G41 G2 X10 Y10 R10|N40 X20", block=30),
    Case(1153, G41 + "N50 G40 G2 X40 Y10 R10", block=50),
    Case(1156, "N20 tr:3 F500|N30 G42 G1 X26 Y30|N40 G2 X34 R5|N50 G2 X26 R5|N60 G1 X10", block=50),
    Case(1157, G41 + "".join(f"N{50 + n} P{n}:1|" for n in range(13)) + "N70 X50", block=62),
    Case(1158, "N20 G12 P71:50 P70:-- G1 F500 X10|N30 Y10", "X10"),
    Case(1158, "N20 G12 P70:50 P71:-- G1 F500 X10|N30 Y10", "X10"),
    Case(1223, G41 + "N50 Y3|N60 X60|N70 Y30", "Y3", block=50),
]
INTERPRETER = [
    Case(1202, "N20 P99999999999:1"),
    Case(1203, "N20 P1:5/0"),
    Case(1208, "N20 " + many(33, "P{}:1")),
    Case(1209, "N20 X" + "(" * 11 + "1" + ")" * 11),
    Case(1210, "N20 X(5"),
    Case(1211, "N20 X?", "?"),
    Case(1212, "N20 P1:sqr(-1)"),
    Case(1213, "N20 P1:tan(90)"),
    Case(1213, "N20 P1:ln(0)"),
    Case(1214, "N20 P5"),
    Case(1216, "N20 G1 F100 Q20", "Q20"),
    Case(1217, "N20 X5 M25", "M25"),
    Case(1218, "N20 G0 X1 M24", "M24"),
    Case(1219, "N20 G0 X1 M28", "M28"),
    Case(1220, "N20 M28.{}"),
    Case(1222, "N20 " + many(9, "G{}"), "G8"),
    Case(1222, "N20 " + " ".join(f"M{n}" for n in range(40, 49)), "M48"),
    Case(1225, "N20 G0 X1 T2", "T2", values={"q176": 0}),
    Case(1226, "N20 G12 P71:5 G1 F500 X10", block=20),
    Case(1226, "N20 G123 X10 M01", "M01"),
    Case(1227, "N20 X5 M1000", "M1000"),
    Case(1228, "N20 G0 X5 M41.30", "M41.30"),
    Case(1228, "N20 G0 X5 M40", "M40", values={"p11060": 0x10}),
    Case(1229, G41 + "N50 X50 M01", "M01", block=50),
    Case(1230, "N20 G1 X5", "X5"),
    Case(1231, "N20 G2 F100 X0 Y0 R5", "R5"),
    Case(1232, "N20 G90 G91 X5", "G91"),
    Case(1233, "N20 G2 F100 X5 Y5", "X5"),
    Case(1234, "N20 G2 F100 X10 Y0 R1", effect="KS"),
    Case(1237, "N20 G2 F100 X0 Y0 I1 J0", values={"p8852": 2}),
    Case(1238, "N20 G2 F100 X10 Y0 I4 J0"),
    Case(1240, "N20 G54 X5", values={"p8555": 7}, block=0),
    Case(1249, "N20 G0 X5", values={"p8830": 17}, block=0),
    Case(1252, "N20 M28.77", "M28.77"),
    Case(1252, "N20 G0 X5 G1234", "G1234"),
    Case(1255, "N20 M23.77", "M23.77"),
    Case(1300, "N20 G0 X:P77", "X:P77", infos=(77, 1)),
    Case(1302, "N20 P99999:1"),
    Case(1305, "N20 P[K5,1]:1"),
    Case(1307, "N20 _a[1]:=5"),
]
INTERPOLATOR = [
    Case(2103, "N20 G0 X5|N30 X51", "X51", values={"p12030": 50}, block=30, infos=(1,)),
    Case(2104, "N20 G0 Y5|N30 Y-1", "Y-1", values={"p12231": 0}, block=30, infos=(2,)),
]
HOLE = "P30:-- P32:100 P33:-5 P34:1 P35:2"
POCKET = "P11:40 P12:30 P13:5 P14:-- P15:-- P16:4 P17:5 P18:-- P19:1 P20:-- P21:100"
ROUND = "P11:-- P13:5 P14:20 P15:-- P16:4 P17:5 P18:-- P19:1 P20:1 P21:100"
ROW = "P100:-- P101:-- P103:0 P104:30 P105:-- P106:4"
SECOND = "P110:-- P111:-- P113:90 P114:20 P115:-- P116:3"
RING = "P120:0 P121:0 P122:50 P123:0 P124:90 P125:-- P126:4"


def cycle(number: int, g: str, good: str, *wrong: str) -> Case:
    """A cycle whose parameters are right but for one."""
    words = dict(word.split(":") for word in f"{good} {' '.join(wrong)}".split())
    setting = " ".join(f"{name}:{content}" for name, content in words.items())
    return Case(number, f"N10 S1000 M3|N15 tr:3 F600|N20 {setting}|N40 {g} X1 Y1", block=40)


CYCLES = [
    *(cycle(8000 + n, "G71", POCKET, f"P{n}:--") for n in (11, 12, 13, 16, 17, 19)),
    cycle(8001, "G71", POCKET, "P14:1"),
    cycle(8001, "G71", POCKET, "P14:0"),
    cycle(8004, "G71", POCKET, "P14:16"),
    cycle(8009, "G71", POCKET, "P17:6"),
    cycle(8018, "G71", POCKET, "P18:6"),
    cycle(8015, "G71", POCKET, "P15:-1"),
    cycle(8021, "G71", POCKET, "P21:-1"),
    cycle(8007, "G74", ROUND, "P14:2"),
    cycle(8008, "G74", ROUND, "P11:17"),
    cycle(8010, "G74", ROUND, "P11:-1"),
    cycle(8014, "G74", ROUND, "P14:--"),
    cycle(8020, "G75", ROUND, "P20:-1", "P15:1"),
    cycle(8032, "G81", HOLE, "P32:--"),
    cycle(8033, "G81", HOLE, "P33:--"),
    cycle(8034, "G81", HOLE, "P34:--"),
    cycle(8036, "G83", HOLE, "P36:0", "P37:--", "P39:--"),
    cycle(8037, "G83", HOLE, "P36:1", "P37:0", "P39:1"),
    cycle(8103, "G86", ROW, "P103:--"),
    cycle(8104, "G86", ROW, "P104:--"),
    cycle(8107, "G86", ROW, "P106:--"),
    cycle(8311, "G86", ROW, "P100:30", "P101:0", "P104:20"),
    cycle(8315, "G86", ROW, "P105:7"),
    cycle(8100, "G86", ROW, "P101:5"),
    cycle(8101, "G86", ROW, "P100:5"),
    cycle(8105, "G86", ROW, "P105:0", "P106:--"),
    *(
        cycle(number, "G87", f"{ROW} {SECOND}", *wrong.split())
        for number, wrong in (
            (8110, "P111:5"),
            (8111, "P110:5"),
            (8113, "P113:--"),
            (8114, "P114:--"),
            (8115, "P115:0 P116:--"),
            (8117, "P116:--"),
            (8321, "P110:30 P111:0 P114:20"),
            (8325, "P115:7"),
        )
    ),
    cycle(8125, "G89", RING, "P124:--", "P126:--"),
    cycle(8120, "G89", RING, "P120:--"),
    cycle(8121, "G89", RING, "P121:--"),
    cycle(8122, "G89", RING, "P122:--"),
    cycle(8123, "G89", RING, "P123:--"),
    cycle(8124, "G89", RING, "P124:--"),
    cycle(8126, "G89", RING, "P126:--"),
    cycle(8333, "G89", RING, "P125:7"),
    cycle(8334, "G89", RING, "P126:--", "P125:0"),
    Case(8300, "N20 M3|N30 P32:100 P33:-5 P34:1 G81 X1", block=30),
    Case(8301, "N20 S1000 M5|N30 P32:100 P33:-5 P34:1 G81 X1", block=30),
    Case(8302, "N20 S0 M3|N30 P32:100 P33:-5 P34:1 G81 X1", block=30),
]
TABLE = {
    "9.2": GENERAL, "9.4": CORRECTION, "9.5": INTERPRETER, "9.7": INTERPOLATOR, "9.10": CYCLES,
}  # fmt: skip


def wrongs(cases: list[Case]) -> list[str]:
    """All cases on one control, one program after the other: what is not as it should be."""
    numbers = range(500, 500 + len(cases))
    texts = [
        f"P{n}|N2 G0 X0 Y0 Z0|{case.text}|N900 M30".replace("M28.{}", f"M28.{n}")
        for n, case in zip(numbers, cases, strict=True)
    ]
    desk, found = fresh(*texts, **TOOLS), []
    for number, case, text in zip(numbers, cases, texts, strict=True):
        desk.send(parameters(p8683=1, p8500=0, p8501=0, p8502=0, p8503=0, p8504=0, p8505=0, p8506=0, p8910=0, p8911=0))
        zero = {name: {"q176": 20, "p8555": 1}.get(name, 0) for name in case.values}
        desk.send(parameters(p8500=0, **case.values))
        before, messages = len(desk.remarks), len(said(desk))
        start(desk, number)
        desk.finish()
        remarks = [remark for _, remark in desk.remarks[before:]]
        lines = dict(line.split(" ", 1) for line in text.split("|")[1:])
        column = ""
        if case.word:
            line = next(line for line in text.split("|") if line.startswith(f"N{case.block} "))
            column = f" column {line.index(case.word) + 1}"
        place = f"P{number}" + (f" N{case.block}" if case.block else "") + column
        assert not case.block or f"N{case.block}" in lines
        good = len(remarks) == 1 and remarks[0].startswith(f"M{case.number} {place}")
        good &= said(desk)[messages:] == [case.number]
        good &= bool(case.word or not case.block) or " column " in str(remarks)
        good &= value(desk, CELL[case.effect]) == case.number
        good &= [n for n in CELL.values() if value(desk, n)] == [CELL[case.effect]]
        good &= (value(desk, 8_910), value(desk, 8_911)) == (number, case.block)
        first = 8_504 if 2_000 <= case.number < 3_000 else 8_505
        good &= all(value(desk, first + n) == info for n, info in enumerate(case.infos))
        good &= desk.controller.fault
        good &= value(desk, 8_685) == (1.0 if case.effect == "KS" else 0.0)
        if not good:
            cells = [value(desk, n) for n in (*CELL.values(), *range(8_504, 8_507), 8_910, 8_911, 8_685)]
            found.append(f"{case.number} {place}: {remarks} {cells}")
        if zero:
            desk.send(parameters(p8500=0, **zero))
            desk.send(file("D", *(f"K1:P {name[1:]}: --" for name in zero if name[0] == "p")))
    return found


@pytest.mark.parametrize(
    "section",
    [pytest.param(section, marks=shows(f"bwo900-{section}-20"), id=section) for section in TABLE],
)
def test_conditions_numbers_effects_and_places(section: str) -> None:
    assert wrongs(TABLE[section]) == []


FILES = [
    (1106, ("P1", "N10 X1"), ()),
    (1107, ("P1", "N10 X1"), ()),
    (1110, ("", "X5", "N10 X1"), (1,)),
    (1111, ("D", "K1:P1: 5", "P1 = 5"), (3,)),
    (1111, ("P2", "N10 X1", "N20 X2 \\"), ()),
    (1111, ("P2", "N10 X1", "X2"), (3,)),
    (1112, ("D", "K3:P1: 5"), (2,)),
    (1113, ("P2", "N10 X1", "N20 X" + "1" * 400), (3,)),
    (1290, ("P2", "N20 X1", "N10 X2"), (3, 10)),
    (1302, ("D", "q 70000: 5"), ()),
]


@shows("bwo900-9.3-20")
def test_messages_of_files() -> None:
    """Effect A: shown in P8503; the line of the file in P8505, with M1290 the number of the block in P8506."""
    for number, lines, infos in FILES:
        desk = fresh("P1|N10 G0 X9|N20 M30", referenced=False, p11178=float(number == 1107))
        desk.send(file(*lines))
        assert said(desk) == [number], lines
        assert [value(desk, n) for n in (8_503, *range(8_505, 8_505 + len(infos)))] == [number, *infos]
        assert not any(put_out(desk).get(n) for n in (15_000 + 1_500, 15_000 + 1_501, 15_000 + 1_502))
    desk = fresh("P1|N10 G0 X9|N20 M30", p11178=1)
    desk.send(file("P1", "N10 G0 X5", "N20 M30"))
    desk.send(parameters(p8508=1))
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 9.0  # it is not overwritten


@shows("bwo900-9.2-21", "bwo900-9.5-21")
@pytest.mark.parametrize(
    ("number", "referenced", "keys"),
    [
        (1008, False, {"p8683": 2, "p8684": 1}),
        (1009, True, {"p8683": 8, "p8703": 2}),
        (1321, True, {"p8683": 2, "p8752": 1}),
        (1321, True, {"p8683": 2, "p12130": 1}),
        (1322, True, {"p8683": 1, "p8684": 1}),
        (1252, True, {"p8683": 2, "p8800": 77, "p8684": 1}),
        (1255, True, {"p8683": 2, "p8800": 1, "p8801": 77, "p8684": 1}),
    ],
)
def test_messages_of_operating(number: int, referenced: bool, keys: dict[str, float]) -> None:
    desk = fresh("P1|N10 G0 X9|N20 M30", referenced=referenced)
    for name, content in keys.items():
        desk.send(parameters(**{name: content}))
    desk.finish()
    assert said(desk) == [number]
    cell = 8_503 if number == 1009 else 8_501
    assert value(desk, cell) == number
    assert mm(desk)[0] == 0.0


@shows("bwo900-9.7-21")
def test_a_limit_switch_breaks_off_and_names_its_axis() -> None:
    desk = fresh("P7|N10 G0 X5|N20 G1 F3000 Y-900|N30 M30")
    start(desk, 7)
    desk.finish()
    assert [text for _, text in desk.remarks] == ["M2102 P7 N20 column 14: hardware limit - (Y)"]
    assert [value(desk, n) for n in (8_501, 8_504, 8_685, 8_910, 8_911)] == [2102, 2, 0, 7, 20]


@shows("bwo900-9.8-20")
@pytest.mark.parametrize(("contact", "number"), [("estop", 3001), ("power", 3002)])
def test_what_switches_the_drives_off(contact: str, number: int) -> None:
    """System abort: P8500, and the drives are off."""
    desk = fresh("P7|N10 G1 F600 X50|N30 M30")
    start(desk, 7)
    desk.run(1.5)
    assert desk.outputs["stages"] == 1
    desk.set(contact, "pressed" if contact == "estop" else "off")
    desk.run(0.2)
    assert said(desk) == [number]
    assert (value(desk, 8_500), desk.outputs["stages"], value(desk, 8_685)) == (number, 0, 0.0)


@shows("bwo900-9.7-22")
@pytest.mark.parametrize(("lag", "number"), [(0.0, 2010), (300.0, 2010), (9000.0, 2001), (-9000.0, 2001)])
def test_a_drive_that_gives_up_breaks_the_system_off(lag: float, number: int) -> None:
    """Y at 7.1 mm/s, gain 16 / s: 442 increments behind; half as much more and 253 are allowed (8.7, P12024)."""
    desk = fresh("P7|N10 G1 F600 X50 Y50|N30 M30")
    start(desk, 7)
    desk.run(1.5)
    Lagging(desk).lag = (0.0, lag, 0.0)
    desk.set("fault1", True)
    desk.run(0.2)
    assert said(desk) == [number]
    assert [value(desk, n) for n in (8_500, 8_504, 8_685, 8_910, 8_911)] == [number, 2, 0, 7, 10]
    place = mm(desk)
    desk.run(1.0)
    assert (mm(desk), desk.outputs["stages"]) == (place, 0)


@shows("bwo900-9.7-23")
def test_a_reference_run_that_does_not_get_off_its_switch() -> None:
    desk = fresh(referenced=False)
    desk.set("limit_x1", False)
    desk.send(parameters(p8683=1, p12130=1))
    desk.finish()
    assert said(desk) == [2110]
    assert [value(desk, n) for n in (8_503, 8_504, 8_579)] == [2110, 1, 0]


CHAPTER = [
    range(1000, 1003), range(1008, 1010), [1050], [1053], range(1098, 1101), [1102], range(1105, 1108),
    range(1110, 1116), range(1120, 1124), range(1151, 1160), range(1200, 1204), range(1207, 1236),
    range(1237, 1239), [1240], range(1248, 1250), [1252], range(1255, 1273), [1275], range(1280, 1282), [1283],
    [1285], [1290], range(1300, 1303), range(1304, 1307), [1310], range(1320, 1323), [1800], range(1808, 1812),
    range(1815, 1817), [1820], range(1825, 1827), [1830], range(1840, 1845), range(1950, 1953), range(2001, 2003),
    range(2004, 2008), [2010], [2020], range(2022, 2025), [2050], [2052], range(2101, 2105), [2110], [2112], [2114],
    [2116], [3000], range(3501, 3503), range(4002, 4007), [4012], range(4015, 4017), range(4100, 4107),
    range(4150, 4159), range(4160, 4162), range(4200, 4208), [4211], range(4300, 4304), [4310], [4390],
    range(4400, 4403), [8001], range(8003, 8022), range(8032, 8039), range(8100, 8102), range(8103, 8108),
    range(8110, 8112), range(8113, 8118), range(8120, 8127), range(8300, 8304), range(8309, 8312), [8313],
    range(8315, 8317), range(8320, 8322), [8323], range(8325, 8327), range(8332, 8338),
]  # fmt: skip
"""The 262 numbers of chapter 9."""
ELSEWHERE = {
    1105: "test_bwo900_operating.py", 1256: "test_bwo900_operating.py", 1268: "test_bwo900_feed.py",
    1269: "test_bwo900_feed.py",
    1235: "test_bwo900_curves.py", 1224: "test_bwo900_spindle.py", 8303: "test_bwo900_spindle.py",
    1310: "test_bwo900_plc_requests.py", 2022: "test_bwo900_parameters.py", 8016: "test_bwo900_machining.py",
    8038: "test_cycles.py",
}  # fmt: skip
"""Messages whose conditions are other tests' business."""
OWN = {
    1307: "_a[1] of a symbol that is no parameter", 2000: "an emergency position is approached (8.7)",
    3001: "emergency stop", 3002: "drives off",
}  # fmt: skip
"""Messages that chapter 9 does not have (its 3000 on belong to the PLC)."""
MEASURING = {8134, *range(8136, 8139), *range(8140, 8143), *range(8149, 8161), 8162, 8164, 8167, 8168}
"""Those of G69 stand in 5.1 alone: test_bwo900_measuring.py. Its others are of cycles that 5.1 does not describe."""
NOT_HERE = {
    "flash, download, memory and power of the original's hardware": (
        *range(1000, 1003), *range(1120, 1124), 1200, *range(1259, 1262), 1270, 1272, 1275, *range(1280, 1286),
        1301, 1306, 1800, *range(1808, 1850),
    ),
    "panel, its files and its link": (1100, 1102, *range(1262, 1268), *range(3000, 3001), *range(4000, 5000)),
    "renumbering, check characters, other channels, robots, DLLs, locks, couplings, "
    "positions that are measured or named, the export version": (
        1098, 1099, 1114, 1115, 1201, 1207, 1248, 1304, 1320, *range(1950, 1953), 2023, 2052, 2112, 2114,
        2116, 3501, 3502,
    ),
    "the position loop is in the drives: 2001, 2010": (*range(2002, 2010), 2020, 2024, 2050),
    "said by 1152 and 1223": (1151, 1154, 1155, 1159),
    "said by 1211, 1300, 1111, 8001": (1215, 1221, 1271, 8003, 8005),
    "P35 may be deleted": (8035,),
    "said by 8107, 8117, 8311, 8315, 8321, 8325, 8333": (8106, 8116, 8309, 8310, 8313, 8320, 8323, 8332),
    "5.4 allows no place, one place, any angle": (8316, 8326, 8335, 8336, 8337),
    "the buffer of dripfeed does not run over unseen: 1268": (1257, 1258),
    "a cycle here has one sequence": (8006,),
}  # fmt: skip
"""Messages of chapter 9 that cannot occur, by reason."""


@shows("bwo900-9.1-3", "bwo900-9.1-4")
def test_every_message_of_chapter_9_is_given_or_has_a_reason() -> None:
    chapter = {number for numbers in CHAPTER for number in numbers}
    absent = [number for numbers in NOT_HERE.values() for number in numbers if number in chapter]
    assert len(absent) == len(set(absent))
    given = {case.number for cases in TABLE.values() for case in cases} | {number for number, *_ in FILES}
    given |= {1008, 1009, 1321, 1322, 2000, 2001, 2010, 2101, 2102, 2110, 3001, 3002} | set(ELSEWHERE)
    assert given | set(absent) == chapter | set(OWN)
    assert not MEASURING & chapter
    assert not given & set(absent)
    assert set(MESSAGES) - set(absent) == given | MEASURING
    assert [number for number in absent if number in MESSAGES] == [8006]  # supervision's own limit


@shows("bwo900-9.1-5")
def test_effects_are_those_of_chapter_9() -> None:
    """KA, or A for what files and operating say; SA of the interpolator; those of cycles have none and break off."""
    shown = {1009, 1105, 1106, 1107, 1110, 1111, 1112, 1113, 1256, 1290}
    for number, message in MESSAGES.items():
        if number in (2022, 2110):
            assert message.effect is Effect.SHOWN  # chapter 9 names none
        elif number in (2001, 2010, 3001, 3002):
            assert message.effect is Effect.SYSTEM_ABORT
        elif number == 1234:
            assert message.effect is Effect.STOP  # "is stopped, and can be started again"
        else:
            assert message.effect is (Effect.SHOWN if number in shown else Effect.CHANNEL_ABORT), number
