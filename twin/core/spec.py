"""A twin as somebody calls for it, in the words of a command line or a URL, and the one way from there to a `Twin`.

    isel-twin run --machine 4030 --seed 1 ...  --.
                                                  >--  TwinCall  --- build() -->  Twin, with its flash in a file
    twin://imc-s8?machine=4030&seed=1 ...      --'         `-------------------->  CallError: one line, what to do

Nothing heavy is imported before `build`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.errors import CallError, call_errors

if TYPE_CHECKING:
    from isel_twin.controller import Controller
    from isel_twin.core.twin import Twin

_IMAGE = b"isel-twin "
"""What flash images of the package's controllers begin with."""


@dataclass(frozen=True)
class TwinCall:
    """What a caller says about the twin it wants; the rest is as it comes."""

    machine: str = "4030"
    """Name of a machine, or path of a machine folder."""
    controller: str = "imc-s8"
    plant: str = "mujoco"
    seed: int = 0
    scenario: Path | None = None
    """File of timed events."""
    flash: Path | None = None
    """File that keeps the controller's flash memory; created if missing, and written whenever the flash is."""
    line_speed: bool = False
    """Bytes take their time on the serial line."""
    overrides: Mapping[str, Any] = field(default_factory=dict)
    """Machine parameters to change, see `isel_twin.machine.with_overrides`."""
    start_mm: tuple[float, ...] | None = None
    """Carriage positions at power-on in machine coordinates; None: drawn from the seed."""

    def build(
        self, keep_motions: int | None = None, controller: Controller | None = None, memory: bytes | None = None
    ) -> Twin:
        """The twin, switched on, its flash kept in the file. Raises CallError for anything wrong with the call.

        keep_motions: see `Twin`. controller: one that has been built, in place of the one that is named, and what
        others could build it from again (`memory`, in place of a flash file).

        A flash file that is damaged is the controller's business, who says so to its host. One that never was a flash
        image is the caller's mistake: it is refused and left as it is.
        """
        if self.seed < 0:
            raise CallError(f"seed {self.seed}: must be a whole number from 0", option=True)
        from isel_twin.core.flash import FlashFile
        from isel_twin.core.twin import Twin

        with call_errors(self.flash):
            keeper = FlashFile(self.flash) if self.flash is not None else None
        image = keeper.image if keeper is not None else None
        with call_errors(self.scenario):
            twin = Twin(
                self.machine,
                controller or self.controller,
                self.plant,
                self.seed,
                flash=image if controller is None else memory,
                scenario=self.scenario,
                line_speed=self.line_speed,
                overrides=self.overrides,
                start_mm=self.start_mm,
                keep_motions=keep_motions,
            )
        if keeper is not None:
            if twin.outputs.get("flash_fault") and not (image or b"").startswith(_IMAGE):
                raise CallError(f"{self.flash}: is no flash image of {self.controller}; remove it or name another file")
            with call_errors(self.flash):
                keeper.attach(twin)
        return twin
