"""Zeros from which a program's numbers count: the active system G54 .. G59.3, G92 or G52, the length of the tool."""

from __future__ import annotations

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Place, Point

ORIGIN: Point = (0.0, 0.0, 0.0)
NAMES = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")


class Offsets:
    """Machine point = point of the program + system + G92 + length, in mm. base: that sum; active: the number of the
    system, 0 while all are off."""

    def __init__(self, settings: CamSettings) -> None:
        self._systems = {number: settings.machine_point(zero) for number, zero in settings.zeros.items()}
        self._systems.setdefault(1, settings.machine_point(settings.zero))
        self._shift = ORIGIN  # of G92 and G52
        self._shifted = False
        self.active = 1
        self.length = 0.0
        self.base = self._sum()

    def select(self, number: int, place: Place) -> None:
        """Raises CamError for a system that nobody has set."""
        if number not in self._systems:
            raise CamError(
                f"{NAMES[number - 1]} is not known; set zeros.{number} = [x, y, z], or G10 L2 P{number} before", place
            )
        self.active = number
        self.base = self._sum()

    def switch_off(self) -> None:
        """G53 of DIN 66025: points are those of the machine until a system is selected."""
        self.active = 0
        self.base = ORIGIN

    def set_system(self, number: int, values: dict[int, float]) -> None:
        """G10 L2: coordinates of the system by axis."""
        old = self._systems.get(number, ORIGIN)
        self._systems[number] = _with(old, values)
        self.base = self._sum()

    def set_system_here(self, number: int, values: dict[int, float], machine: Point) -> None:
        """G10 L20: so that the tool stands at these coordinates."""
        shift = self._shift if self._shifted else ORIGIN
        rest = (shift[0], shift[1], shift[2] + self.length)
        self.set_system(number, {axis: machine[axis] - rest[axis] - value for axis, value in values.items()})

    def shift_here(self, values: dict[int, float], at: Point) -> None:
        """G92: so that the tool, at `at`, stands at these coordinates."""
        shift = self._shift if self._shifted else ORIGIN
        self.shift(_by_axis(shift, {axis: shift[axis] + at[axis] - value for axis, value in values.items()}))

    def shift(self, values: dict[int, float]) -> None:
        """G52."""
        self._shift = _with(self._shift if self._shifted else ORIGIN, values)
        self._shifted = True
        self.base = self._sum()

    def use_shift(self, use: bool, forget: bool = False) -> None:
        """G92.2, G92.3; G92.1 forgets."""
        self._shifted = use
        if forget:
            self._shift = ORIGIN
        self.base = self._sum()

    def set_length(self, length: float) -> None:
        self.length = length
        self.base = self._sum()

    def _sum(self) -> Point:
        if not self.active:
            return ORIGIN
        x, y, z = self._systems[self.active]
        dx, dy, dz = self._shift if self._shifted else ORIGIN
        return x + dx, y + dy, z + dz + self.length


def _with(point: Point, values: dict[int, float]) -> Point:
    x, y, z = (values.get(axis, old) for axis, old in enumerate(point))
    return x, y, z


def _by_axis(point: Point, values: dict[int, float]) -> dict[int, float]:
    return dict(enumerate(_with(point, values)))
