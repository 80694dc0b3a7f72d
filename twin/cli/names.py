"""`isel-twin machines`, `motors` and `controllers`: lists of what is installed."""

from __future__ import annotations

from collections.abc import Iterable

from isel_twin.cli.options import Json


def machines(*, json: Json = False) -> int:
    """List the machines that come with the package."""
    from isel_twin.models import machine_names

    return _tell(machine_names(), json)


def motors(*, json: Json = False) -> int:
    """List the motors of the library: figures of their sheets, what the sheet's current means, and source."""
    from isel_twin.cli.outputs import say_json
    from isel_twin.drives.library import NEVER_STATED, SHEETS, figures

    if json:
        guesses = {name: [*sheet.estimated, *NEVER_STATED] for name, sheet in SHEETS.items()}
        say_json({name: {**figures(sheet), "estimated": guesses[name]} for name, sheet in SHEETS.items()})
        return 0
    print(f"{'motor':18} {'NEMA':>4} {'A peak':>6} {'ohm':>6} {'mH':>6} {'Nm/A':>6} {'g cm2':>6}  source; its current")
    for name, sheet in SHEETS.items():
        m = sheet.motor
        numbers = f"{m.rated_current_a:6.2f} {m.resistance_ohm:6.3g} {m.inductance_h * 1e3:6.3g}"
        numbers += f" {m.torque_constant_nm_per_a:6.3f} {m.rotor_inertia_kgm2 * 1e7:6.0f}"
        guessed = "".join(f"; {key} estimated" for key in sheet.estimated)
        print(f"{name:18} {sheet.frame:4} {numbers}  {sheet.source}; {sheet.current}{guessed}")
    print(f"estimated for all: {', '.join(NEVER_STATED)}")
    return 0


def controllers(*, json: Json = False) -> int:
    """List the installed controllers."""
    from isel_twin.controller import controller_names

    return _tell(controller_names(), json)


def _tell(names: Iterable[str], json: bool) -> int:
    from isel_twin.cli.outputs import say_json

    if json:
        say_json(list(names))
    else:
        print("\n".join(names))
    return 0
