"""Plans: what is wrong is one line with file, line and what is allowed; what is right becomes points."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from isel_twin.base.errors import CallError
from isel_twin.jobs.job import JobError
from isel_twin.many.studies.plan import PlanError, load_plan
from isel_twin.many.studies.points import all_points, points, unit_samples

SMALL = Path(__file__).parent / "plans" / "small.toml"


def plan(folder: Path, text: str) -> Path:
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_grid_is_every_combination_the_seed_changing_fastest() -> None:
    read = load_plan(SMALL)
    assert [parameter.name for parameter in read.parameters] == ["speed", "ramp", "events"]
    found = [(point.number, *point.values, point.seed) for point in points(read)]
    assert found == [
        (1, 2000, 100, "", 0), (2, 2000, 100, "", 1), (3, 2000, 100, "broken", 0), (4, 2000, 100, "broken", 1),
        (5, 5000, 100, "", 0), (6, 5000, 100, "", 1), (7, 5000, 100, "broken", 0), (8, 5000, 100, "broken", 1),
    ]  # fmt: skip


def test_steps_are_evenly_spaced_by_difference_or_by_ratio(plans: Path) -> None:
    (plans / "job.txt").write_text("@07\n# {a} {b} {c}\n")
    path = plan(
        plans,
        """
        [sweep]
        job = "job.txt"
        [job]
        a = { low = 1, high = 2, steps = 5 }
        b = { low = 10, high = 1000, steps = 3, log = true }
        c = { low = 1, high = 3, steps = 9, whole = true }
        """,
    )
    a, b, c = (parameter.values for parameter in load_plan(path).parameters)
    assert a == (1.0, 1.25, 1.5, 1.75, 2.0)
    assert b == pytest.approx((10.0, 100.0, 1000.0))
    assert c == (1, 2, 3)
    assert all(isinstance(value, int) for value in c)


def test_the_last_step_is_the_upper_end_and_not_beyond(plans: Path) -> None:
    """0.3 (7 / 0.3) is more than 7 in floating point."""
    path = plan(plans, HEAD + "[job]\nspeed = { low = 0.3, high = 7, steps = 3, log = true }\n")
    (speed,) = load_plan(path).parameters
    assert (speed.values[0], speed.values[-1]) == (0.3, 7)


SAMPLED = """
[sweep]
moves = [[1, 1, 1]]
samples = 8
sample_seed = 3
sampling = "sobol"
[machine]
payload.mass = { low = 0, high = 8, unit = "kg" }
masses.portal = { low = 0.5, high = 2, unit = "times", log = true }
[settings]
speed_hz = { low = 2000, high = 2003 }
"""


def test_samples_fill_the_ranges_evenly(plans: Path) -> None:
    """Sobol' points in base 2: each eighth of each range has one of eight samples."""
    read = load_plan(plan(plans, SAMPLED))
    found = np.array([point.values for point in points(read)])
    assert sorted(np.floor(found[:, 0])) == list(range(8))
    assert sorted(np.floor(4.0 * np.log2(2.0 * found[:, 1]))) == list(range(8)), "evenly by ratio"
    assert set(found[:, 2]) <= {2000, 2001, 2002, 2003}


def test_twice_as_many_samples_begin_with_the_same_ones(plans: Path) -> None:
    before = [point.id for point in points(load_plan(plan(plans, SAMPLED)))]
    after = [point.id for point in points(load_plan(plan(plans, SAMPLED.replace("samples = 8", "samples = 16"))))]
    assert after[:8] == before
    assert len(set(after)) == 16
    other = [
        point.id for point in points(load_plan(plan(plans, SAMPLED.replace("sample_seed = 3", "sample_seed = 4"))))
    ]
    assert not set(other) & set(before)


def test_saltelli_mixes_two_samples_column_by_column(plans: Path) -> None:
    path = plan(plans, SAMPLED.replace('"sobol"', '"saltelli"').replace("samples = 8", "samples = 4"))
    blocks = unit_samples(load_plan(path)).reshape(4, 5, 3)
    for a, *mixed, b in blocks:
        for column, each in enumerate(mixed):
            assert [each[i] == (b if i == column else a)[i] for i in range(3)] == [True] * 3


def test_points_that_are_the_same_are_made_once(plans: Path) -> None:
    """Eight samples of one out of four whole numbers."""
    text = SAMPLED.replace("payload.mass", "# payload").replace("masses.portal", "# masses")
    read = load_plan(plan(plans, text))
    assert len(list(all_points(read))) == 8
    assert [point.number for point in points(read)] == [1, 2, 3, 4]


HEAD = '[sweep]\njob = "job.txt"\nscenario = "stuck.toml"\n'


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[sweeps]\n", "plan.toml:1: sweeps: unknown key; did you mean 'sweep'?"),
        ("[sweep]\nseeds = 3\n", "plan.toml:1: sweep.job: missing; allowed: a file of commands, or moves = "),
        ("[sweep]\nmoves = [[1, 2]]\n", "plan.toml:2: sweep.moves: [1, 2]; allowed: three numbers, X, Y and Z in mm"),
        ("[sweep]\njob = 'job.txt'\nseeds = 0\n", "plan.toml:3: sweep.seeds: 0; allowed: 1 .. 1e+06 seeds"),
        ("[sweep]\njob = 'job.txt'\nseeds = 2.0\n", "plan.toml:3: sweep.seeds: 2.0; allowed: a whole number"),
        ("[sweep]\njob = 'job.txt'\nseeds = [1, 1]\n", "plan.toml:3: sweep.seeds: [1, 1]; allowed: how many, or"),
        ("[sweep]\njob = 'job.txt'\nplant = 'mud'\n", "plan.toml:3: sweep.plant: 'mud'; allowed: mujoco, kinematic"),
        (HEAD + "samples = 4\n", "plan.toml:4: sweep.samples: no parameter has a range; allowed: beside one"),
        (HEAD + "sampling = 'sobol'\n", "plan.toml:4: sweep.sampling: no parameter has a range; allowed: beside one"),
        (HEAD + "samples = 6\n[job]\nspeed = {low = 1, high = 2}\n", "plan.toml:4: sweep.samples: 6; allowed: a power"),
        (HEAD + "[job]\nspeed = {low = 1, high = 2}\n", "plan.toml:5: job.speed: a range is sampled; allowed: beside"),
        (HEAD + "[job]\nsped = [1]\n", "plan.toml:5: job.sped: {sped} does not stand in job.txt; did you mean 'speed'"),
        (HEAD + '[job]\n"line 99" = ["@07"]\n', "plan.toml:5: job.line 99: job.txt has no such line; allowed: line 1"),
        (HEAD + "[job]\nspeed = 5\n", "plan.toml:5: job.speed: 5; allowed: a list of values, or a table such as"),
        (HEAD + "[job]\nspeed = []\n", "plan.toml:5: job.speed.values: []; allowed: a list of values"),
        (HEAD + "[job]\nspeed = [1, 'a']\n", "plan.toml:5: job.speed.values: [1, 'a']; allowed: all of one kind"),
        (HEAD + "[job]\nspeed = [1, 1]\n", "plan.toml:5: job.speed.values: 1 stands twice; allowed: different ones"),
        (HEAD + "[job]\nspeed = {low = 1}\n", "plan.toml:5: job.speed.high: missing; allowed: low and high, or values"),
        (HEAD + "[job]\nspeed = {high = 1}\n", "plan.toml:5: job.speed.low: missing; allowed: low and high, or values"),
        (HEAD + "[job]\nspeed = {low = 1, high = 2.5, whole = true}\n", "job.speed: 1 .. 2.5; allowed: whole numbers"),
        (HEAD + "[job]\nspeed = {low = 0.5, high = 2, whole = true}\n", "job.speed: 0.5 .. 2; allowed: whole numbers"),
        (HEAD + "[machine]\naxes.x.pitch = {}\n", "plan.toml:5: machine.axes.x.pitch: {}; allowed: values = [...], or"),
        (HEAD + "[job]\nspeed = {low = 2, high = 1}\n", "plan.toml:5: job.speed.high: 1; allowed: more than low, 2"),
        (HEAD + "[job]\nspeed = {values = [1], low = 1}\n", "plan.toml:5: job.speed.low: there are values; allow"),
        (HEAD + "[job]\nspeed = {low = 0, high = 1, log = true}\n", "plan.toml:5: job.speed.low: 0; allowed with log"),
        (HEAD + "[job]\nspeed = {values = [1], name = 'margin'}\n", "the column 'margin' is that of an outcome;"),
        (HEAD + "[job]\nspeed = {values = [1], unit = 'Hz'}\n", "plan.toml:5: job.speed.unit: 'Hz'; allowed: none;"),
        (HEAD + "[settings]\nspeed_hz = [1]\n", "plan.toml:5: settings.speed_hz: a job file says its settings itself;"),
        (
            HEAD + "[machine]\npayload.mas = [1]\n",
            "plan.toml:5: machine.payload.mas: unknown parameter of 4030; did you mean 'payload.mass'?",
        ),
        (
            HEAD + "[machine]\nmasses.portal = [1]\n\npayload.mass = [1]\n",
            "plan.toml:5: machine.masses.portal.unit: missing; allowed: unit = \"kg\", or unit = \"times\"",
        ),
        (
            HEAD + "[machine]\npayload.mass = {values = [1], unit = 'g'}\n",
            "plan.toml:5: machine.payload.mass.unit: 'g'; allowed: 'kg', 'times'",
        ),
        (HEAD + "[machine]\naxes.all.motor = [1]\n", "plan.toml:5: machine.axes.all.motor.values: [1]; allowed: texts"),
        (HEAD + "[scenario]\nstik.at = [1]\n", "plan.toml:5: scenario.stik.at: there is no event 'stik'; did you mean"),
        (HEAD + "[scenario]\nstick.att = [1]\n", "scenario.stick.att: unknown key of an event; did you mean 'at'?"),
        (HEAD + "[scenario]\nevents = ['stik']\n", "plan.toml:5: scenario.events: there is no event 'stik'; did you"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(plans: Path, text: str, line: str) -> None:
    with pytest.raises((PlanError, CallError)) as caught:
        load_plan(plan(plans, text))
    message = str(caught.value)
    assert message.startswith(str(plans / "plan.toml"))
    assert line in message
    assert "\n" not in message


@pytest.mark.parametrize("key", ["job", "scenario"])
def test_a_pipe_that_a_plan_names_is_refused(plans: Path, key: str) -> None:
    os.mkfifo(plans / "pipe")
    text = {"job": '[sweep]\njob = "pipe"\n', "scenario": HEAD.replace("stuck.toml", "pipe")}[key]
    with pytest.raises(PlanError, match=rf"plan\.toml:\d: sweep\.{key}: 'pipe' is a pipe, which can be read only once"):
        load_plan(plan(plans, text))


def test_both_ways_to_write_a_key_are_the_same(plans: Path) -> None:
    dotted = 'payload.mass = { values = [1], unit = "kg" }'
    ways = (dotted, dotted.replace("payload.mass", '"payload.mass"'), dotted.replace("payload.mass", "payload . mass"))
    found = {points(load_plan(plan(plans, f"{HEAD}[machine]\n{way}\n")))[0].id for way in ways}
    table = f"{HEAD}[machine.payload.mass]\nvalues = [1]\nunit = 'kg'\n"
    assert {points(load_plan(plan(plans, table)))[0].id} == found


def test_a_file_of_a_cam_program_has_a_format_whatever_it_looks_like(plans: Path) -> None:
    (plans / "part.txt").write_text("G1 X5 F600\nM2\n")
    path = plan(plans, '[sweep]\njob = "part.txt"\nformat = "gcode"\n')
    assert "@0" in load_plan(path).work.job
    path = plan(plans, '[sweep]\njob = "part.txt"\nformat = "ncp"\n')
    with pytest.raises(JobError, match=r"part\.txt: line 1, column 1: "):
        load_plan(path)
    path = plan(plans, '[sweep]\njob = "part.txt"\nformat = "dxf"\n')
    with pytest.raises(JobError, match=r"part\.txt: .*dxf.*gcode"):
        load_plan(path)
