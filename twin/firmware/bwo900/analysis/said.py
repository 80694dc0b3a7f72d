"""The content of a block read so far, and its PathBlock.

block --> reader.py (G, M, S, T) --> Said --> targets.py (axes) --> elements
                                      |                                |
                                      +----------> path_block <--------+
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.stack import Goal
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.analysis.values import Later
from isel_twin.firmware.bwo900.geometry.blocks import BlockEnd, Correction, MFunction, PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.curves import Bent
from isel_twin.firmware.bwo900.geometry.elements import Element
from isel_twin.firmware.bwo900.geometry.groups import SPLINES
from isel_twin.firmware.bwo900.geometry.in_force import InForce
from isel_twin.firmware.bwo900.numbers import G, P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

Called: TypeAlias = tuple[str, int | None, int | None]  # program, first and last block if named


@dataclass
class Said:
    """The content of a block read so far."""

    block: ProgramBlock
    program: str
    main: bool  # True for a block of a program, False for one of a cycle
    parameters: Later = field(default_factory=list)
    synchronises: bool = False  # analysis waits until it has been executed
    blockwise: set[int] = field(default_factory=set)  # G functions for this block alone
    groups: dict[int, int] = field(default_factory=dict)  # the G function of each group that it has
    cycles: list[int] = field(default_factory=list)
    pre: list[MFunction] = field(default_factory=list)
    post: list[MFunction] = field(default_factory=list)
    speeds: dict[int, float] = field(default_factory=dict)
    dwell_s: float | None = None
    feed: float | None = None  # of a cycle's move, in place of F
    end_feed: float | None = None
    tool: int | None = None
    stop: Stop = Stop.NONE
    goal: Goal | None = None  # M23
    jump: Goal | None = None  # of an M function with a jump
    call: Called | None = None  # a subprogram, its first and last block
    hidden: bool = False  # T calls Z5
    passes: int | None = None  # M24
    loops_back: bool = False  # M25
    returns: bool = False  # M02
    activates: bool = False  # M16: the tool data are used from here on
    changes: bool = False  # M06
    length: bool = False  # `tl`: another tool length
    watches: bool = False  # M26
    shifts: bool = False  # G92
    zero_cleared: bool = False  # a zero point, which clears G92

    def goes_elsewhere(self) -> None:
        """After a jump by comparison: drop the functions of the block that control the program (bwo900/61)."""
        self.goal = self.passes = None
        self.loops_back = self.returns = False
        if self.stop in (Stop.END, Stop.REPEAT):
            self.stop = Stop.NONE


def path_block(
    said: Said,
    elements: tuple[Element | Bent, ...],
    coordinates: Coordinates,
    feed_mm_min: float | None,
    tools: Tools,
    parameters: Parameters,
    in_force: InForce,
) -> PathBlock:
    """The PathBlock of a block. feed_mm_min: F in force."""
    rapid, alone = coordinates.modal.motion == G.RAPID, said.blockwise
    feed = said.feed if said.feed is not None else feed_mm_min
    chamfer_mm, rounding_mm = _transition(parameters) if alone and G.CORNER in alone else (None, None)
    return PathBlock(
        program=said.program,
        number=said.block.number or 0,
        column=said.block.column,
        start=elements[0].start if elements else coordinates.position,
        elements=elements,
        plane=coordinates.frame.plane,
        rapid=rapid,
        feed_mm_min=None if rapid else feed,
        end_feed_mm_min=said.end_feed,
        per_turn=not rapid and coordinates.modal.feed == G.FEED_PER_TURN,
        override=coordinates.modal.override != G.OVERRIDE_FIXED,
        end=_end(said, coordinates, rapid, parameters),
        correction=Correction() if alone and elements and G.BARE in alone else correction(coordinates, tools),
        tool_mm=abs(tools.radius_mm) if elements and not rapid else 0.0,
        chamfer_mm=chamfer_mm,
        rounding_mm=rounding_mm,
        spline=bool(elements) and coordinates.modal.motion in SPLINES,
        contour_feed=coordinates.modal.motion == G.SPLINE_FEED,
        three_points=bool(alone) and G.THREE_POINTS in alone,
        pre=tuple(said.pre),
        post=tuple(said.post),
        dwell_s=said.dwell_s,
        speeds=dict(said.speeds),
        tool=said.tool,
        parameters=tuple(said.parameters),
        text=said.block.message,
        stop=said.stop,
        watched=said.watches,
        main=said.main,
        target=coordinates.program_position,
        in_force=in_force,
    )


def _transition(p: Parameters) -> tuple[float | None, float | None]:
    """G12: chamfer P70 or rounding P71, which wins; mm."""
    if p.given(P.ROUNDING, 0.0):
        return None, p.get(P.ROUNDING)
    return (p.get(P.CHAMFER) if p.given(P.CHAMFER, 0.0) else None), None


def _end(said: Said, coordinates: Coordinates, rapid: bool, parameters: Parameters) -> BlockEnd:
    """How the path ends; in order: functions and dwell, G08 or G09, G28 or G29, P8858 for rapid paths."""
    alone, functions = said.blockwise, said.pre or said.post
    halting = functions and any(function.halt for function in (*said.pre, *said.post))
    if halting or said.dwell_s is not None or (alone and G.EXACT_STOP_HERE in alone):
        return BlockEnd.EXACT_STOP
    if alone and G.NO_EXACT_STOP_HERE in alone:
        return BlockEnd.CONTINUOUS
    if coordinates.modal.exact == G.EXACT_STOP_ON:
        return BlockEnd.EXACT_STOP
    if rapid:
        kinds = (BlockEnd.EXACT_STOP, BlockEnd.FEED_STOP, BlockEnd.CONTINUOUS)
        kind = int(parameters.get(P.RAPID_END))
        return kinds[kind if kind in (1, 2) else 0]
    return BlockEnd.CONTINUOUS


def correction(coordinates: Coordinates, tools: Tools) -> Correction:
    """G41, G42: a negative radius and a mirror each change the side."""
    if coordinates.modal.radius == G.RADIUS_OFF:
        return Correction()
    side = 1 if coordinates.modal.radius == G.RADIUS_LEFT else -1
    radius = tools.radius_mm
    if (radius < 0.0) != coordinates.frame.mirrored:
        side = -side
    return Correction(side, abs(radius))
