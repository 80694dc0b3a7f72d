"""A cycle in execution: its call, and the path of each of its moves (manual 6.4, 7).

    block with G81 ... G99 --> which cycles --> Call --> cycles/ --> Move --> elements and changes of a PathBlock

Other words of the block come with the first move (functions before the path) or after the last one.
A pattern cycle (G86 to G89) carries out a machining cycle at each of its places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.analysis.cycles.measuring import pointed
from isel_twin.firmware.bwo900.analysis.cycles.moves import Moves
from isel_twin.firmware.bwo900.analysis.functions import Functions
from isel_twin.firmware.bwo900.analysis.reader import Reader
from isel_twin.firmware.bwo900.analysis.said import Said
from isel_twin.firmware.bwo900.analysis.stack import Goal, Level
from isel_twin.firmware.bwo900.analysis.targets import Targets
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.geometry.blocks import BlockEnd, Correction, MFunction, Stop
from isel_twin.firmware.bwo900.geometry.curves import Bent
from isel_twin.firmware.bwo900.geometry.elements import Element
from isel_twin.firmware.bwo900.geometry.groups import Modal
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, G, P
from isel_twin.firmware.bwo900.parameters import Parameters

# P numbers whose values a cycle gets when it begins
CYCLE_PARAMETERS: Final = (*range(P.CYCLES_FIRST, P.CYCLES_LAST + 1), *range(P.PATTERNS_FIRST, P.PATTERNS_LAST + 1))
MOTION: Final[Mapping[Kind, int]] = {
    Kind.RAPID: G.RAPID, Kind.LINE: G.LINE, Kind.TAP: G.LINE, Kind.CLOCKWISE: G.CIRCLE_CLOCKWISE,
    Kind.COUNTER_CLOCKWISE: G.CIRCLE_COUNTER_CLOCKWISE,
}  # fmt: skip


@dataclass
class Cycle:
    """A cycle in execution, and what follows its end."""

    said: Said
    level: Level
    moves: Moves
    post: list[MFunction]
    stop: Stop
    modal: Modal  # in force again at its end
    comes: bool  # its first move only leads to the pattern: pre functions come after it
    goal: Goal | None = None

    @property
    def measures(self) -> bool:
        """Its moves wait for the probe."""
        return G.MEASURING in self.said.cycles


def chosen(numbers: Sequence[int], staying: int | None) -> tuple[int, int | None, int | None]:
    """From the cycles of a block: the called one, the pattern and the machining cycle. staying: the drilling cycle in
    force. Raises ProgramError M1232: too many."""
    numbers = [G.DRILLING if number == G.DRILLING_WITH_DWELL else number for number in numbers]
    pattern = next((n for n in numbers if G.RAY <= n <= G.CIRCLE_OF_PLACES), None)
    machining = next((n for n in numbers if n != pattern), None if pattern is None else staying)
    if len(numbers) > (2 if pattern is not None else 1):
        raise ProgramError(Code.EXCLUDED, f"cycles {', '.join(f'G{n}' for n in numbers)} in one block")
    return (numbers[0] if pattern is None else pattern), pattern, machining


def comes_first(pattern: int | None, coordinates: Coordinates, targets: Mapping[int, float]) -> bool:
    """True if a pattern begins with a move to its place."""
    plane = coordinates.frame.plane
    return pattern == G.CIRCLE_OF_PLACES or (
        pattern is not None and not {plane.first, plane.second}.isdisjoint(targets)
    )


def call_of(
    parameters: Parameters,
    coordinates: Coordinates,
    targets: Targets,
    reader: Reader,
    tools: Tools,
    words: Mapping[int, float],
    machining: int | None,
    *,
    bare: bool,
    measures: bool,
) -> Call:
    """The call of a cycle; bare: G66, measures: G69."""
    loaded = {number: parameters.get(number) for number in CYCLE_PARAMETERS if parameters.loaded(number)}
    if measures:
        loaded |= pointed(parameters)
    fastest = max((parameters.axis(axis, Axis.SPEED, 0.0) for axis in range(len(coordinates.names))), default=0.0)
    return Call(
        parameters=loaded,
        position=coordinates.frame.bare.program(coordinates.position) if bare else coordinates.program_position,
        plane=coordinates.frame.plane,
        words=dict(words),
        feed_mm_min=targets.feed_mm_min,
        rapid_mm_min=parameters.given(P.RAPID, fastest),
        speed_rpm=reader.speed_rpm,
        turning=reader.turning,
        motion=coordinates.modal.motion,
        tool_radius_mm=abs(tools.radius_mm),
        inner=machining,
        polar=coordinates.modal.polar == G.POLAR_ON,
        coupled=parameters.has_spindle,
        has_tool=bool(parameters.get(P.TOOL_PATH)),
    )


def step(
    move: CycleMove,
    said: Said,
    coordinates: Coordinates,
    targets: Targets,
    functions: Functions,
    programmed: int,
    *,
    coupled: bool,
) -> tuple[tuple[Element | Bent, ...], dict[str, object]]:
    """Elements of a move, and fields of its PathBlock that differ from its block's. programmed: 0 to 3, G00 to G03;
    coupled: tapping follows the measured speed of the spindle."""
    coordinates.g(MOTION.get(move.kind, programmed))
    said.feed, said.dwell_s = move.feed_mm_min, move.dwell_s
    elements: tuple[Element | Bent, ...] = ()
    if move.centre is not None:
        turn = 1 if move.kind is Kind.COUNTER_CLOCKWISE else -1
        elements = (targets.arc(said, move.target, move.centre, turn),)
    elif move.target:
        elements = targets.path(said, move.target)
    post = tuple(MFunction(code, (), functions.of(code).halt) for code in move.m)
    changes: dict[str, object] = {"watched": move.watched, "post": post, "main": False, "correction": Correction()}
    if move.exact_stop or move.dwell_s is not None:
        changes["end"] = BlockEnd.EXACT_STOP
    if move.kind is Kind.TAP:
        changes |= {"override": False, "per_turn": coupled}
    return elements, changes
