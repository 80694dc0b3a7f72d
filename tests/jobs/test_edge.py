"""How far a job is from losing steps: the speed from which on a motor swings, and what it takes to lose steps."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.firmware.imc.retiming import faster
from isel_twin.jobs import edge
from isel_twin.jobs.checks.job import check_job
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from tests import forked
from tests.in_process import isel_twin
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=9)

LONG = "@07\n@0N7\n@0J60\n@0A32000,{hz},0,30,0,30,0,30\n"
"""100 mm of X: at 48 V and 60 Hz/ms all is lost from between 25 500 and 26 000 Hz on."""


@cache
def verdict_of(hz: int, seed: int = 0, **overrides: float) -> Any:
    lines = parse_job(LONG.format(hz=hz), create_language("imc-s8"), "imc-s8")
    spec = TwinSpec(
        seed=seed, overrides={f"axes.x.{key.replace('__', '.')}": value for key, value in overrides.items()}
    )
    return played(spec.build(), lines).verdict


@pytest.mark.parametrize(("hz", "rpm"), [(8000, 300.0), (16_000, 600.0), (21_000, 787.5)])
def test_the_edge_of_a_line_is_the_limit_over_its_speed(hz: int, rpm: float) -> None:
    """The limit is 855 rev/min with the friction of X: a kick dies at 0.95 and grows at 1.05 of that; 1600 steps a
    revolution."""
    (factor, line), y, z, a = verdict_of(hz).edge
    assert factor == pytest.approx(855.0 / rpm, rel=0.02)
    assert line == 4
    assert y is None or y[0] > 10.0
    assert z is None or z[0] > 10.0
    assert a is None


def test_less_supply_brings_it_nearer() -> None:
    assert verdict_of(12_000, stage__supply=36.0).edge[0][0] == pytest.approx(665.0 / 450.0, rel=0.03)


def test_it_stands_in_summary_and_last_line() -> None:
    told = verdict_of(16_000).summary()["edge"]
    assert set(told) == {"x"}
    speed = told["x"]["speed"]
    assert told["x"]["supply"] == pytest.approx(1.0 / speed, abs=1e-4)
    assert told["x"]["line"] == 4


def test_a_bound_on_it_names_axis_and_line(tmp_path: Path) -> None:
    lines = parse_job(LONG.format(hz=20_000), create_language("imc-s8"), "imc-s8")
    found = check_job(tmp_path / "job.txt", TwinSpec(), lines, Bounds(edge=1.2)).findings
    assert [(finding.rule, finding.line) for finding in found] == [("edge", 4)]
    assert found[0].message.startswith("x: unstable above 1.1")
    assert check_job(tmp_path / "job.txt", TwinSpec(), lines, Bounds(edge=1.0)).ok


@pytest.mark.parametrize(("first", "farthest"), [(1.43, 3.0), (1.02, 3.0), (0.67, 0.3), (2.999, 3.0)])
def test_the_least_factor_is_found_to_one_per_cent(first: float, farthest: float) -> None:
    def lost(factor: float) -> bool:
        return factor >= first if farthest > 1.0 else factor <= first

    found = edge._least(lost, lost, farthest)
    assert found is not None
    assert lost(found)
    assert found == pytest.approx(first, rel=0.01)


def test_strides_end_where_single_steps_do() -> None:
    for first in (1.43, 5.0, 9.99):
        asked: list[float] = []

        def lost(factor: float, first: float = first, asked: list[float] = asked) -> bool:
            asked.append(factor)
            return factor >= first

        found = edge._least(lost, lost, 10.0, edge.STRIDE)
        assert found == pytest.approx(first, rel=0.01)
        assert len(asked) < 25  # forty by single steps


def test_steps_that_a_reference_run_hides_are_lost() -> None:
    """At 30 000 Hz the way is lost, and the carriage is at its reference again at the end."""
    text = LONG.format(hz=20_000) + "@0R7\n"
    lines = parse_job(text, create_language("imc-s8"), "imc-s8")
    assert edge.tried(TwinSpec(), lines, "speed", ("x",), 1.5, seed=0).lost == {"x": 4}
    assert edge.tried(TwinSpec(), lines, "speed", ("x", "y"), 1.5, seed=0).lost == {"x": 4}  # played to its end
    made = edge.tried(TwinSpec(), lines, "speed", ("x",), 1.0, seed=0)
    assert (made.lost, made.ends) == ({}, "")


@pytest.mark.parametrize("earlier", [1.45, 1.37])
def test_what_never_loses_has_no_edge_and_other_seeds_may_lose_earlier(earlier: float) -> None:
    """The scan holds at 1.419 and loses at 1.504: others may lose before either."""
    assert edge._least(lambda _: False, lambda _: False, 3.0) is None
    found = edge._least(lambda factor: factor > 1.5, lambda factor: factor > earlier, 3.0)
    assert found == pytest.approx(earlier, rel=0.01)


def test_what_a_stride_has_passed_over_is_found_by_steps() -> None:
    """Strides stand at 1.594 and 2.012; halved at once, 1.74 holds, and the band before it is passed over."""

    def lost(factor: float) -> bool:
        return 1.65 <= factor <= 1.70 or factor >= 1.95

    assert edge._least(lost, lost, 10.0, edge.STRIDE) == pytest.approx(1.65, rel=0.01)


def test_a_job_is_over_when_every_axis_that_is_asked_for_has_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    lost: list[list[int]] = [[], [1], [0, 1], [0, 1]]
    monkeypatch.setattr(edge, "out_of_step", lambda _: lost.pop(0))
    seen = edge._Losses(SimpleNamespace(), ("x", "y"))  # type: ignore[arg-type]
    over = []
    for number in (3, 4, 5, 6):
        seen.take(SimpleNamespace(number=number, complete=True, ok=True))  # type: ignore[arg-type]
        over.append(seen.stop())
    assert (seen.lines, over) == ({"y": 4, "x": 5}, [False, False, True, True])


@pytest.mark.parametrize(
    ("quantity", "changed"),
    [
        ("supply", {"stage.supply": 48.0}),
        ("inductance", {"specimen.inductance": 1.0}),
        ("load", {"guide_friction": 30.0, "shaft_coulomb": 0.09, "shaft_viscous": 2e-4}),
    ],
)
def test_one_axis_is_changed_and_what_was_changed_before_stays(quantity: str, changed: dict[str, float]) -> None:
    call = TwinSpec(overrides={"payload.mass": 3.0})
    spec, lines = edge._changed(call, [], edge._Search(quantity, ("y",)), 1.2)
    assert spec.overrides == {
        "payload.mass": 3.0, **{f"axes.y.{key}": pytest.approx(1.2 * value) for key, value in changed.items()}
    }  # fmt: skip
    assert lines == []


def test_a_faster_job_keeps_its_lines_and_what_they_expect() -> None:
    lines = parse_job(
        "@07\n# a way\n@0N7\n@0A1600,800,0,30,0,30,0,30 => 0\n! lost == 0\n", create_language("imc-s8"), "imc-s8"
    )
    spec, made = edge._changed(TwinSpec(), lines, edge._Search("speed", ("x",)), 1.5)
    assert spec == TwinSpec()
    assert [line.command for line in made][2] == "@0A1600,1200,0,45,0,45,0,45"
    assert [(line.number, line.expected) for line in made] == [(line.number, line.expected) for line in lines]


def test_an_edge_is_told_with_its_band_and_the_first_line_that_loses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every seed loses from 1.46 on and in a band about 1.39 that the scan passes over, in lines 9, 8 and 7."""

    def tried(_: TwinSpec, __: Any, ___: str, axes: tuple[str, ...], factor: float, seed: int, ____: float) -> Any:
        lost = 1.38 <= factor <= 1.40 or factor >= 1.46
        return edge.Trial(dict.fromkeys(axes, 9 - seed) if lost else {})

    monkeypatch.setattr(edge, "tried", tried)
    (found,) = edge._found(TwinSpec(), [], 60.0, (0, 1, 2), edge._Search("speed", ("x",)))
    assert found.factor is not None
    assert found.factor == pytest.approx(1.39, abs=0.02)
    assert 0.95 * found.factor < 1.38
    assert 1.05 * found.factor >= 1.46
    assert (found.line, found.axis, found.closed_loop) == (7, "x", False)


@pytest.mark.parametrize(
    ("bands", "farthest"),
    [
        ([(1.38, 1.40), (1.46, 9.0)], 3.0),  # the scan stands at 1.338 and at 1.419
        ([(1.45, 1.46), (1.60, 9.0)], 3.0),  # narrower than 5 %
        ([(1.45, 9.0)], 3.0),
        ([(0.62, 0.63), (0.0, 0.45)], 0.3),
        ([(0.0, 0.45)], 0.3),
    ],
)
def test_five_per_cent_nearer_holds_and_farther_loses(bands: list[tuple[float, float]], farthest: float) -> None:
    def lost(factor: float) -> bool:
        return any(low <= factor <= high for low, high in bands)

    sign = 1 if farthest > 1.0 else -1
    nearest = bands[0][0] if sign > 0 else bands[0][1]
    first = edge._before_bands(lost, nearest, sign)
    told = edge._between_sure(lost, lost, first, sign)
    assert not lost(told * 0.95**sign)
    assert lost(told * 1.05**sign)
    assert told == pytest.approx(nearest, rel=0.052)


@pytest.mark.parametrize(
    ("inductance", "farthest"), [(1.0, 5.0 / 1.06), (3.0, 1.5), (4.9, 1.0)], ids=["sheet", "three times", "at its end"]
)
def test_nothing_is_tried_that_the_machine_file_does_not_allow(inductance: float, farthest: float) -> None:
    """It allows a specimen 0.2 to 5 times the inductance of its sheet."""
    call = TwinSpec(overrides={"axes.x.specimen.inductance": inductance})
    found = edge._farthest(call, [], edge._Search("inductance", ("x",)))
    assert found == pytest.approx(farthest, rel=0.06)
    assert inductance * found * edge.FARTHER <= 5.0 or found == 1.0


def test_a_band_that_the_scan_has_passed_over_is_found() -> None:
    def lost(factor: float) -> bool:
        return 1.38 <= factor <= 1.40 or factor >= 1.46

    first = edge._least(lost, lost, 3.0)
    assert first == pytest.approx(1.46, rel=0.01)
    assert edge._before_bands(lost, first, 1) == pytest.approx(1.38, rel=0.01)


def test_where_seeds_differ_everywhere_the_first_loss_is_told() -> None:
    assert edge._between_sure(lambda factor: factor > 1.4, lambda _: False, 1.41, 1) == 1.41


def test_an_edge_is_moved_by_five_per_cent_at_most() -> None:
    """The first loss is at 1.4, all are lost from 1.543 on: 1.47, 5 % farther, is the only place between. From 1.56 on
    there is none, and the first loss is told."""
    for lost_by_all, told in ((1.543, 1.47), (1.56, 1.4)):
        found = edge._between_sure(lambda factor: factor >= 1.4, lambda factor, at=lost_by_all: factor >= at, 1.4, 1)
        assert found == pytest.approx(told)


def test_places_from_which_the_job_meets_a_switch_are_passed_over() -> None:
    """Y has 300 mm: 200 mm from where seeds 1006, 1007, 1011 ... stand at power-on end in the switch."""
    lines = parse_job("@07\n@0N7\n@0J200\n@0A0,30,64000,15000,0,30,0,30\n", create_language("imc-s8"), "imc-s8")
    call = TwinSpec(plant="kinematic")
    found = edge.alike(call, lines, range(1004, 1014), 4)
    assert found == (1004, 1005, 1008, 1009)
    for seed in (1006, 1007):
        assert played(call.with_(seed=seed).build(), lines).verdict.refused == 1
    assert edge.alike(call, lines, range(1006, 1008), 4) == ()


def test_each_edge_is_the_first_loss_of_three_seeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of seed 1005 and the next two that do not meet a switch, 1008 and 1009. The last of them loses 7 % earlier than
    the others, so that all lose 5 % beyond 0.952 of where those do, which is what is told."""
    first = {"speed": 1.5, "supply": 0.6, "inductance": 2.0, "load": 4.0}
    asked: set[int] = set()

    def tried(_: TwinSpec, __: Any, quantity: str, axes: tuple[str, ...], factor: float, seed: int, ___: float) -> Any:
        asked.add(seed)
        sign = -1 if quantity == "supply" else 1
        beyond = (factor / first[quantity] * (0.93**-sign if seed == 1009 else 1.0)) ** sign >= 1.0
        return edge.Trial(dict.fromkeys(axes, seed - 1000) if beyond else {})

    monkeypatch.setattr(edge, "tried", tried)
    lines = parse_job("@07\n@0N7\n@0J200\n@0A0,30,64000,15000,0,30,0,30\n", create_language("imc-s8"), "imc-s8")
    verdict = verdict_of(8000)
    moved = [axis for axis, found in zip("xyz", verdict.edge, strict=False) if found]
    found = list(edge.edges(TwinSpec(plant="kinematic", seed=1005), lines, verdict, timeout_s=60.0))
    assert asked == {1005, 1008, 1009}
    expected = [("speed", axis) for axis in moved]
    expected += [(quantity, axis) for axis in moved for quantity in ("supply", "inductance", "load")]
    assert [(each.quantity, each.axis) for each in found] == expected
    for each in found:
        nearest = first[each.quantity] * (0.952 if each.quantity != "supply" else 1.0 / 0.952)
        assert each.factor == pytest.approx(nearest, rel=0.01), each
        assert each.line in (5, 9)
    monkeypatch.setattr(edge, "tried", lambda *asked: edge.Trial({}, moving_ns=round(1e9 / asked[4])))
    none = list(edge.edges(TwinSpec(plant="kinematic", seed=1005), lines, verdict, timeout_s=60.0))
    assert [(each.quantity, each.axis) for each in none] == expected
    assert {(each.factor, each.line, each.closed_loop, each.seeds) for each in none} == {(None, None, False, 3)}
    farthest = {(each.tried, each.ends) for each in none if each.quantity != "inductance"}
    assert farthest == {(3.0, ""), (0.3, ""), (10.0, "")}


def test_a_rotor_that_rests_halfway_has_lost_in_the_last_line(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = parse_job(LONG.format(hz=8000), create_language("imc-s8"), "imc-s8")
    halfway = SimpleNamespace(verdict=SimpleNamespace(halfway=(False, True, False, False)))
    monkeypatch.setattr(edge, "played", lambda *_, **__: halfway)
    assert edge.tried(TwinSpec(plant="kinematic"), lines, "speed", ("x",), 1.0, seed=0).lost == {"y": 4}


def test_a_seed_that_loses_steps_is_a_loss_and_not_passed_over() -> None:
    lines = parse_job(LONG.format(hz=30_000), create_language("imc-s8"), "imc-s8")
    assert any(verdict_of(30_000).lost)
    assert edge.alike(TwinSpec(), lines, range(2), 2) == (0, 1)


@pytest.mark.parametrize(
    ("last", "said"),
    [
        ("@0Q9", "job.txt: no edge is searched for, as the job itself fails"),
        ("@0A9000,30000,0,30,0,30,0,30", "job.txt: no edge is searched for, as the job itself fails"),
        ("@0P", ""),
    ],
    ids=["refused", "lost", "no move"],
)
def test_where_there_is_none_a_line_says_so(last: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text(f"@07\n@0N7\n@0J4000\n{last}\n")
    done = isel_twin("run", tmp_path / "job.txt", "--edge")
    assert done.returncode == (1 if said else 0)
    assert done.stderr == (f"isel-twin: {tmp_path}/{said}\n" if said else "")
    assert ("no motor turned" in done.stdout) == (not said)


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to a group of processes")
def test_ctrl_c_tells_of_what_is_not_known(tmp_path: Path) -> None:
    """Before any edge is found: nothing is told of what holds, and the last line keeps what was known before."""
    (tmp_path / "job.txt").write_text(LONG.format(hz=9000))
    with forked.start("run", "job.txt", "--edge", "--json", cwd=tmp_path, start_new_session=True) as command:
        assert command.stdout is not None
        summary = next(line for line in command.stdout if '"summary": true' in line)
        time.sleep(0.5)  # amid the search, which takes many
        os.killpg(command.pid, signal.SIGINT)
        out, err = command.communicate(timeout=forked.PATIENCE_S)
    assert command.returncode == 130
    assert err.splitlines()[-1] == "isel-twin: job.txt: interrupted; not all edges were found"
    assert out == ""
    assert set(json.loads(summary)["edge"]["x"]) == {"speed", "supply", "inductance", "line"}


def test_speeds_of_straight_moves_are_scaled_and_nothing_else() -> None:
    lines = ["@0J60", "@0A1600,800,0,30,0,30,0,30", "! x == 5 +- 1 mm", "@0M1,2000,0,900,0,900,0,900", "@0P", "<1s>"]
    assert faster(lines, 1.5) == [
        "@0J60", "@0A1600,1200,0,45,0,45,0,45", "! x == 5 +- 1 mm", "@0M1,3000,0,1350,0,1350,0,1350", "@0P", "<1s>"
    ]  # fmt: skip


@pytest.mark.slow
def test_at_a_little_less_it_holds_and_at_a_little_more_it_is_lost() -> None:
    call, lines = TwinSpec(), parse_job(LONG.format(hz=20_000), create_language("imc-s8"), "imc-s8")
    told = (
        (each.axis, each.quantity, each.factor) for each in edge.edges(call, lines, verdict_of(20_000), timeout_s=60.0)
    )
    speed = next(factor for axis, quantity, factor in told if (axis, quantity) == ("x", "speed"))
    supply = next(factor for axis, quantity, factor in told if (axis, quantity) == ("x", "supply"))
    assert speed is not None
    assert supply is not None
    assert 25_500 <= 20_000 * speed <= 26_500
    for seed in range(10, 12):
        assert not any(verdict_of(round(0.95 * speed * 20_000), seed).lost)
        assert any(verdict_of(round(1.05 * speed * 20_000), seed).lost)
        assert not any(verdict_of(20_000, seed, stage__supply=48.0 * supply / 0.95).lost)
        assert any(verdict_of(20_000, seed, stage__supply=48.0 * supply / 1.05).lost)


@pytest.mark.slow
def test_the_command_line_says_it_in_words_and_in_json(tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text("@07\n@0N7\n@0J100\n@0A16000,16000,0,30,0,30,0,30\n")
    machine = near_switches(tmp_path, 2.0, more=COARSE)
    done = isel_twin("run", tmp_path / "job.txt", "--machine", machine, "--edge", "--robust", "1", "--json")
    *_, last = (json.loads(line) for line in done.stdout.splitlines())
    assert done.returncode == 0, done
    assert set(last["robust"]) == {"lost", "of", "at_most"}
    assert last["lost_steps"] == [0, 0, 0, 0]
    assert last["position_mm"][0] == pytest.approx(50.0, abs=0.1)
    assert set(last["edge"]["x"]) == {"speed", "supply", "inductance", "load"}
    assert last["edge_lines"]["x"]["speed"] == 4
    assert 1.3 < last["edge"]["x"]["speed"] < 2.5
    assert 0.3 < last["edge"]["x"]["supply"] < 0.8
    refused = isel_twin("run", tmp_path / "job.txt", "--edge", "--plant", "kinematic")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith("isel-twin: --edge: the kinematic plant loses no step")


@pytest.mark.parametrize(
    ("controller", "text"),
    [
        ("gmi99", "Q7;1\nM100000\nB1000\nf100000\n81h 50000\n"),
        ("bwo900", "N10 G90 G53\nN20 G1 X40 F5000\nN30 M30\n"),
    ],
)
def test_the_edge_of_a_servo_axis_is_where_its_drive_switches_itself_off(
    controller: str, text: str, tmp_path: Path
) -> None:
    """The following error is speed over 40 1/s and may be 4000 increments: from 160 000 increments/s on. The BWO 900
    makes no more than P12004, 100 000."""
    job = tmp_path / "job.txt"
    job.write_text(text)
    machine = near_switches(tmp_path, 2.0, "4030-servo")
    done = isel_twin("run", job, "--controller", controller, "--machine", machine, "--edge", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    last = json.loads(done.stdout.splitlines()[-1])
    edge = last["edge"]
    if controller == "bwo900":
        assert edge == {axis: {"speed": None} for axis in "xyz"}
        assert last["edge_tested"]["x"]["speed"] == {
            "to": pytest.approx(1.2, rel=0.07), "ends": "no move is any faster"
        }  # fmt: skip
    else:
        assert edge["x"] == {"speed": pytest.approx(1.6, rel=0.03)}


def test_a_factor_beyond_the_range_of_a_number_loses_that_trial_alone() -> None:
    """The inductance of a specimen ends at 5 times that of its sheet; beyond, nothing is known to be lost."""
    call = TwinSpec("4030", "imc-s8", "mujoco", overrides={"axes.x.specimen.inductance": 4.9})
    lines = parse_job("@07\n@0N7\n@0A800,800,0,30,0,30,0,30\n", create_language("imc-s8"), "imc-s8")
    assert edge.tried(call, lines, "inductance", ("x",), 1.1, 0) == edge.Trial({}, edge.BEYOND)
    verdict = played(call.build(), lines).verdict
    found = [one for one in edge.edges(call, lines, verdict, timeout_s=60.0) if one.quantity == "inductance"]
    assert [(one.axis, one.factor) for one in found] == [("x", None)]
    assert 1.0 <= found[0].tried <= 5.0 / 4.9
    assert found[0].ends == edge.BEYOND


@pytest.mark.parametrize(
    ("controller", "text", "factor", "said"),
    [
        ("c142", "@07\n@0N7\n@0J100\n@0A4000,9000,0,30,0,30,0,30\n", 10_000 / 9000, "line 4 is refused (D: "),
        ("imc-s8", "@07\n@0N7\n@0J30\n@0A400,9000,0,30,0,30,0,30\n", 1.0, "no move is any faster"),
    ],
)
def test_a_speed_that_is_refused_or_not_reached_holds_nothing(
    controller: str, text: str, factor: float, said: str
) -> None:
    """A C142 takes up to 10 000 Hz. 400 steps at 30 Hz/ms reach sqrt(400 x 30 000) Hz, 3464, and never 9000."""
    call, lines = TwinSpec(controller=controller), parse_job(text, create_language(controller), controller)
    (found,) = edge._found(call, lines, 60.0, (0, 1, 2), edge._Search("speed", ("x",)))
    assert (found.factor, found.seeds) == (None, 3)
    assert factor / 1.02 < found.tried <= factor
    assert found.ends.startswith(said)
    assert edge.told([found])["edge_tested"]["x"]["speed"] == {"to": round(found.tried, 4), "ends": found.ends}


def test_what_another_axis_ends_is_not_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 1.3 on X loses, and its next line strikes a switch: Y is known up to there."""

    def tried(*asked: Any) -> edge.Trial:
        beyond = asked[4] >= 1.3
        return edge.Trial({"x": 4} if beyond else {}, "line 5 is refused (2)" if beyond else "", round(1e9 / asked[4]))

    monkeypatch.setattr(edge, "tried", tried)
    x, y = edge._found(TwinSpec(), [], 60.0, (0, 1, 2), edge._Search("speed", ("x", "y")))
    assert (x.factor, x.ends) == (pytest.approx(1.3, rel=0.01), "")
    assert (y.factor, y.tried, y.ends) == (None, pytest.approx(1.3, rel=0.02), "line 5 is refused (2)")
    assert y.tried < 1.3
