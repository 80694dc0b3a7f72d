"""Every assertion once in a test that passes and once in one that fails, which says what was wrong, where and when."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pytest_plugin.projects import INI, drawing_project, project, run, warm

from isel_twin.core.twin import Twin
from isel_twin.jobs.checks import asserts
from isel_twin.jobs.checks.asserts import MotionError, arc
from isel_twin.jobs.checks.watched import Watched
from isel_twin.jobs.golden import GoldenError

pytestmark = pytest.mark.long(seconds=5)

__all__ = ["drawing_project", "project", "warm"]
pytest_plugins = ["pytester"]

SQUARE = """\
# A square of 20 mm, 320 steps a mm.
@07
@0R7
@0M3200,4000,3200,4000,0,10000,0,30
@0M9600,4000,3200,4000,0,10000,0,30
@0M9600,4000,9600,4000,0,10000,0,30
@0B2,1
@0M3200,4000,9600,4000,0,10000,0,30
"""

CONFTEST = """
    import pytest

    @pytest.fixture
    def square(watched):
        watched.play("square.txt")
        return watched

    @pytest.fixture
    def way(watched):
        "From the reference point to X 10 Y 10."
        watched.twin.query("@07")
        watched.twin.query("@0R7")
        watched.begin()
        watched.twin.query("@0M3200,4000,3200,4000,0,10000,0,30")
        return watched
"""

TESTS = """
    import pytest
    from isel_twin.jobs.checks.asserts import *

    pytestmark = pytest.mark.twin(start_mm=(1.5, 1.5, 1.5))

    class TestPass:
        def test_it(self, square):
            assert square.run.ok
            assert_no_step_lost(square)
            assert_accepted(square)
            assert_replies(square, ["0"] * 7)
            assert_ends_at(square, (10.0, 30.0, None), tolerance_mm=0.001)
            assert_ends_at(square, {"x": 10.0})
            assert_cycle_time(square, 25.0, least_s=5.0)
            assert_switch_margin(square, 5.0)
            assert_outputs(square, spindle=1, stages=1)
            assert_golden(square, "made.golden", update=True)
            assert_golden(square, "made.golden")

        def test_path(self, way):
            assert_on_path(way, [(0, 0), (10, 10)], 0.002)
            assert_on_path(way, [(0, 0, 0), (10, 10, 0)], 0.002)
            assert_replies(way, ["0"])
            assert_accepted(way)

        @pytest.mark.twin(plant="mujoco")
        def test_torque(self, way):
            assert_torque_margin(way, 0.2)
            assert_no_step_lost(way)

    def test_ends_at(square):
        assert_ends_at(square, (10.0, 30.5))

    def test_accepted_job(watched):
        watched.play("refused.txt")
        assert_accepted(watched)

    def test_accepted(way):
        way.twin.query("@0X")
        assert_accepted(way)

    def test_replies(way):
        assert_replies(way, ["1"])

    def test_number_of_replies(way):
        assert_replies(way, ["0", "0"])

    def test_cycle_time(square):
        assert_cycle_time(square, 3.0)

    def test_path(way):
        assert_on_path(way, [(0, 0), (10, 0)], 0.5)

    def test_switch_margin(way):
        way.twin.query("@0M320,4000,3200,4000,0,10000,0,30")
        assert_switch_margin(way, 5.0)

    def test_outputs(square):
        assert_outputs(square, spindle=0)

    def test_golden(watched):
        watched.play("slower.txt")
        assert_golden(watched, "square.golden")

    @pytest.mark.twin(plant="mujoco")
    def test_lost(watched):
        watched.play("too_fast.txt")
        assert_no_step_lost(watched)

    @pytest.mark.twin(plant="mujoco")
    def test_torque(way):
        assert_torque_margin(way, 0.99)

    def test_no_physics(way):
        assert_torque_margin(way, 0.2)

    def test_still_at_work(way):
        way.twin.write(b"@0M9600,4000,3200,4000,0,10000,0,30\\r")
        way.twin.run(0.1)
        assert_ends_at(way, (30.0,))
"""

SAID = {
    "test_ends_at": [
        "E * y is -0.500 mm off",
        "E *expected: 30.500 mm +- 0.05 mm",
        "E *was:      30.000 mm; its counter says 30.000 mm",
        "E *when:     *.?????? s",
        "E *axis:     y",
        "E *command:  line 8: @0M3200,4000,9600,4000,0,10000,0,30",
    ],
    "test_accepted_job": [
        "E *a line of the job went wrong",
        "E *was:      answered '5'; no such command",
        "E *command:  line 2: @0X",
    ],
    "test_accepted": ["E *a command was refused", "E *was:      answered '5'", "E *command:  @0X"],
    "test_replies": ["E *another reply", "E *expected: '1'", "E *was:      '0'", "E *command:  @0M3200,*"],
    "test_number_of_replies": ["E *another number of commands", "E *expected: 2 replies", "E *was:      1 command"],
    "test_cycle_time": [
        "E *too slow",
        "E *expected: at most 3 s",
        "E *of which the command below took*",
        "E *line ?: *",
    ],
    "test_path": [
        "E *10.000 mm from the path",
        "E *expected: within 0.5 mm of it",
        "E *was:      first 0.5?? mm off, at x 0.5?? y 0.5?? z 0.000 mm; most * at x 10.000 y 10.000 z 0.000 mm",
        "E *axis:     y",
        "E *command:  @0M3200,*",
    ],
    "test_switch_margin": [
        "E *x comes too near to limit_x1",
        "E *expected: at least 5 mm from its trip point",
        "E *axis:     x",
        "E *command:  @0M320,*",
    ],
    "test_outputs": ["E *spindle is 1", "E *expected: spindle = 0", "E *was:      1, since *", "E *line 7: @0B2,1"],
    "test_golden": [
        "E *not what it was, first in line 5",
        "E *expected: as in square.golden",
        "E *was:      line 5: sent *; line 5: *: time *; line 5: *: stream first from *",
        "E *when:     *.?????? s",
        "E *axis:     x",
        "E *command:  line 5: @0M9600,3900,*",
    ],
    "test_lost": [
        "E *x has lost steps",
        "E *expected: no step lost",
        "E *was:      +* steps (counter minus rotor)",
        "E *axis:     x",
        "E *command:  line 6: @0M32000,30000,0,30,0,30,0,30",
    ],
    "test_torque": ["E *keeps too little torque", "E *expected: a margin of at least 99 %", "E *command:  @0M3200,*"],
    "test_no_physics": ['E *ValueError: no motor has a margin to speak of; take plant="mujoco", and move'],
    "test_still_at_work": ["E *the controller is still at work", "E *command:  @0M9600,*"],
}
"""What each failing test says, line after line."""

TOO_FAST = Path(__file__).parents[1] / "jobs" / "failing" / "too_fast.txt"


def test_assertions_pass_and_fail_with_what_was_when_and_where(project: pytest.Pytester) -> None:
    """That workers send it on: test_fixtures.py, test_workers_share_a_folder."""
    project.makeini(INI)
    for name, content in {
        "square.txt": SQUARE,
        "slower.txt": SQUARE.replace("@0M9600,4000,3200", "@0M9600,3900,3200"),
        "refused.txt": "@07\n@0X\n",
        "too_fast.txt": TOO_FAST.read_text(),
    }.items():
        (project.path / name).write_text(content)
    golden = Watched(Twin(plant="kinematic", start_mm=(1.5, 1.5, 1.5)))
    golden.play(project.path / "square.txt")
    asserts.assert_golden(golden, project.path / "square.golden", update=True)
    project.makeconftest(CONFTEST)
    file = project.makepyfile(TESTS).name

    result = run(project, "-p", "no:timeout", file)
    result.assert_outcomes(passed=3, failed=len(SAID))
    text = result.outlines
    for name in SAID:
        begin = next(k for k, line in enumerate(text) if line.strip("_ ") == name)
        end = next(k for k in range(begin, len(text)) if text[k].startswith("the test again: "))
        pytest.LineMatcher(text[begin:end]).fnmatch_lines([*SAID[name], "*twin: machine=4030*", "*recording: *"])
        assert not any("checks/asserts.py" in line for line in text[begin:end]), "users see their own line only"


# ---- without pytest around -----------------------------------------------------------------------------------------


def ready() -> Watched:
    seen = Watched(Twin(plant="kinematic", start_mm=(1.5, 1.5, 1.5)))
    for command in ("@07", "@0R7"):
        seen.twin.query(command)
    seen.begin()
    return seen


def test_an_error_has_its_parts() -> None:
    seen = ready()
    seen.twin.query("@0M3200,4000,0,30,0,30,0,30")
    with pytest.raises(MotionError) as caught:
        asserts.assert_ends_at(seen, (11.0,))
    error = caught.value
    assert (error.axis, error.expected) == ("x", "11.000 mm +- 0.05 mm")
    assert str(error.command) == "@0M3200,4000,0,30,0,30,0,30"
    assert error.time_ns == seen.twin.time_ns


def test_a_command_sent_byte_by_byte_is_one_command() -> None:
    seen = ready()
    for byte in b"@0M3200,4000,0,30,0,30,0,30\r@0P\r":
        seen.twin.write(bytes([byte]))
        seen.twin.run(0.0005)
        if byte == 13:
            seen.twin.run_until_idle()
    assert [str(command) for command in seen.commands] == ["@0M3200,4000,0,30,0,30,0,30", "@0P"]


def test_an_arc_is_a_path() -> None:
    """The manual's circle: its steps stay within half a step's diagonal and more of the arc they follow."""
    points = arc((0.0, 0.0), 10.0, 0.0, 90.0, 90)
    assert points.shape == (91, 2)
    assert np.allclose(np.hypot(*points.T), 10.0)
    assert points[-1] == pytest.approx([0.0, 10.0])
    chord_mm = 10.0 * (1.0 - math.cos(math.radians(0.5)))
    middles = (points[1:] + points[:-1]) / 2.0
    assert np.hypot(*middles.T).min() == pytest.approx(10.0 - chord_mm)


def test_beyond_a_switch_counts_always() -> None:
    """From the reference point straight over the motor-end switch: 10 mm is more than there is before it."""
    seen = ready()
    seen.twin.query("@0A-3200,4000,0,30,0,30,0,30")
    with pytest.raises(MotionError, match=r"x comes too near to limit_x1[^!]*mm beyond it"):
        asserts.assert_switch_margin(seen, 0.5)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda seen: asserts.assert_ends_at(seen, {"w": 1.0}), "there is no axis 'w'"),
        (lambda seen: asserts.assert_ends_at(seen, (1.0, 2.0, 3.0, 4.0)), "position_mm has 4 values"),
        (lambda seen: asserts.assert_on_path(seen, [1.0, 2.0], 0.1), "points_mm has the shape"),
        (lambda seen: asserts.assert_outputs(seen, laser=1), "there is no output 'laser'; there are: "),
        (lambda seen: asserts.assert_cycle_time(seen, 1.0), "there was no command since `begin`"),
        (lambda seen: asserts.assert_golden(seen), "no job was played"),
        (lambda seen: Watched(seen.twin, 0.0), "interval_s is 0.0"),
    ],
)
def test_what_cannot_be_asserted_is_said(call: object, line: str) -> None:
    with pytest.raises(ValueError, match=line):
        call(ready())  # type: ignore[operator]


def test_a_missing_golden_run_says_how_to_make_it(tmp_path: Path) -> None:
    job = tmp_path / "square.txt"
    job.write_text(SQUARE)
    seen = Watched(Twin(plant="kinematic", start_mm=(1.5, 1.5, 1.5)))
    seen.play(job)
    with pytest.raises(
        GoldenError, match=r"square\.golden: there is no golden run; make it with isel-twin golden record"
    ):
        asserts.assert_golden(seen)


def test_the_first_divergence_has_axis_and_time(tmp_path: Path) -> None:
    """The second move of two is slower: it begins alike, and parts from the golden run in its ramp."""
    golden, slower = tmp_path / "a.txt", tmp_path / "b.txt"
    golden.write_text("@07\n@0R7\n@0A3200,4000,0,30,0,30,0,30\n@0A0,30,3200,4000,0,30,0,30\n")
    slower.write_text("@07\n@0R7\n@0A3200,4000,0,30,0,30,0,30\n@0A0,30,3200,3900,0,30,0,30\n")
    for job, update in ((golden, True), (slower, False)):
        seen = Watched(Twin(plant="kinematic", start_mm=(1.5, 1.5, 1.5)))
        seen.play(job)
        if update:
            asserts.assert_golden(seen, golden.with_suffix(".golden"), update=True)
    with pytest.raises(MotionError) as caught:
        asserts.assert_golden(seen, golden.with_suffix(".golden"))
    assert caught.value.axis == "y"
    begun = seen.commands[-1]
    assert begun.line == 4
    assert caught.value.time_ns is not None
    assert begun.begin_ns < caught.value.time_ns < begun.end_ns


def test_the_golden_run_of_the_command_line_is_the_same(tmp_path: Path) -> None:
    """A sample job of this project, played by a test, does what its golden run says."""
    seen = Watched(Twin(plant="kinematic"))
    jobs = Path(__file__).parents[1] / "jobs" / "imc"
    seen.play(jobs / "drilling.txt")
    asserts.assert_golden(seen)
