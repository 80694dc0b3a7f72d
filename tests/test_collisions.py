"""Collisions of a whole twin: what is told, when, and what else sees it.

The tool's tip of the 4030 is 147 mm above the table where Z is 0 (models/4030/README.md), its cutter has a radius of
3 mm. A reference run ends where the switches have let go again, so positions are taken in machine coordinates.
"""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.parameters import FileError
from isel_twin.cli import main
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs import project
from isel_twin.machine import Fixture, MachineError, load_machine, machine_from_tree
from isel_twin.plant import Clearance, Collision

from .crashes.stl import write_stl
from .near import NEAR

pytestmark = pytest.mark.long(seconds=6)

X_MM, Y_MM = 10.0, 6.0  # the middle of the jaw: near the switches, so that a reference run is short
JAW = Fixture("vise_jaw", "box", (100.0, 20.0, 140.0), (X_MM, Y_MM, 0.0))
START_MM = (X_MM, Y_MM, 2.0)
THERE = ("@07", "@0R7", "@0A3200,9600,1920,9600,0,9600,0,9600")  # from the reference run to above the jaw
ABOVE_MM = 147.0 - 140.0  # Z at which the cutter's end meets the jaw
STEP_MM = 1.0 / 320.0
MUJOCO_STEP_NS = 500_000
PLANTS = ("kinematic", "mujoco")


def over(plant: str = "kinematic", fixtures: tuple[Fixture, ...] = (JAW,), **more: Any) -> Twin:
    """A twin, referenced, its tool 7 mm above the jaw's middle."""
    twin = Twin(plant=plant, fixtures=fixtures, start_mm=START_MM, **more)
    for line in THERE:
        assert twin.query(line) == "0"
    return twin


def z_of(twin: Twin) -> float:
    """How far the zero of the counter is beyond that of the machine."""
    return float(twin.machine_position_mm[2] - twin.position_mm[2])


def down(mm: float, hz: int = 3200) -> str:
    """Z to this place above the jaw, at constant frequency up to 300 Hz."""
    return f"@0M3200,9600,1920,9600,{round(320 * mm)},{hz},0,9600"


@pytest.mark.parametrize("plant", PLANTS)
def test_a_fall_at_constant_speed_meets_the_jaw_at_distance_over_speed(plant: str) -> None:
    """From 1 mm above, 300 steps a second without a ramp: 0.9375 mm/s."""
    twin = over(plant)
    twin.query(down(ABOVE_MM - z_of(twin) - 1.0))
    twin.run(0.5)
    assert twin.collisions == []
    at_mm, begin_ns = twin.machine_position_mm[2], twin.time_ns
    twin.query(down(ABOVE_MM - z_of(twin) + 0.2, 300))
    (met,) = twin.collisions
    distance_mm = ABOVE_MM - at_mm
    assert (met.first, met.second) == ("cutter", "vise_jaw")
    late_ns = met.time_ns - (begin_ns + distance_mm / (300.0 * STEP_MM) * 1e9)
    # steps are made one at a time; with physics the motor's step is led by its load angle, at rest and on the way
    assert abs(late_ns) < (1e9 / 300.0 if plant == "kinematic" else 4.0 * 1e9 / 300.0)
    if plant == "kinematic":
        assert met.speed_mm_s == pytest.approx(0.9375, rel=1e-6)
    assert met.position_mm[2] == pytest.approx(ABOVE_MM - z_of(twin), abs=STEP_MM)
    assert (met.force_n is None) == (plant == "kinematic")


@pytest.mark.parametrize("plant", PLANTS)
def test_a_pair_is_told_again_only_after_it_has_parted(plant: str) -> None:
    """A touch of 0.03 mm, an ascent of 0.3 mm, which is none yet, and one of 5 mm."""
    twin = over(plant)
    touch = ABOVE_MM - z_of(twin) + 0.03
    numbers = []
    for mm in (touch, touch - 0.3, touch, touch - 5.0, touch):
        twin.query(down(mm, 600))
        numbers.append(len(twin.collisions))
    assert numbers == [1, 1, 1, 1, 2]


@pytest.mark.parametrize("plant", PLANTS)
def test_nothing_is_told_a_tenth_above(plant: str) -> None:
    twin = over(plant)
    twin.watch_clearance()
    twin.query(down(ABOVE_MM - z_of(twin) - 0.1))
    twin.query(f"@0M4800,9600,1920,9600,{round(320 * (ABOVE_MM - z_of(twin) - 0.1))},9600,0,9600")
    assert twin.collisions == []
    least = twin.clearance
    assert isinstance(least, Clearance)
    assert least.apart_mm == pytest.approx(0.1, abs=STEP_MM if plant == "kinematic" else 0.03)
    assert (least.first, least.second) == ("cutter", "vise_jaw")


@pytest.mark.parametrize("plant", PLANTS)
def test_beside_the_jaw_the_clearance_is_that_of_a_circle_from_an_edge(plant: str) -> None:
    """The cutter goes down at X 10, its middle 10 + 3 + 1.5 mm from the middle of a jaw 20 mm wide."""
    twin = over(plant)
    twin.watch_clearance()
    y = round(320 * (Y_MM + 10.0 + 3.0 + 1.5 - float(twin.machine_position_mm[1] - twin.position_mm[1])))
    for z in (0, round(320 * (ABOVE_MM + 5.0))):
        twin.query(f"@0M3200,9600,{y},9600,{z},3200,0,9600")
    assert twin.collisions == []
    assert twin.clearance is not None
    assert twin.clearance.apart_mm == pytest.approx(1.5, abs=0.005 if plant == "kinematic" else 0.03)


@pytest.mark.parametrize("plant", PLANTS)
def test_an_emergency_stop_before_the_contact_prevents_it(plant: str) -> None:
    (event,) = [{"when": f"z > {ABOVE_MM - 3.0} mm", "set": {"estop": "pressed"}}]
    spec = TwinSpec(plant=plant, fixtures=(JAW,), start_mm=START_MM).with_events([event])
    twin = Twin.of(spec)
    for line in THERE:
        twin.query(line)
    assert twin.query(down(ABOVE_MM + 5.0)) == "9"
    twin.run(1.0)
    assert twin.collisions == []
    assert ABOVE_MM - 3.0 < twin.machine_position_mm[2] < ABOVE_MM


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("words", ["collision", "collision cutter", "collision vise_jaw cutter"])
def test_a_collision_is_a_condition_of_a_scenario(plant: str, words: str) -> None:
    """The stages go off at the instant: the machine stops there."""
    event = {"when": words, "set": {"estop": "pressed"}}
    spec = TwinSpec(plant=plant, fixtures=(JAW,), start_mm=START_MM).with_events([event])
    twin = Twin.of(spec)
    for line in THERE:
        twin.query(line)
    pressed: list[int] = []
    twin.listen(lambda t_ns, kind, _: pressed.append(t_ns) if kind == "scenario" else None)
    assert twin.query(down(ABOVE_MM + 5.0)) == "9"
    (met,) = twin.collisions
    assert 0 <= pressed[0] - met.time_ns <= (0 if plant == "kinematic" else 2 * MUJOCO_STEP_NS)
    assert twin.machine_position_mm[2] == pytest.approx(ABOVE_MM, abs=0.1)


def test_a_condition_about_another_body_is_not_met() -> None:
    event = {"when": "collision spindle", "set": {"estop": "pressed"}}
    spec = TwinSpec(plant="kinematic", fixtures=(JAW,), start_mm=START_MM).with_events([event])
    twin = Twin.of(spec)
    for line in (*THERE, down(ABOVE_MM + 5.0)):
        assert twin.query(line) == "0"
    assert len(twin.collisions) == 1


@pytest.mark.parametrize("plant", PLANTS)
def test_a_state_before_the_contact_leads_to_the_same_one(plant: str) -> None:
    twin = over(plant)
    twin.query(down(ABOVE_MM - z_of(twin) - 2.0))
    twin.write(down(ABOVE_MM + 1.0).encode() + b"\r")
    twin.run(0.05)
    state = pickle.loads(pickle.dumps(twin.save()))
    twin.run(2.0)
    told, end = list(twin.collisions), twin.machine_position_mm.tobytes()
    assert len(told) == 1
    other = twin.another(7)
    for again in (twin, other):
        again.restore(state)
        assert again.collisions == []
        again.run(2.0)
        assert (again.collisions, again.machine_position_mm.tobytes()) == (told, end)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_state_in_contact_does_not_tell_it_again(plant: str) -> None:
    twin = over(plant)
    twin.query(down(ABOVE_MM - z_of(twin) + 0.03, 600))
    state = twin.save()
    twin.restore(state)
    twin.run(0.5)
    assert len(twin.collisions) == 1


@pytest.mark.parametrize("plant", PLANTS)
def test_who_may_touch_is_no_collision_and_yet_is_felt(plant: str) -> None:
    plate = replace(JAW, name="plate", may_touch=("cutter",))
    twin = over(plant, (plate,))
    twin.query(down(ABOVE_MM - z_of(twin) + 1.0, 600))
    assert twin.collisions == []
    twin.run(0.5)
    stands_mm = twin.machine_position_mm[2]
    assert stands_mm == pytest.approx(ABOVE_MM + (1.0 if plant == "kinematic" else 0.0), abs=0.35)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_cutter_goes_through_stock_and_the_spindle_does_not(plant: str) -> None:
    """Stock of 110 mm: the cutter is 18 mm long, then the spindle meets it. 0.1 mm over and under that."""
    stock = replace(JAW, name="wood", size_mm=(100.0, 90.0, 110.0), stock=True)
    twin = over(plant, (stock,))
    meets_mm = 147.0 - 110.0 + 18.0
    twin.query(down(meets_mm - z_of(twin) - 0.1))
    assert twin.collisions == []
    assert twin.machine_position_mm[2] == pytest.approx(meets_mm - 0.1, abs=0.03)
    twin.query(down(meets_mm - z_of(twin) + 0.1, 600))
    assert [collision.who for collision in twin.collisions] == ["spindle hits wood"]


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("machine", ["4030-portal", "4030-servo"])
def test_another_machine(plant: str, machine: str) -> None:
    if machine == "4030-servo":
        twin = Twin(machine, "gmi99", plant, fixtures=(JAW,), start_mm=(X_MM, Y_MM, ABOVE_MM + 1.0))
        twin.run(0.1)
    else:
        twin = Twin(machine, plant=plant, fixtures=(JAW,), start_mm=START_MM)
        for line in (*THERE, down(ABOVE_MM + 2.0)):
            twin.query(line)
    assert [collision.who for collision in twin.collisions][:1] == ["cutter hits vise_jaw"]


def test_the_probe_of_the_traverse_meets_a_post() -> None:
    post = Fixture("post", "cylinder", (40.0, 900.0), (500.0, 500.0, 0.0))
    machine = load_machine("traverse")
    twin = Twin(machine, "imc-m", "kinematic", fixtures=(post,), start_mm=(500.0, 500.0, 900.0))
    assert twin.collisions == [] or twin.collisions[0].first == "probe"


@pytest.mark.parametrize("plant", PLANTS)
def test_a_mesh_is_met_where_the_same_box_is(plant: str, tmp_path: Path) -> None:
    twins = [
        over(plant),
        over(plant, (replace(JAW, shape="mesh", size_mm=(), file=write_stl(tmp_path / "box.stl", JAW.size_mm)),)),
    ]
    for twin in twins:
        twin.query(down(ABOVE_MM - z_of(twin) + 0.03, 600))
    (box,), (mesh,) = (twin.collisions for twin in twins)
    assert abs(box.time_ns - mesh.time_ns) <= (0 if plant == "kinematic" else MUJOCO_STEP_NS)


def test_a_set_point_controller_meets_at_the_nanosecond_of_a_straight_way() -> None:
    """Between two set points the way is straight: the distance goes down by the speed. A nanometre is 50 ns."""
    twin = over("kinematic")
    plant = twin._plant
    start_mm = twin.machine_position_mm[2]
    ticks = np.array([twin.time_ns + 1], dtype=np.int64)
    delta = np.zeros((1, 4), dtype=np.int32)
    delta[0, 2] = 320 * 200
    reached = plant.advance(twin.time_ns + 10**10, ticks, delta, 10**10)
    assert reached - ticks[0] == pytest.approx((ABOVE_MM - start_mm) / 200.0 * 1e10, abs=100.0)
    (met,) = plant.take_collisions()
    assert met.position_mm[2] == pytest.approx(ABOVE_MM, abs=1e-5)


def test_how_time_is_cut_does_not_change_what_is_told() -> None:
    told = []
    for slice_s in (5.0, 0.0137):
        twin = over("mujoco")
        twin.write(down(ABOVE_MM + 1.0).encode() + b"\r")
        end_ns = twin.time_ns + 12_000_000_000
        while twin.time_ns < end_ns:
            twin.run(min(slice_s, (end_ns - twin.time_ns) / 1e9))
        told.append((list(twin.collisions), twin.machine_position_mm.tobytes()))
    assert told[0] == told[1]
    assert len(told[0][0]) == 1


def test_a_machine_without_fixtures_does_not_load_mujoco_on_the_kinematic_plant() -> None:
    """In a process of its own: this one has loaded it long ago."""
    import subprocess
    import sys

    code = (
        "import sys; from isel_twin import Twin; t = Twin(plant='kinematic'); t.query('@07'); "
        "t.query('@0R7'); print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


# ---- files -----------------------------------------------------------------------------------------------------------

TABLE = '[[fixture]]\nname = "jaw"\nshape = "box"\nsize_mm = [100, 20, 90]\nat_mm = [10, 6, 0]\n'
JAW_MM = 147.0 - 90.0  # lower: a job begins wherever the carriages stand


def test_the_fixtures_of_a_machine_and_of_a_job_stand_on_one_table(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\nname = "shop"\n{TABLE}')
    (tmp_path / "isel-twin.toml").write_text(TABLE.replace('"jaw"', '"stop"'))
    job = project.fixtures(tmp_path / "isel-twin.toml")
    assert [fixture.name for fixture in TwinSpec(tmp_path, fixtures=job).fitted().fixtures] == ["jaw", "stop"]
    machine = load_machine(tmp_path)
    assert machine_from_tree(json.loads(json.dumps(dict(machine.tree), default=str)), machine.file).fixtures


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("size_mm = [100, 20, 90]", "size_mm = [100, 20]", r":4: fixture 1\.size_mm: .*allowed: 3 numbers of a box"),
        (
            "size_mm = [100, 20, 90]",
            "size_mm = [100, -2, 40]",
            r":4: fixture 1\.size_mm: -2; allowed: 0.01 .. 10000 mm",
        ),
        ("size_mm", '"a\\nb\\u001b"', r": fixture 1\.a\\nb\\x1b: unknown key; "),
        ("size_mm", "sizes_mm", r":4: fixture 1\.sizes_mm: unknown key; did you mean 'size_mm'"),
        ('shape = "box"', 'shape = "ball"', r":3: fixture 1\.shape: 'ball'; allowed: box, cylinder, ring, mesh"),
        ('shape = "box"\nsize_mm = [100, 20, 90]', 'shape = "mesh"', r"fixture 1\.file: missing; allowed: the STL"),
        ("at_mm = [10, 6, 0]", "", r"fixture 1\.at_mm: missing"),
        ("at_mm", 'file = "a.stl"\nat_mm', r":5: fixture 1\.file: a box has none"),
        ('name = "jaw"', 'name = "a jaw"', r":2: fixture 1\.name: 'a jaw'; allowed: a word"),
        ("[[fixture]]\n", "fixture = 3\n[check]\n", r":1: fixture: 3; it must be written as \[\[fixture\]\] tables"),
        ("at_mm", f"at_mm = [0, 0, 0]\n{TABLE}#", r":7: fixture 2\.name: 'jaw' is there already"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    file = tmp_path / "isel-twin.toml"
    file.write_text(TABLE.replace(old, new, 1))
    with pytest.raises(FileError, match=told) as refused:
        project.fixtures(file)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            'may_touch = ["cuter"]\n',
            r"machine\.toml:3: fixture 1\.may_touch: 'cuter' is no part.*did you mean 'cutter'",
        ),
        ("turn_deg = 400\n", r"machine\.toml:8: fixture 1\.turn_deg: 400; allowed: -360 .. 360 degrees"),
    ],
)
def test_a_wrong_table_of_a_machine_is_refused_with_its_line(tmp_path: Path, more: str, told: str) -> None:
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\nname = "shop"\n{TABLE}{more}')
    with pytest.raises(MachineError, match=told):
        Twin(tmp_path, plant="kinematic")


def test_a_mesh_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"solid nothing")
    table = TABLE.replace('shape = "box"\nsize_mm = [100, 20, 90]', 'shape = "mesh"\nfile = "a.stl"')
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\nname = "shop"\n{table}')
    with pytest.raises(MachineError, match=r"machine\.toml:3: fixture 1\.file: .*a\.stl"):
        Twin(tmp_path, plant="kinematic")


def test_a_name_that_the_machine_has_is_refused() -> None:
    with pytest.raises(MachineError, match="'vise_jaw' stands on the table of 4030 already"):
        Twin(plant="kinematic", fixtures=(JAW, JAW))


# ---- commands --------------------------------------------------------------------------------------------------------


def job(folder: Path, mm: float, bounds: str = "") -> Path:
    """A job that goes down to there over the jaw, and up again, with the jaw in the settings file beside it."""
    (folder / "isel-twin.toml").write_text(f"[check]\n{bounds}\n{TABLE}")
    path = folder / "job.txt"
    path.write_text("".join(f"{line}\n" for line in (*THERE, down(mm, 9600), down(0.0, 9600))))
    return path


def command(*call: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(part) for part in call])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def outcome(capsys: pytest.CaptureFixture[str], *call: object) -> tuple[int, list[Any]]:
    code = command(*call)
    return code, [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize("plant", PLANTS)
def test_run_fails_and_tells_it(tmp_path: Path, capsys: pytest.CaptureFixture[str], plant: str) -> None:
    path = job(tmp_path, 3.0)
    code, rows = outcome(capsys, "run", path, *NEAR, "--plant", plant, "--json")
    assert (code, "collisions" in rows[-1]) == (0, False)
    path = job(tmp_path, JAW_MM)
    code, rows = outcome(capsys, "run", path, *NEAR, "--plant", plant, "--json")
    (told,) = rows[-1]["collisions"]
    assert (code, told["first"], told["second"], rows[-1]["ok"]) == (1, "cutter", "jaw", False)
    assert command("run", path, *NEAR, "--plant", plant) == 1
    assert "cutter hits jaw at X " in capsys.readouterr().out


@pytest.mark.parametrize("plant", PLANTS)
def test_check_tells_the_line_in_every_form(tmp_path: Path, capsys: pytest.CaptureFixture[str], plant: str) -> None:
    path = job(tmp_path, JAW_MM)
    forms = ("--junit", tmp_path / "out.xml", "--sarif", tmp_path / "out.sarif", "--report", tmp_path / "pages")
    code, (told,) = outcome(capsys, "check", path, *NEAR, "--plant", plant, "--json", *forms)
    (finding,) = [one for one in told["findings"] if one["rule"] == "collision"]
    assert (code, finding["line"]) == (1, 4)
    assert 'type="collision"' in (tmp_path / "out.xml").read_text()
    log = json.loads((tmp_path / "out.sarif").read_text())
    assert "collision" in [result["ruleId"] for result in log["runs"][0]["results"]]
    page = (tmp_path / "pages" / "job.html").read_text()
    assert "cutter hits jaw" in page


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(("bound", "fails"), [("clearance = 2.0", True), ("clearance = 0.5", False)])
def test_a_bound_for_the_clearance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], plant: str, bound: str, fails: bool
) -> None:
    """1 mm above the jaw."""
    path = job(tmp_path, JAW_MM - 1.0 - 0.36, bound)
    code, (told,) = outcome(capsys, "check", path, *NEAR, "--plant", plant, "--json")
    assert [one["rule"] for one in told["findings"]] == (["clearance"] if fails else [])
    assert {one["line"] for one in told["findings"]} <= {4, 5}  # it stands there when line 5 begins
    assert code == int(fails)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_bound_for_the_clearance_of_nothing_is_without_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], plant: str
) -> None:
    (tmp_path / "job.txt").write_text("@07\n@0N7\n@0A160,900,0,30,0,30,0,30\n")
    code, (told,) = outcome(capsys, "check", tmp_path / "job.txt", "--clearance", "2", "--plant", plant, "--json")
    (finding,) = told["findings"]
    assert (code, finding["rule"], finding["level"]) == (0, "effect", "warning")
    assert finding["message"].startswith("clearance has no effect: nothing is clamped")


def test_a_recording_has_it_and_is_played_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from isel_twin.recordings.reading import read
    from isel_twin.recordings.replay import rebuilt, replay

    path, file = job(tmp_path, JAW_MM), tmp_path / "run.mcap"
    assert command("run", path, *NEAR, "--record", file) == 1
    recorded = read(file)
    (entry,) = recorded.of("/collisions")
    assert entry.content["first"] == "cutter"
    (tmp_path / "again").mkdir()
    assert replay(recorded, rebuilt(recorded, tmp_path / "again")) is None


def test_a_golden_run_tells_a_collision_that_is_new(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = job(tmp_path, JAW_MM)
    (tmp_path / "isel-twin.toml").rename(tmp_path / "away.toml")
    assert command("golden", "record", path, *NEAR, "--plant", "kinematic") == 0
    (tmp_path / "away.toml").rename(tmp_path / "isel-twin.toml")
    capsys.readouterr()
    assert command("golden", "compare", path) == 1
    assert "cutter hits jaw now" in capsys.readouterr().out


def test_the_words_are_those_of_the_value() -> None:
    known = Collision("cutter", "vise_jaw_left", (10.0, 20.0, -46.7), 12_300_000_000, 30.0, 45.0)
    where = "cutter hits vise_jaw_left at X 10.000 Y 20.000 Z -46.700 mm, 12.300 s, 30 mm/s"
    assert str(known) == f"{where}, 45 N"
    assert str(replace(known, force_n=None)) == f"{where}, force not known without physics"
