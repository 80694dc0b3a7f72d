"""The iSMIF's settings with factory values (5.2), and the commands that set them (6.5 to 6.12)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from isel_twin.firmware.ismif.commands import TABLE_SIZE, Instruction


@dataclass(frozen=True)
class ReferenceSettings:
    """How one axis is referenced (6.11, 6.12): direction, table indexes of the three speeds, offset in steps."""

    positive: bool = False
    search: int = 2
    free: int = 2
    offset_speed: int = 2
    offset: int = 25


@dataclass
class Configuration:
    """The settings; they are lost without power (ismif/13)."""

    clock: bool = False
    full_step: bool = False
    plotter: bool = False
    start_hz: int = 200
    ramp_ms: int = 500
    speed_hz: list[int] = field(default_factory=lambda: [600] * TABLE_SIZE)
    reference: list[ReferenceSettings] = field(default_factory=lambda: [ReferenceSettings()] * 3)

    @property
    def half_steps(self) -> int:
        """Half steps of the stage in one step of a command: 2 for full steps out of the pattern generator (ismif/4)."""
        return 2 if self.full_step and not self.clock else 1

    def set(self, command: Instruction) -> None:
        """Carry out a command that sets something."""
        match command.code, command.arguments:
            case "T", (clock,):
                self.clock = clock == 1
            case "F", (full,):
                self.full_step = full == 1
            case "Z", (mode,):
                self.plotter = mode == 2
            case "#S", (speed_hz,):
                self.start_hz = speed_hz
            case "#E", (index, speed_hz):
                self.speed_hz[index] = speed_hz
            case "#R", (ramp_ms,):
                self.ramp_ms = ramp_ms
            case "#D", (axis, positive, search, free, offset_speed):
                offset = self.reference[axis].offset
                self.reference[axis] = ReferenceSettings(positive == 1, search, free, offset_speed, offset)
            case "#O", (axis, offset):
                self.reference[axis] = replace(self.reference[axis], offset=offset)
