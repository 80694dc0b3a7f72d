"""From the words of a block to the elements of its path: axes, polar coordinates, G91, circles (manual 4.2 to 4.12).

    X Y Z, x c about a pole --> target in program coordinates --> coordinates.py --> Line, Arc in the machine's
    I J K, R: centre or radius of a circle          F, f: feed

F, centre, radius, pole and polar coordinates are modal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from operator import add
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.reader import CENTRES
from isel_twin.firmware.bwo900.analysis.said import Said
from isel_twin.firmware.bwo900.analysis.values import Values
from isel_twin.firmware.bwo900.geometry.circles import arc_by_centre, arc_by_radius
from isel_twin.firmware.bwo900.geometry.curves import Bent, Cubic, Round
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Point, Straight
from isel_twin.firmware.bwo900.geometry.frames import Frame, polar
from isel_twin.firmware.bwo900.geometry.groups import CIRCLES, CORRECTION, SPLINES
from isel_twin.firmware.bwo900.messages import Code, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import G, P, Q
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import Text, Word

NEAR_MM: Final = 1e-9  # shorter paths are left out
BENT: Final = (*SPLINES, G.POLYNOMIAL)


class Targets:
    """Turns words into elements, and moves the coordinates to their end."""

    def __init__(self, parameters: Parameters, values: Values, coordinates: Coordinates) -> None:
        self._parameters, self._values, self._coordinates = parameters, values, coordinates
        self.notes: list[Message] = []
        """Messages that do not break the program off; whoever executes the blocks takes them."""
        self.clear()

    def clear(self) -> None:
        """A program begins."""
        self.feed_mm_min: float | None = None
        self._centre: dict[str, float] = {}
        self._radius: float | None = None
        self._pole, self._polar, self._polar_correction = (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)

    # Words

    def read_feed(self, said: Said, taken: frozenset[str]) -> None:
        """Feed, and centre or radius of circles. taken: words of a drilling cycle."""
        for word in said.block.words:
            if word.name in taken:
                continue
            if word.name == "F":
                self.feed_mm_min = self._values.of(word.value)
            elif word.name == "f":
                said.end_feed = self._values.of(word.value)
            elif word.name in CENTRES:
                self._centre[word.name] = self._values.of(word.value)
                self._radius = None
            elif word.name == "R":
                self._radius = self._values.of(word.value)

    def read_axes(self, said: Said, taken: frozenset[str]) -> dict[int, float] | None:
        """Targets in program coordinates by axis; None if the block has none, or G44, G92 or a pole takes them. taken:
        words of a drilling cycle; with only its depth it drills at the present position."""
        coordinates = self._coordinates
        names, modal, plane = coordinates.names, coordinates.modal, coordinates.frame.plane
        named: dict[int, float] = {}
        radial: dict[str, float] = {}
        in_polar = modal.polar == G.POLAR_ON
        letters = self._polar_letters() if in_polar else {}
        for word in said.block.words:
            if word.name in taken:
                if word.name in names:
                    here = 0.0 if modal.dimension == G.INCREMENTAL else coordinates.program_position[plane.first]
                    named.setdefault(plane.first, here)
            elif word.name in names:
                named[names[word.name]] = self._value_of(word, names[word.name])
            elif word.name in letters:
                radial[letters[word.name]] = self._values.of(word.value)
            elif word.name[0] not in "FSTIJKRft":
                raise ProgramError(Code.UNKNOWN_AXIS, word.name, word.column)
        if said.shifts or (said.groups and said.groups.get(CORRECTION) == G.AXIS_CORRECTION_ON):
            self._consume(named, radial, said)
            return None
        relative = set(named)
        if in_polar:
            self._pole = named.pop(plane.first, self._pole[0]), named.pop(plane.second, self._pole[1])
            relative = set(named)
            if radial:
                self._polar = (radial.get("r", self._polar[0]), radial.get("a", self._polar[1]))
                radius, angle = self._polar
                if modal.correction == G.AXIS_CORRECTION_ON:
                    radius, angle = abs(radius) + self._polar_correction[0], angle + self._polar_correction[1]
                named[plane.first], named[plane.second] = polar(self._pole, radius, angle)
        return self._carried(self._absolute(named, relative, said), said) if named else None

    def _carried(self, targets: dict[int, float], said: Said) -> dict[int, float]:
        """With the axes that the block turns or shifts, and does not program: they go to their places as turned (4.16,
        example 1), or stay (bwo900/6). Those of a cycle and of G66 stay."""
        carried = {axis: value for axis, value in self._coordinates.carried.items() if axis not in targets}
        if not carried or said.cycles or G.BARE in said.blockwise:
            return targets
        if not self._parameters.readings.rotation_stays:
            return carried | targets
        text = Text("turned axes stay (rotation_stays); at the manual's control they go to their places as turned")
        said.block = replace(said.block, message=said.block.message or text)
        return targets

    def _value_of(self, word: Word, axis: int) -> float:
        """The target that an axis word names; of a polynomial V3 + V2 + V1 beyond the start."""
        if not word.terms:
            return self._values.of(word.value)
        coordinates = self._coordinates
        if coordinates.modal.motion != G.POLYNOMIAL:
            raise ProgramError(Code.SYNTAX, f"{word.name}:[...] without G52", word.column)
        way = sum(self._values.of(term) for term in word.terms)
        return way if coordinates.modal.dimension == G.INCREMENTAL else coordinates.program_position[axis] + way

    def _polar_letters(self) -> dict[str, str]:
        """Letters of radius (r) and angle (a): q150 and q151."""
        radius, angle = (
            chr(int(self._parameters.get(q, default, "q")))
            for q, default in ((Q.POLAR_RADIUS, ord("x")), (Q.POLAR_ANGLE, ord("c")))
        )
        return {radius: "r", angle: "a"}

    def _consume(self, named: Mapping[int, float], radial: Mapping[str, float], said: Said) -> None:
        """G92, G44: the words are a shift or a correction; nothing moves. G44 also corrects radius and angle."""
        coordinates = self._coordinates
        if said.shifts:
            coordinates.shift = tuple(named.get(axis, 0.0) for axis in range(len(coordinates.names)))
            for axis, value in enumerate(coordinates.shift):
                self._parameters.write(P.SHIFT_ANALYSED + axis, value)
        else:
            coordinates.correction = tuple(named.get(axis, old) for axis, old in enumerate(coordinates.correction))
            radius, angle = self._polar_correction
            self._polar_correction = (radial.get("r", radius), radial.get("a", angle))
        coordinates.renew()

    def _absolute(self, named: Mapping[int, float], relative: set[int], said: Said) -> dict[int, float]:
        """Absolute targets: with G91 the axes of `relative` count from `_counted_from`."""
        if self._coordinates.modal.dimension == G.ABSOLUTE:
            return dict(named)
        now = self._counted_from(said)
        return {axis: value + (now[axis] if axis in relative else 0.0) for axis, value in named.items()}

    def _counted_from(self, said: Said) -> Point:
        """Origin of G91: the program's position, with G66 the machine's."""
        coordinates = self._coordinates
        bare = G.BARE in said.blockwise
        return coordinates.frame.bare.program(coordinates.position) if bare else coordinates.counted_from

    # Elements

    def path(self, said: Said, targets: Mapping[int, float]) -> tuple[Element | Bent, ...]:
        """The elements to a target; the position moves there. Raises ProgramError: M1230 no feed, those of circles."""
        coordinates = self._coordinates
        frame, start, bare = self._frame_of(said)
        goal = tuple(targets.get(axis, value) for axis, value in enumerate(start))
        if said.blockwise and G.THREE_POINTS in said.blockwise and coordinates.modal.motion == G.RAPID:
            coordinates.g(G.LINE)
        motion = coordinates.modal.motion
        end = coordinates.machine(frame, goal, targets)
        element: Element | Bent | None = None
        if motion in BENT:
            self._without_correction(motion)
        if motion == G.POLYNOMIAL:
            element = self._polynomial(said, frame, start, goal, targets)
        elif motion in CIRCLES and self._turns(targets):
            element = self._circle(said, frame, start, end)
        elif math.dist(coordinates.position, end) > NEAR_MM:
            element = Straight(coordinates.position, end)
        if element is not None and motion and self.feed_mm_min is None and said.feed is None:
            raise ProgramError(Code.NO_FEED)
        coordinates.arrive(end, coordinates.frame.program(end) if bare else goal, targets)
        return () if element is None else (element,)

    def arc(self, said: Said, targets: Mapping[int, float], centre: tuple[float, float], turn: int) -> Arc:
        """The arc of a cycle; the position moves to its end. Targets and centre in program coordinates, turn: +1
        counter-clockwise there."""
        coordinates = self._coordinates
        frame, start, bare = self._frame_of(said)
        goal = tuple(targets.get(axis, value) for axis, value in enumerate(start))
        end = coordinates.machine(frame, goal, targets)
        made = self._about(frame, centre, end, turn)
        coordinates.arrive(end, coordinates.frame.program(end) if bare else goal, targets)
        return made

    def _frame_of(self, said: Said) -> tuple[Frame, Point, bool]:
        """The frame of a block, the position in it, and True for that of G66."""
        coordinates = self._coordinates
        if said.blockwise and G.BARE in said.blockwise:
            bare = coordinates.frame.bare
            return bare, bare.program(coordinates.position), True
        return coordinates.frame, coordinates.program_position, False

    def _about(self, frame: Frame, centre: tuple[float, float], end: Point, turn: int) -> Arc:
        """The arc about a centre in program coordinates. P8843: largest difference of its radii."""
        here, there = self._coordinates.position, frame.centre(centre)
        turn = -turn if frame.mirrored else turn
        return arc_by_centre(here, end, frame.plane, there, turn, self._parameters.given(P.CENTRE_ERROR, 0.003))

    def _turns(self, targets: Mapping[int, float]) -> bool:
        """True if a block with G02 or G03 makes a circle."""
        plane = self._coordinates.frame.plane
        return plane.first in targets or plane.second in targets or bool(self._centre or self._radius)

    def _without_correction(self, motion: int) -> None:
        if self._coordinates.modal.radius != G.RADIUS_OFF:
            raise ProgramError(Code.EXCLUDED, f"G{motion} with radius correction; G40 comes first")

    def _polynomial(
        self, said: Said, frame: Frame, start: Point, goal: Point, targets: Mapping[int, float]
    ) -> Cubic | None:
        """G52: the cubic of words such as X:[V3,V2,V1]. start, goal: in program coordinates."""
        coordinates = self._coordinates
        terms = [[0.0] * len(start) for _ in range(3)]
        for word in said.block.words:
            if word.name in coordinates.names:
                if not word.terms:
                    raise ProgramError(Code.SYNTAX, f"G52 needs {word.name}:[V3,V2,V1]", word.column)
                for term, value in zip(terms, word.terms, strict=True):
                    term[coordinates.names[word.name]] = self._values.of(value)
        here = coordinates.machine(frame, start, targets)
        v3, v2, v1 = (
            tuple(
                b - a for a, b in zip(here, coordinates.machine(frame, tuple(map(add, start, t)), targets), strict=True)
            )
            for t in terms
        )
        cubic = Cubic(coordinates.position, v1, v2, v3)
        return cubic if cubic.length_mm > NEAR_MM else None

    def _in_space(self, said: Said, frame: Frame, end: Point) -> Round:
        """The circle of a block with three axes and three centres: G02 the long arc, G03 the short one."""
        coordinates = self._coordinates
        self._without_correction(coordinates.modal.motion)
        base = self._counted_from(said) if coordinates.modal.dimension == G.INCREMENTAL else (0.0,) * len(end)
        given = tuple(b + self._centre[name] for b, name in zip(base, CENTRES, strict=False)) + base[len(CENTRES) :]
        order = coordinates.frame.order
        centre = frame.machine(tuple(given[order.index(axis)] for axis in range(len(end))))
        try:
            made = Round(coordinates.position, end, centre, coordinates.modal.motion == G.CIRCLE_CLOCKWISE)
        except ValueError as error:
            raise ProgramError(Code.CENTRE_OFF, str(error)) from None
        if abs(made.radius_mm - made.end_radius_mm) > self._parameters.given(P.CENTRE_ERROR, 0.003):
            radii = f"{made.radius_mm:.4f} mm at the start, {made.end_radius_mm:.4f} mm at the end"
            raise ProgramError(Code.CENTRE_OFF, f"radius {radii}")
        return made

    def _circle(self, said: Said, frame: Frame, start: Point, end: Point) -> Arc | Round:
        """The arc to a target: by radius, or by centre I, J, K. start: in program coordinates."""
        coordinates, plane = self._coordinates, frame.plane
        turn = 1 if coordinates.modal.motion == G.CIRCLE_COUNTER_CLOCKWISE else -1
        if self._radius is not None:
            turned = -turn if frame.mirrored else turn
            arc, corrected = arc_by_radius(coordinates.position, end, plane, self._radius, turned)
            if corrected:
                self._note(said, Code.RADIUS_CORRECTED, f"half of the chord is {abs(arc.radius_mm):.4g} mm")
            return arc
        if not self._centre:
            raise ProgramError(Code.CIRCLE_WITHOUT_CENTRE)
        if all(said.block.word(name) for name in (*CENTRES, *list(coordinates.names)[:3])):
            return self._in_space(said, frame, end)
        letters = tuple(CENTRES[coordinates.logical(axis)] for axis in (plane.first, plane.second))
        here = plane.of(start if coordinates.modal.dimension == G.ABSOLUTE else self._counted_from(said))
        base = here if coordinates.modal.dimension == G.INCREMENTAL else (0.0, 0.0)
        u, v = (
            base[i] + self._centre[letter] if letter in self._centre else (here[i] if base[i] else 0.0)
            for i, letter in enumerate(letters)
        )
        return self._about(frame, (u, v), end, turn)

    def _note(self, said: Said, number: int, detail: str) -> None:
        block = said.block
        self.notes.append(
            message(number, program=said.program, block=block.number or 0, column=block.column, detail=detail)
        )
