"""From program coordinates to machine positions: a chain of small functions (manual 4.14 to 4.26).

    target of the program (G90, G91)
      + axis correction            G44
      polar -> Cartesian           G10
      rotation and G92             G45; P8859 gives the order
      mirror                       G61, G62: after the rotation, about its origin
      + zero point                 G53 to G59 ...
      + tool length                along the third axis of the plane
      sense of each axis           P8892
    = machine position

In the plane (u, v); (U0, V0): origin of the rotation, E: its angle, (dU, dV): P165, P166:

    rotate, then shift    p = mirror(R(E) (uv + dUV)) + U0V0 + G92
    shift, then rotate    p = mirror(R(E) (uv + dUV + G92)) + U0V0
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import add, mul, sub
from typing import Final

from isel_twin.firmware.bwo900.geometry.elements import XY, Plane, Point


@dataclass(frozen=True, slots=True)
class Rotation:
    """G45: origin P160, P161, angle P163, and the sums of P165, P166, P168 since."""

    u0: float = 0.0
    v0: float = 0.0
    angle_deg: float = 0.0
    du: float = 0.0
    dv: float = 0.0
    dangle_deg: float = 0.0

    def added(self, du: float = 0.0, dv: float = 0.0, dangle_deg: float = 0.0) -> Rotation:
        """Each write of P165, P166, P168 adds to the sum."""
        return replace(self, du=self.du + du, dv=self.dv + dv, dangle_deg=self.dangle_deg + dangle_deg)

    def set(self, u0: float | None = None, v0: float | None = None, angle_deg: float | None = None) -> Rotation:
        """New P160, P161, P163, each without its sum."""
        changed = self
        if u0 is not None:
            changed = replace(changed, u0=u0, du=0.0)
        if v0 is not None:
            changed = replace(changed, v0=v0, dv=0.0)
        if angle_deg is not None:
            changed = replace(changed, angle_deg=angle_deg, dangle_deg=0.0)
        return changed

    def turned(self, u: float, v: float) -> tuple[float, float]:
        """A point turned about the origin of the plane; exact for quarters of a turn."""
        angle = math.fmod(self.angle_deg + self.dangle_deg, 360.0)
        quarters, rest = divmod(angle, 90.0)
        if rest == 0.0:
            cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
        else:
            cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        return u * cosine - v * sine, u * sine + v * cosine


UNTURNED: Final = Rotation()


@dataclass(frozen=True, slots=True)
class Frame:
    """All that lies between program and machine; lengths in mm, points have one for each axis."""

    axes: int = 3
    plane: Plane = XY
    correction: Point = (0.0, 0.0, 0.0)  # G44
    rotation: Rotation | None = None
    shift_first: bool = False  # P8859 2 and 3: G92 is added before the rotation
    mirror_first: bool = False  # G61
    mirror_second: bool = False  # G62
    shift: Point = (0.0, 0.0, 0.0)  # G92
    zero: Point = (0.0, 0.0, 0.0)
    length: float = 0.0  # of the tool, along the third axis of the plane
    senses: Point | None = None  # P8892: -1 for reversed axes; None: none
    order: tuple[int, ...] = (0, 1, 2)  # the machine's axis of each axis of the program (P8880)

    @property
    def mirrored(self) -> bool:
        """True if the sense of circles and the side of corrections are reversed."""
        other = self.senses is not None and self.senses[self.plane.first] != self.senses[self.plane.second]
        return (self.mirror_first != self.mirror_second) != other

    @property
    def bare(self) -> Frame:
        """G66, for one block: senses and order alone."""
        nothing = (0.0,) * self.axes
        return Frame(self.axes, self.plane, nothing, shift=nothing, zero=nothing, senses=self.senses, order=self.order)

    def machine(self, program: Point) -> Point:
        """The machine position of a point of the program, including the correction."""
        point = self._inner(tuple(map(add, program, self.correction)))
        return self.sensed(tuple(map(add, map(add, point, self.zero), self.plane_length)))

    def centre(self, program: tuple[float, float]) -> tuple[float, float]:
        """The same for a centre in the plane: corrections of axes move centres, too."""
        return self.plane.of(self.machine(self.plane.into((0.0,) * self.axes, *program)))

    def program(self, machine: Point) -> Point:
        """The point of the program for a machine position: the inverse of `machine`."""
        point = tuple(map(sub, map(sub, self.sensed(machine), self.zero), self.plane_length))
        rotation = self.rotation or UNTURNED
        if not self.shift_first:
            point = tuple(map(sub, point, self.shift_mirrored))
        u, v = self.plane.of(point)
        u, v = u - rotation.u0, v - rotation.v0
        u, v = (-u if self.mirror_first else u), (-v if self.mirror_second else v)
        u, v = Rotation(angle_deg=-(rotation.angle_deg + rotation.dangle_deg)).turned(u, v)
        point = self.plane.into(point, u - rotation.du, v - rotation.dv)
        if self.shift_first:
            point = tuple(map(sub, point, self.shift))
        return tuple(map(sub, point, self.correction))

    @property
    def plane_length(self) -> Point:
        """The tool length as a shift of all axes."""
        third = self.plane.third
        if not self.length or not 0 <= third < self.axes:
            return (0.0,) * self.axes
        return (*(0.0,) * third, self.length, *(0.0,) * (self.axes - third - 1))

    @property
    def shift_mirrored(self) -> Point:
        """G92 for adding after rotation and mirror: mirrored with the axes of the plane (manual 4.21)."""
        if not self.mirror_first and not self.mirror_second:
            return self.shift
        u, v = self.plane.of(self.shift)
        return self.plane.into(self.shift, -u if self.mirror_first else u, -v if self.mirror_second else v)

    def _inner(self, point: Point) -> Point:
        """Rotation, mirror and G92."""
        rotation = self.rotation or UNTURNED
        if self.shift_first:
            point = tuple(map(add, point, self.shift))
        u, v = self.plane.of(point)
        u, v = rotation.turned(u + rotation.du, v + rotation.dv)
        u, v = (-u if self.mirror_first else u), (-v if self.mirror_second else v)
        point = self.plane.into(point, u + rotation.u0, v + rotation.v0)
        if not self.shift_first:
            point = tuple(map(add, point, self.shift_mirrored))
        return point

    def sensed(self, point: Point) -> Point:
        """P8892 applied; its own inverse."""
        return point if self.senses is None else tuple(map(mul, point, self.senses))


def polar(pole: tuple[float, float], radius: float, angle_deg: float) -> tuple[float, float]:
    """The point (u, v) for a pole (u, v); the radius counts without its sign (manual 4.10)."""
    u, v = Rotation(angle_deg=angle_deg).turned(abs(radius), 0.0)
    return pole[0] + u, pole[1] + v
