"""The words of a condition, and what a wrong one is told: file, line, event, what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from isel_twin.machine import load_machine
from isel_twin.wiring import ScenarioError, ScenarioEvent, Trigger, load_scenario, outputs, settable

MACHINE = load_machine("4030")


def load(folder: Path, text: str) -> tuple[ScenarioEvent, ...]:
    file = folder / "scenario.toml"
    file.write_text(text, encoding="utf-8")
    switches = [switch.name for switch in MACHINE.switches]
    return load_scenario(file, settable(MACHINE), switches, outputs(MACHINE))


@pytest.mark.parametrize(
    ("words", "condition"),
    [
        ("sent @0M", Trigger("sent", "@0M")),
        ("sent @0A 1, 2", Trigger("sent", "@0A 1, 2")),
        ("replied 0", Trigger("replied", "0")),
        ("x > 120 mm", Trigger("position", "x", 120.0, 1)),
        ("z<-2.5mm", Trigger("position", "z", -2.5, -1)),
        ("z < -2.5 mm", Trigger("position", "z", -2.5, -1)),
        ("output spindle == 1", Trigger("output", "spindle", 1.0)),
        ("output power==0", Trigger("output", "power", 0.0)),
        ("input hood == open", Trigger("input", "hood", "open")),
        ("input limit_x1 == struck", Trigger("input", "limit_x1", "struck")),
        ("input limit_x1 == broken", Trigger("input", "limit_x1", "broken")),
        ("0.5 s after first", Trigger("after", "first", 0.5)),
        ("20 ms after first", Trigger("after", "first", 0.02)),
    ],
)
def test_conditions(tmp_path: Path, words: str, condition: Trigger) -> None:
    first, second = load(
        tmp_path, f'[[event]]\nname = "first"\nat = 0\nreset = true\n[[event]]\nwhen = "{words}"\nreset = true'
    )
    assert (first.when, first.name) == (None, "first")
    assert second.when == condition
    assert second.times == 1


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("at = 1\nrepeat = 4\nevery = 0.5", {"at_ns": 10**9, "times": 4, "every_ns": 500_000_000}),
        ('when = "replied 0"\nalways = true', {"times": 0}),
        ('when = "replied 0"\ntimes = 3\ndelay = 0.3', {"times": 3, "delay_ns": 300_000_000}),
        ("at = 1\nfor = 0.25", {"for_ns": 250_000_000}),
    ],
)
def test_how_often_and_how_long(tmp_path: Path, text: str, fields: dict[str, Any]) -> None:
    (event,) = load(tmp_path, f"[[event]]\n{text}\nnoise = 0.1\n")
    assert {name: getattr(event, name) for name in fields} == fields
    assert set(event.content) == {"noise", *(["for"] if "for" in text else [])}, "nothing of its time"


def test_what_ends_an_event_is_the_off_of_each_key(tmp_path: Path) -> None:
    (event,) = load(
        tmp_path,
        """
        [[event]]
        at = 1
        for = 2
        set = { hood = "open", limit_x1 = "broken", stop = "down" }
        swapped = { limit_y1 = "limit_y2" }
        phase_lost = { x = "a" }
        obstacle_mm = { y = 100 }
        line_cut = true
        reset = true
        """,
    )
    assert event.end is not None
    assert event.end.acts == {
        "set": {"hood": "closed", "limit_x1": "ok", "stop": "up"},
        "phase_lost": {"x": ""},
        "swapped": {"limit_y1": ""},
        "obstacle_mm": {"y": "off"},
        "line_cut": False,
    }


ONE = "[[event]]\nat = 0\nreset = true\n\n# the second\n[[event]]\nreset = true\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":6: event 2.at: missing; allowed: 0 .. 1e+09 s, or a condition: when = 'sent TEXT'"),
        ('when = "x > 120"', ":8: event 2.when: 'x > 120': unit ''; allowed: 'mm'"),
        ('when = "x > 12 cm"', ":8: event 2.when: 'x > 12 cm': unit 'cm'; allowed: 'mm'"),
        ('when = "x = 12 mm"', ":8: event 2.when: 'x = 12 mm'; allowed: x > NUMBER mm or x < NUMBER mm"),
        ('when = "x > 1e9 mm"', ":8: event 2.when: 1000000000.0; allowed: -100000 .. 100000 mm"),
        ('when = "a > 12 mm"', ":8: event 2.when: 'a > 12 mm'; allowed: 'sent TEXT', 'replied TEXT', 'x > 120 mm'"),
        ('when = "sent"', ":8: event 2.when: 'sent': sent what? allowed: how the message begins"),
        ("when = 3", ":8: event 2.when: 3; allowed: 'sent TEXT'"),
        ('when = "output spindel == 1"', ":8: event 2.when: unknown output 'spindel'; did you mean 'spindle'?"),
        ('when = "output spindle == on"', ":8: event 2.when: output 'spindle' cannot be 'on'; allowed: a whole number"),
        ('when = "output spindle"', ":8: event 2.when: 'output spindle'; allowed: output NAME == VALUE"),
        ('when = "input hod == open"', ":8: event 2.when: unknown input 'hod'; did you mean 'hood'?"),
        (
            'when = "input hood == ajar"',
            ":8: event 2.when: input 'hood' cannot be 'ajar'; it can be: closed, open, forced",
        ),
        ('when = "1 s after trip"', ":8: event 2.when: unknown event 'trip'; no event has a name"),
        ('name = "trap"\nwhen = "1 s after trip"', ":9: event 2.when: unknown event 'trip'; did you mean 'trap'?"),
        ('name = "trip"\nwhen = "1 min after trip"', ":9: event 2.when: unit 'min'; allowed: 's', 'ms'"),
        ('name = "trip"\nwhen = "1 s after trip"', ":9: event 2.when: waits for itself, by way of 'trip'"),
        ('at = 1\nwhen = "replied 0"', ":8: event 2.at: there is a condition; allowed: either at or when"),
        ("at = 1\ndelay = 1", ":9: event 2.delay: there is no condition; allowed: beside when"),
        ("at = 1\nrepeat = 2", ":9: event 2.repeat: every is missing"),
        ("at = 1\nrepeat = 2.5\nevery = 1", ":9: event 2.repeat: 2.5; allowed: a whole number, 1 .. 1e+06"),
        ('when = "replied 0"\nrepeat = 2', ":9: event 2.repeat: there is a condition"),
        ('when = "replied 0"\ntimes = 0', ":9: event 2.times: 0; allowed: 1 .. 1e+06"),
        ('when = "replied 0"\ntimes = 2\nalways = true', ":10: event 2.always: there is times, too"),
        ('when = "replied 0"\nalways = false', ":9: event 2.always: False; allowed: true"),
        ('at = 1\nname = "two words"', ":9: event 2.name: 'two words'; allowed: a word, without spaces"),
        ("at = 1\nset = { hoood = 'open' }", ":9: event 2.set: unknown input 'hoood'; did you mean 'hood'?"),
        ("at = 1\n\n[event.friction_n]\ny = 3\nx = -1", ":12: event 2.friction_n.x: -1; allowed: 0 .. 100000 N"),
        ("at = 1\nwen = 2", ":9: event 2.wen: unknown key; did you mean 'when'?"),
    ],
)
def test_a_wrong_event_is_told_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load(tmp_path, ONE + text)
    assert message in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "scenario.toml") + ":")
    assert "\n" not in str(error.value)


def test_names_are_given_once(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r":6: event 2.name: 'a' is the name of another event"):
        load(tmp_path, '[[event]]\nname = "a"\nat = 0\nreset = true\n[[event]]\nname = "a"\nat = 0\nreset = true')


def test_chains_that_close_are_refused(tmp_path: Path) -> None:
    text = "".join(
        f'[[event]]\nname = "{name}"\nwhen = "1 s after {other}"\nreset = true\n'
        for name, other in (("a", "b"), ("b", "c"), ("c", "b"))
    )
    with pytest.raises(ScenarioError, match=r"event 1\.when: waits for itself, by way of 'b'"):
        load(tmp_path, text)
