"""Coordinates in force, and the end of the path in machine and program coordinates (manual 4.13 on).

    program position --- frame ---> position (machine)        frame: correction G44, rotation G45, mirror G61 G62,
                                                                     shift G92, zero point G53 on, tool length

When G functions or parameters change the frame, the machine's position stays and the program's changes (`renew`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.geometry.elements import XY, YZ, ZX, Plane, Point
from isel_twin.firmware.bwo900.geometry.frames import Frame, Rotation
from isel_twin.firmware.bwo900.geometry.groups import COORDINATES, GROUPS, PLANE, START, ZERO, ZERO_POINTS, Modal
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import G, P, Q
from isel_twin.firmware.bwo900.parameters import Parameters, byte

ROTATION_SET: Final[Mapping[int, str]] = {P.ROTATION_U0: "u0", P.ROTATION_V0: "v0", P.ROTATION_ANGLE: "angle_deg"}
ROTATION_ADDED: Final[Mapping[int, str]] = {P.ROTATION_DU: "du", P.ROTATION_DV: "dv", P.ROTATION_DANGLE: "dangle_deg"}

# the q that defines a plane when a program begins, and the plane if q is not valid
PLANES: Final[Mapping[int, tuple[int, Plane]]] = {
    G.PLANE_XY: (Q.PLANE_XY, XY),
    G.PLANE_ZX: (Q.PLANE_ZX, ZX),
    G.PLANE_YZ: (Q.PLANE_YZ, YZ),
}
# the P that defines a free plane, and the plane if P is not valid
FREE_PLANES: Final[Mapping[int, tuple[int, Plane]]] = {
    G.FREE_PLANE_1: (P.FREE_PLANE_1, XY),
    G.FREE_PLANE_2: (P.FREE_PLANE_2, ZX),
    G.FREE_PLANE_3: (P.FREE_PLANE_3, YZ),
}


class Coordinates:
    """The coordinates in force for the next path, and its beginning."""

    names: Mapping[str, int]  # axes by their letters
    modal: Modal  # G functions in force
    shift: Point  # G92
    correction: Point  # G44
    position: Point  # end of the path, machine coordinates, mm
    program_position: Point  # the same in the program's coordinates
    frame: Frame

    def __init__(self, parameters: Parameters, length_mm: float) -> None:
        self._parameters = parameters
        try:
            self.reset((0.0, 0.0, 0.0), length_mm)
        except ProgramError:  # the table of zero points is at a wrong address, which the first program will be told
            self.reset((0.0, 0.0, 0.0), length_mm, START.with_g(G.NO_ZERO))

    def reset(self, position: Point, length_mm: float, modal: Modal = START) -> None:
        """A program begins. position: of the axes, machine coordinates. length_mm: of the tool. Raises ProgramError
        M1240, M1302."""
        self._letters = tuple(name for name, _ in self._parameters.axes)
        axes = len(self._letters)
        self.modal = modal
        self._planes = {g: _plane_of(self._parameters.get(q, 0.0, "q"), other) for g, (q, other) in PLANES.items()}
        self.rotation, self.shift, self.correction = Rotation(), (0.0,) * axes, (0.0,) * axes
        self._length = length_mm
        self.position = tuple(position) + (0.0,) * (axes - len(position))
        self._unmirrored: dict[int, float] = {}
        """Program coordinates, as before a mirror was switched, of axes that have not moved since."""
        self.carried: dict[int, float] = {}
        """Where both axes of the plane were in the program, if the present block turns or shifts them (P165, P166,
        P168)."""
        self._known: tuple[object, ...] | None = None  # inputs of the computed frame
        self.frame = self._frame_now()
        self.program_position = self.frame.program(self.position)

    # What changes them

    def g(self, number: int) -> None:
        """Put a G function in force; call `renew` before the next path. G45 takes the present P160, P161, P163."""
        self.modal = self.modal.with_g(number)
        if number == G.ROTATION_ON:
            p = self._parameters
            self.rotation = replace(
                self.rotation, u0=p.get(P.ROTATION_U0), v0=p.get(P.ROTATION_V0), angle_deg=p.get(P.ROTATION_ANGLE)
            )
        elif number == G.ROTATION_OFF:
            self.rotation = replace(self.rotation, du=0.0, dv=0.0, dangle_deg=0.0)

    def written(self, number: int, value: float | None) -> None:
        """Take a written parameter P: those of the rotation act at once."""
        if number in ROTATION_SET:
            self.rotation = self.rotation.set(**{ROTATION_SET[number]: value or 0.0})
            self.renew()
        elif number in ROTATION_ADDED:
            if self.frame.rotation is not None and not self.carried:
                plane = self.frame.plane
                self.carried = {axis: self.program_position[axis] for axis in (plane.first, plane.second)}
            self.rotation = self.rotation.added(**{ROTATION_ADDED[number]: value or 0.0})
            self.renew()

    def use_length(self, length_mm: float) -> None:
        """Set the length of the tool in use."""
        self._length = length_mm
        self.renew()

    def hand(self, length_mm: float, position: Point) -> None:
        """HAND: only its zero point (P8758), its plane (P8757) and the tool's length."""
        zero, plane = int(self._parameters.get(P.HAND_ZERO)), int(self._parameters.get(P.HAND_PLANE))
        plane = plane if GROUPS.get(plane) == PLANE else G.PLANE_XY
        try:
            self._without_program(zero if zero in ZERO_POINTS else G.NO_ZERO, plane, length_mm, position)
        except ProgramError:  # the table of zero points is at a wrong address
            self._without_program(G.NO_ZERO, plane, length_mm, position)

    def forget_in_hand(self) -> None:
        """HAND: end the reversal of axes (P8892), and their exchange if P8880 = 2."""
        p = self._parameters
        for number in (P.MIRRORED, *((P.EXCHANGE,) if p.get(P.EXCHANGE) == 2.0 else ())):
            if p.loaded(number):
                p.write(number, None)
                self.renew()

    def _without_program(self, zero: int, plane: int, length_mm: float, position: Point) -> None:
        """Raises ProgramError M1240, M1302."""
        nothing = (0.0,) * len(self.names)
        self.modal = START.with_g(zero).with_g(plane)
        self.rotation, self.shift, self.correction = Rotation(), nothing, nothing
        self._length = length_mm
        self.renew()
        self.stand(position)

    def stand(self, position: Point) -> None:
        """Set the position of axes that are not at the end of the path: after a deleted path, or a move in another
        mode."""
        self.position = tuple(position) + self.position[len(position) :]
        self.program_position = self.frame.program(self.position)
        self._unmirrored.clear()

    def arrive(self, position: Point, program_position: Point, axes: Iterable[int]) -> None:
        """Set the end of the path; these axes were programmed."""
        self.position, self.program_position = position, program_position
        for axis in axes:
            self._unmirrored.pop(axis, None)

    @property
    def counted_from(self) -> Point:
        """Origin of G91: the target is computed in the system before the mirror, then mirrored (4.21)."""
        return tuple(self._unmirrored.get(axis, value) for axis, value in enumerate(self.program_position))

    def renew(self) -> None:
        """Compute the frame again: the axes stay, and their program coordinates change."""
        known = (self.modal, self.rotation, self.shift, self.correction, self._length, self._parameters.revision)
        if known == self._known:
            return
        self._known = known
        frame = self._frame_now()
        if frame != self.frame:
            self._keep_unmirrored(frame)
            self.frame = frame
            self.program_position = frame.program(self.position)

    def _keep_unmirrored(self, frame: Frame) -> None:
        """If the mirrors have changed, keep the coordinates of the plane's axes as before."""
        old, plane = self.frame, frame.plane
        flags = (frame.mirror_first != old.mirror_first, frame.mirror_second != old.mirror_second)
        if not any(flags):
            self._unmirrored.clear()
            return
        before = replace(frame, mirror_first=old.mirror_first, mirror_second=old.mirror_second).program(self.position)
        for axis, turned in zip((plane.first, plane.second), flags, strict=True):
            if turned or frame.rotation is not None:
                self._unmirrored.setdefault(axis, before[axis])

    # Their use

    def machine(self, frame: Frame, goal: Point, targets: Mapping[int, float]) -> Point:
        """A target in machine coordinates; axes without a word stay, unless a rotation moves them."""
        place = frame.machine(goal)
        plane = frame.plane
        turned = frame.rotation is not None and (plane.first in targets or plane.second in targets)
        moving = set(targets) | ({plane.first, plane.second} if turned else set())
        return tuple(place[axis] if axis in moving else now for axis, now in enumerate(self.position))

    def logical(self, axis: int) -> int:
        """The program's axis for this axis of the machine (P8880)."""
        return self.frame.order.index(axis)

    def _frame_now(self) -> Frame:
        modal, axes = self.modal, len(self._letters)
        nothing = (0.0,) * axes
        order = _exchanged(self._parameters, axes)
        self.names = {name: order[axis] for axis, name in enumerate(self._letters)}
        plane = self._planes.get(modal.plane)
        if plane is None:
            number, other = FREE_PLANES[modal.plane]
            plane = _plane_of(self._parameters.get(number), other)
        plane = Plane(*(order[axis] for axis in (plane.first, plane.second, plane.third)))
        bound = modal.coordinates == G.MACHINE_COORDINATES
        zero = nothing if bound or modal.zero == G.NO_ZERO else self._zero_point(modal.zero)
        return Frame(
            axes=axes,
            plane=plane,
            correction=self.correction if modal.correction == G.AXIS_CORRECTION_ON else nothing,
            rotation=self.rotation if modal.rotation == G.ROTATION_ON else None,
            shift_first=int(self._parameters.get(P.ROTATION_ORDER)) >= 2,
            mirror_first=modal.mirror_first,
            mirror_second=modal.mirror_second,
            shift=nothing if bound else self.shift,
            zero=zero,
            length=0.0 if bound else self._length,
            senses=self._senses(order),
            order=order,
        )

    def _senses(self, order: tuple[int, ...]) -> Point | None:
        """P8892: a bit for each reversed axis of the program."""
        turned = int(self._parameters.get(P.MIRRORED))
        senses = tuple(-1.0 if turned >> order.index(axis) & 1 else 1.0 for axis in range(len(order)))
        return senses if -1.0 in senses else None

    def _zero_point(self, number: int) -> Point:
        """G54 to G59, G154 and on, of the workspace; 0 for axes that P8556 leaves out."""
        p = self._parameters
        hundred, rest = divmod(number, 100)
        entry = rest - G.MACHINE_ZERO + 6 * hundred
        workspace, mask = int(p.given(P.WORKSPACE, 1.0)), int(p.get(P.ZERO_MASK))
        return tuple(
            0.0 if mask >> axis & 1 else p.zero_point(entry, axis, workspace) for axis in range(len(self._letters))
        )


def _exchanged(p: Parameters, axes: int) -> tuple[int, ...]:
    """The machine's axis of each axis of the program: P8880 1 or 2, P8881 to P8889 each from (byte 2) to (byte 1); no
    exchange if they do not make a permutation."""
    order = list(range(axes))
    if p.get(P.EXCHANGE) in (1.0, 2.0):
        for number in range(P.EXCHANGE_FIRST, P.EXCHANGE_LAST + 1):
            value = p.get(number)
            source, target = byte(value, 2) - 1, byte(value, 1) - 1
            if 0 <= source < axes:
                order[source] = target
    return tuple(order) if sorted(order) == list(range(axes)) else tuple(range(axes))


def _plane_of(value: float, default: Plane) -> Plane:
    """A plane of three bytes, axes from 1; the default if they are not valid."""
    axes = tuple(byte(value, number) - 1 for number in (1, 2, 3))
    return Plane(*axes) if sorted(axes) == [0, 1, 2] else default


def start_state(p: Parameters) -> Iterator[int]:
    """G functions that a program begins with, beyond START (P8830, P8853, P8650 to the first deleted one)."""
    if zero := int(p.get(P.START_ZERO)):
        yield _known(zero, ZERO)
    if coordinates := int(p.get(P.START_COORDINATES)):
        yield _known(coordinates, COORDINATES)
    if p.has_spindle and int(p.get(P.SPEED_KIND)) == G.CUTTING_SPEED:
        yield G.CUTTING_SPEED
    for number in range(P.START_G_FIRST, P.START_G_LAST + 1):
        if not p.loaded(number):
            return
        yield _known(int(p.get(number)), None)


def _known(number: int, group: int | None) -> int:
    """Check that a G function is modal and of this group. Raises ProgramError M1249."""
    if GROUPS.get(number) is None or (group is not None and GROUPS[number] != group):
        raise ProgramError(Code.WRONG_START_STATE, f"G{number} at the start of a program")
    return number
