"""A pull comes and goes slowly: what a gauge then reads does not depend on the mass."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed
from isel_twin.machine import load_machine
from isel_twin.many.identification.experiment import Block, Teller, _push, _reversal, assemble
from isel_twin.many.identification.hands import PULL_PARTS, PULL_S, SETTLE_S, Pulls
from isel_twin.many.identification.measured import Reading
from isel_twin.many.identification.protocol import characteristics
from isel_twin.many.identification.session import model_twin
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import candidate, unknown
from tests.near import near_switches

CONTROLLER = "imc-s8"
LIGHT_FOOTED = {"friction.x": 0.75, "stiffness.x": 0.67, "backlash.x": 0.015}  # swings easily
HEAVY = 1.8  # times as heavy as believed


class Noted:
    """A twin that notes how long which force acts where."""

    def __init__(self) -> None:
        self.done: list[tuple[float, str, float]] = []
        self._now = (0.0, "")

    def apply_force(self, axis: int, force_n: float, at: str) -> None:
        assert axis == 1
        self._now = force_n, at

    def run(self, s: float) -> None:
        self.done.append((*self._now, s))


def pull(newton: float, at: str = "tool") -> Reading:
    return Reading("day", 1, "y", 0.0, push_n=newton, push_at=at)


def ramp(begin: float, end: float, at: str) -> list[tuple[Any, str, float]]:
    every = range(1, PULL_PARTS + 1)
    return [(pytest.approx(begin + (end - begin) * n / PULL_PARTS), at, PULL_S / PULL_PARTS) for n in every]


def test_a_pull_grows_from_the_one_before_and_is_let_go_as_slowly() -> None:
    noted = Noted()
    pulls = Pulls(cast(Twin, cast(object, noted)))
    for newton in (100.0, 100.0, -60.0):
        pulls.pull(pull(newton))
    pulls.end()
    rest = (pytest.approx(0.0), "tool", SETTLE_S)
    expected = [*ramp(0.0, 100.0, "tool"), *ramp(100.0, -60.0, "tool"), *ramp(-60.0, 0.0, "tool"), rest]
    assert noted.done == expected
    pulls.end()
    assert noted.done == expected


def test_a_pull_elsewhere_begins_when_the_one_before_is_let_go() -> None:
    noted = Noted()
    pulls = Pulls(cast(Twin, cast(object, noted)))
    for how in (pull(100.0), pull(60.0, "table")):
        pulls.pull(how)
    assert noted.done == [*ramp(0.0, 100.0, "tool"), *ramp(100.0, 0.0, "tool"), *ramp(0.0, 60.0, "table")]


def test_without_a_pull_nothing_is_touched() -> None:
    noted = SimpleNamespace()
    pulls = Pulls(cast(Twin, noted))
    pulls.pull(pull(0.0))
    pulls.end()


@pytest.mark.parametrize("kind", ["push", "reversal"])
def test_what_a_gauge_reads_at_rest_does_not_depend_on_the_mass(tmp_path: Path, kind: str) -> None:
    """Statics know no mass. Pulled at once, the heavy one still swings when it is read, 20 um off; in a hurry, 4 um."""
    machine = load_machine(near_switches(tmp_path, 2.0))
    language = needed(create_language(CONTROLLER), CONTROLLER)
    tell = Teller(language, "x", machine.axes[0].steps_per_mm)
    block: Block = _push(tell, 20.0, 150.0, "tool") if kind == "push" else _reversal(tell, 20.0)
    unknowns = [unknown(machine, name) for name in (*LIGHT_FOOTED, "mass")]
    found = []
    for times in (1.0, HEAVY):
        hidden = model_twin(candidate(machine, unknowns, [*LIGHT_FOOTED.values(), times]), CONTROLLER).machine
        _, measured = carry_out(
            assemble("day", [block], language), hidden, CONTROLLER, seed=1, noise_mm=0.0, time_noise_s=0.0
        )
        (one,) = characteristics(measured)
        found.append(one.value)
    assert found[0] > 0.01
    assert found[1] == pytest.approx(found[0], abs=0.002)
