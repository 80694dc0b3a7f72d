"""Scenario files: read whole, sorted by time, wrong ones named in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.base.parameters import Place
from isel_twin.plant import Cut
from isel_twin.wiring import FAULTS, ScenarioError, cut_table, event_now, load_scenario, scenario_text
from isel_twin.wiring.cabinet import ELEMENTS

SETTABLE = {**ELEMENTS, **dict.fromkeys(("limit_x1", "limit_x2", "estop_1"), tuple(FAULTS))}


def load(folder: Path, text: str):  # type: ignore[no-untyped-def]
    file = folder / "scenario.toml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(file, SETTABLE)


def test_events_are_sorted_by_time(tmp_path: Path) -> None:
    events = load(
        tmp_path,
        """
        [[event]]
        at = 2.5
        set = { hood = "open", limit_x2 = "broken" }
        [[event]]
        at = 1
        force_n = { y = -20 }
        phase_lost = { z = "ab" }
        noise = 0.5
        """,
    )
    assert [event.at_ns for event in events] == [1_000_000_000, 2_500_000_000]
    assert events[0].acts == {"force_n": {"y": -20.0}, "phase_lost": {"z": "ab"}, "noise": 0.5}
    assert events[1].acts == {"set": {"hood": "open", "limit_x2": "broken"}}
    assert load(tmp_path, scenario_text(events)) == events


def test_a_force_acts_at_a_place(tmp_path: Path) -> None:
    text = "[[event]]\nat = 1\nforce_n = { x = 5 }\n[[event]]\nat = 2\nforce_n = { x = 5 }\nplace = 'table'\n"
    assert [event.place for event in load(tmp_path, text)] == ["", "table"]


CUT = """
[[event]]
at = 1
[event.cut]
diameter = 6.0
flutes = 2
depth = 0.5
width = {width}
spindle = 18000
kc = {kc}
"""
KC = '{ value = 800, unit = "N/mm2", grade = "estimate", source = "aluminium" }'


def test_a_cut_begins_and_ends(tmp_path: Path) -> None:
    begin, end = load(tmp_path, CUT.format(width=3, kc=KC) + "[[event]]\nat = 2\ncut = 'off'\n")
    assert begin.acts["cut"] == Cut(6.0, 2, 0.5, 3.0, 18_000.0, 800.0, radial=0.3, climb=True)
    assert begin.physical
    assert end.acts == {"cut": "off"}
    assert not end.physical


def test_a_tool_that_bends_is_read_and_written_down_alike(tmp_path: Path) -> None:
    tool = 'stickout = 20\nshank = 6\nflute_length = 9.5\ntool_material = "hss"\n'
    (begin,) = load(tmp_path, CUT.format(width=3, kc=KC) + tool)
    cut = Cut(
        6.0, 2, 0.5, 3.0, 18_000.0, 800.0, stickout_mm=20.0, shank_mm=6.0, flute_length_mm=9.5, tool_material="hss"
    )
    assert begin.acts["cut"] == cut
    again = event_now({"cut": cut_table(cut)}, Place("journal", ScenarioError), {})
    assert again.acts["cut"] == cut


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CUT.format(width=7, kc=KC), "event 1.cut: cut: width must be at most the diameter, 6 mm, not 7.0"),
        (CUT.format(width=0, kc=KC), "event 1.cut.width: 0; allowed: 0.001 .. 100 mm"),
        (CUT.format(width=1, kc=800), "event 1.cut.kc: 800; allowed: a table such as { value = 0.1, unit"),
        (CUT.format(width=1, kc=KC) + "shank = 6", "event 1.cut: cut: shank and flute_length are those of a tool that"),
        (
            CUT.format(width=1, kc=KC) + "stickout = 20 \ntool_material = 'wood'",
            "event 1.cut.tool_material: 'wood'; allowed",
        ),
        (CUT.format(width=1, kc=KC) + "helix = 30", "event 1.cut.helix: unknown key"),
        ("[[event]]\nat = 1\ncut = 'on'", "event 1.cut: 'on'; allowed: off"),
        ("[[event]]\nat = 1\n[event.cut]\ndiameter = 6", "event 1.cut.flutes: missing"),
    ],
)
def test_a_wrong_cut_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load(tmp_path, text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("at = 1", "at: unknown key; a scenario is a list of [[event]] tables"),
        ("event = 3", "event: 3; it must be written as [[event]] tables"),
        ("[[event]]\nset = { hood = 'open' }", "event 1.at: missing; allowed: 0 .. 1e+09 s"),
        ("[[event]]\nat = -1", "event 1.at: -1; allowed: 0 .. 1e+09 s"),
        ("[[event]]\nat = true", "event 1.at: True; allowed: 0 .. 1e+09 s"),
        ("[[event]]\nat = 1", "event 1: nothing happens; say what: set, force_n, phase_lost, noise, cut"),
        ("[[event]]\nat = 1\nsett = {}", "event 1.sett: unknown key; did you mean 'set'?"),
        ("[[event]]\nat = 1\nset = { hoood = 'open' }", "unknown input 'hoood'; did you mean 'hood'?"),
        (
            "[[event]]\nat = 1\nset = { hood = 'broken' }",
            "input 'hood' cannot be 'broken'; it can be: closed, open, forced",
        ),
        ("[[event]]\nat = 1\nset = { limit_x1 = 'down' }", "it can be: ok, broken, stuck_open, stuck_closed"),
        ("[[event]]\nat = 1\nforce_n = { a = 1 }", "event 1.force_n.a: unknown key; allowed: x, y, z"),
        ("[[event]]\nat = 1\nphase_lost = { x = 'c' }", "event 1.phase_lost.x: 'c'; allowed: a, b, ab, \"\""),
        ("[[event]]\nat = 1\nnoise = 2", "event 1.noise: 2; allowed: 0 .. 1"),
        ("[[event]]\nat = 1\nset = 'hood'", "event 1.set: 'hood'; allowed: a table such as { name = value }"),
        ("[[event]]\nat = 1\nforce_n = { x = 1e6 }", "event 1.force_n.x: 1000000.0; allowed: -100000 .. 100000 N"),
        (
            "[[event]]\nat = 1\nplace = 'tool'",
            "event 1: nothing happens; say what: set, force_n, phase_lost, noise, cut",
        ),
        ("[[event]]\nat = 1\nnoise = 0\nplace = 'tool'", "event 1.place: no force acts there; allowed: beside force_n"),
        ("[[event]]\nat = 1\nforce_n = { x = 1 }\nplace = 'hood'", "event 1.place: 'hood'; allowed: tool, table"),
        ("[[event]", "not a TOML file"),
    ],
)
def test_a_wrong_file_is_named_with_place_and_remedy(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load(tmp_path, text)
    assert message in str(error.value)
    assert str(tmp_path / "scenario.toml") in str(error.value)
    assert "\n" not in str(error.value)
