"""The spec of a twin: all that determines its behaviour until it is operated.

    isel-twin run --machine 4030 --seed 1 ...  --.
    twin://imc-s8?machine=4030&seed=1 ...      ---+--  TwinSpec  --- build() -->  Twin, its flash kept in the file
    Twin(machine="4030", seed=1)               --'      | ^                  `->  CallError: one line, what to do
                                              with_(seed=2)

A spec can be compared, pickled and sent to other processes. Nothing heavy is imported before `build` (core/12).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from isel_twin.base.errors import CallError, call_errors

if TYPE_CHECKING:
    from isel_twin import Twin
    from isel_twin.controller import Controller
    from isel_twin.machine import Fixture, Machine
    from isel_twin.wiring import ScenarioEvent

MACHINE: Final = "4030"  # the default machine
BAUD: Final = (50, 10_000_000)  # of a line
MOST_ADAPTER_MS: Final = 255.0  # of a USB adapter's timer
_IMAGE = b"isel-twin "  # first bytes of flash images of the package's controllers


@dataclass(frozen=True)
class TwinSpec:
    """What a twin is built from."""

    machine: str | Path | Machine = MACHINE  # name of a machine, path of a machine folder, or a loaded machine
    controller: str = "imc-s8"
    plant: str = "mujoco"
    seed: int = 0
    scenario: Path | None = None  # file of timed events
    # File for the controller's flash memory, created if missing and written whenever the flash is; or an image, which
    # is only read.
    flash: Path | bytes | None = None
    # bytes take their time on the serial line: at the speed of the controller (True), or at this one, baud
    line_speed: bool | int = False
    # machine parameters to change, as `isel_twin.machine.with_overrides` takes them
    overrides: Mapping[str, Any] = field(default_factory=dict)
    # carriage positions at power-on in machine coordinates; None: drawn from the seed
    start_mm: tuple[float, ...] | None = None
    events: tuple[ScenarioEvent, ...] = ()  # events in place of a scenario file
    fixtures: tuple[Fixture, ...] = ()  # clamped on the table for this job, beside those of the machine
    adapter_ms: float = 0.0  # timer of a USB adapter at the host, which is on a line that takes its time; 0: none

    def __post_init__(self) -> None:
        if not isinstance(self.line_speed, bool) and not BAUD[0] <= self.line_speed <= BAUD[1]:
            raise ValueError(f"line-speed {self.line_speed}: must be a number of baud from {BAUD[0]} to {BAUD[1]}")
        if not 0.0 <= self.adapter_ms <= MOST_ADAPTER_MS:
            raise ValueError(f"adapter-ms {self.adapter_ms:g}: must be a time up to {MOST_ADAPTER_MS:g} ms")
        if self.adapter_ms and not self.line_speed:
            object.__setattr__(self, "line_speed", True)
        if self.events and self.scenario is not None:
            raise ValueError(f"{self.scenario}: there are events, too; allowed: one of the two")

    def with_(self, **changes: Any) -> TwinSpec:
        """With these fields changed."""
        return dataclasses.replace(self, **changes)

    def with_events(self, tables: Sequence[dict[str, Any]]) -> TwinSpec:
        """With [[event]] tables in place of a scenario file. Raises ScenarioError (ValueError)."""
        from isel_twin.core.events import events_of

        controller = self._new_controller()
        return self.with_(scenario=None, events=events_of(tables, self.fitted(controller), controller))

    @property
    def as_built(self) -> Machine:
        """The machine without the overrides. Raises MachineError (ValueError)."""
        from isel_twin.machine import Machine, load_machine

        return self.machine if isinstance(self.machine, Machine) else load_machine(self.machine)

    def fitted(self, controller: Controller | None = None) -> Machine:
        """The twin's machine, with the overrides of the controller and then those of the spec, and its fixtures.
        controller: one already built. Raises ValueError with one line."""
        from isel_twin.machine import with_fixtures, with_overrides

        asked = (controller or self._new_controller()).machine_overrides()
        return with_fixtures(with_overrides(with_overrides(self.as_built, asked), self.overrides), self.fixtures)

    def _new_controller(self) -> Controller:
        from isel_twin.controller import create_controller
        from isel_twin.machine import with_overrides

        return create_controller(self.controller, settings=with_overrides(self.as_built, self.overrides).controller)

    @property
    def machine_name(self) -> str:
        """The name or path of the machine."""
        return str(self.machine) if isinstance(self.machine, str | Path) else self.machine.name

    @property
    def image(self) -> bytes | None:
        """The flash image, None for a new device; files are read by `build`."""
        if isinstance(self.flash, Path):
            raise TypeError(f"{self.flash} has not been read: TwinSpec.build keeps flash files")
        return self.flash

    def build(self, keep_motions: int | None = None, controller: Controller | None = None) -> Twin:
        """The twin, switched on, its flash kept in the file. Raises CallError for anything wrong with the call.

        keep_motions: as for `Twin`. controller: one already built, in place of the named one. A damaged flash file is
        passed to the controller, which reports it to its host. A file that is no flash image is refused and stays
        unchanged.
        """
        if self.seed < 0:
            raise CallError(f"seed {self.seed}: must be a whole number from 0", option=True)
        from isel_twin import Twin
        from isel_twin.core.flash import FlashFile

        if not isinstance(self.flash, Path):
            with call_errors(self.scenario):
                return Twin.of(self, keep_motions, controller)
        with call_errors(self.flash):
            keeper = FlashFile(self.flash)
        with call_errors(self.scenario):
            twin = Twin.of(self.with_(flash=keeper.image), keep_motions, controller)
        if twin.outputs.get("flash_fault") and not (keeper.image or b"").startswith(_IMAGE):
            raise CallError(f"{self.flash}: is no flash image of {self.controller}; remove it or name another file")
        with call_errors(self.flash):
            keeper.attach(twin)
        return twin
