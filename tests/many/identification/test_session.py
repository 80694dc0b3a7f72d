"""What of a recording and its measurements counts, and what a machine predicts of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from isel_twin.language import create_language, needed
from isel_twin.machine import MachineError, load_machine, with_overrides
from isel_twin.many.identification.experiment import Experiment, Step
from isel_twin.many.identification.measured import Measured, Reading, Repeats
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.session import model_twin, predict, session_of, stand_alone
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import unknown
from isel_twin.recordings.reading import Entry, Recorded, RecordingError
from tests.near import near_switches

MACHINE = load_machine("4030")


def day(*entries: Entry) -> Recorded:
    """A tap of an imc-s8 to which `@07` was said."""
    said = (
        Entry("/host/sent", 50_000_000, {"hex": b"@07\r".hex(), "byte_ns": 0}),
        Entry("/host/received", 52_600_000, {"hex": b"0".hex(), "byte_ns": 520_833}),
    )
    metadata = {"kind": "tap", "controller": "imc-s8"}
    return Recorded(Path("day.mcap"), metadata, {}, (*said, *entries), np.empty(0, dtype=np.int64), b"", True)


def test_what_was_operated_is_done_again_and_the_line_is_as_it_was() -> None:
    pressed = Entry("/operator", 60_000_000, {"set": {"estop": "pressed"}})
    other_line = Entry("/operator", 61_000_000, {"line_speed": True})
    session = session_of(day(pressed, other_line), Measured(), "", MACHINE)
    assert session.operated == ((60_000_000, {"set": {"estop": "pressed"}}),)
    assert session.line_speed


def test_the_first_that_was_measured_behind_the_end_is_named() -> None:
    late = Measured(readings=tuple(Reading("day", command, "x", 0.0, 0.005) for command in (1, 3, 5)))
    with pytest.raises(RecordingError, match=r"day\.mcap: something was measured after command 3; the recording has 1"):
        session_of(day(), late, "", MACHINE)


@pytest.fixture(scope="module")
def referenced(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """All axes to their references, X again, all again."""
    language = needed(create_language("imc-s8"), "imc-s8")
    steps = tuple(Step(language.frame(line)) for line in ("@07", "@0R7", "@0R1", "@0R7"))
    near = load_machine(near_switches(tmp_path_factory.mktemp("near"), 2.0))
    return carry_out(Experiment("day", steps, ()), near, "imc-s8", seed=1, noise_mm=0.0, time_noise_s=0.0)[0]


@pytest.mark.parametrize(
    ("axes", "timed"), [("", []), ("y", []), ("x", ["3: @0R1"]), ("xy", ["3: @0R1"]), ("xyz", ["3: @0R1", "4: @0R7"])]
)
def test_a_reference_run_is_timed_if_all_the_axes_that_it_moves_were_measured(
    referenced: Recorded, axes: str, timed: list[str]
) -> None:
    """The first one of an axis never: it begins anywhere."""
    measured = Measured(readings=tuple(Reading("day", 1, axis, 0.0, 0.005) for axis in axes))
    session = session_of(referenced, measured, "", MACHINE)
    assert [datum.label for datum in session.data if datum.kind == "duration"] == timed
    assert session.references == {2, 3, 4}


def test_there_is_a_degree_of_freedom_at_least() -> None:
    """One number measured, one looked for: chi-square is over 1, not over 0."""
    scatter = stand_alone("day", Measured(repeats=(Repeats("day", "x", (0.0, 0.1)),)), "imc-s8")
    assert Model(MACHINE, [unknown(MACHINE, "backlash.x")], [scatter]).freedom(np.ones(1), 1) == 1


def test_repeats_scatter_as_switch_and_gauge_do() -> None:
    """Both are independent: the root of the sum of squares, 0.03 and 0.04 mm."""
    machine = with_overrides(MACHINE, {"switches.repeatability": 0.03})
    measured = Measured(repeats=(Repeats("day", "x", (0.0, 0.1, 0.0, 0.1)),), gauge_sigma_mm=0.04)
    assert predict(stand_alone("day", measured, "imc-s8"), machine) == pytest.approx([math.log(0.05)])


@pytest.mark.parametrize(("stiffness", "step_ms"), [(30.0, 0.5), (120.0, 0.25), (200.0, 0.125)])
def test_a_stiff_candidate_is_computed_in_halved_steps(stiffness: float, step_ms: float) -> None:
    """Of 0.5 ms at most 0.29 at 120 N/um and 0.22 at 200, by the plant."""
    twin = model_twin(with_overrides(MACHINE, {"axes.all.stiffness": stiffness}), "imc-s8")
    assert twin.machine.tree["timing"]["mujoco_step"]["value"] == step_ms


def test_a_step_that_cannot_be_halved_is_told() -> None:
    """A quarter of a millisecond is not a whole number of motor steps of 0.1 ms."""
    machine = with_overrides(MACHINE, {"axes.all.stiffness": 120.0, "timing.motor_substep": 100.0})
    with pytest.raises(MachineError, match=r"timing\.mujoco_step: 0\.5 ms is too long"):
        model_twin(machine, "imc-s8")
