"""A trigger of the panel: virtual time stops at the instant of an edge or event, the same one at any speed."""

from __future__ import annotations

import pytest

from isel_twin import Twin

MOVE = "@0A 16000,8000,0,800,0,800,0,800"  # X to 50 mm, at 25 mm/s


def alone(begin_ns: int, line_speed: bool) -> int:
    """The first multiple of a millisecond with X beyond 20 mm, ns, of a twin that nobody serves: MOVE at begin_ns."""
    twin = Twin(plant="kinematic", line_speed=line_speed)
    assert twin.language is not None
    for data in twin.language.reference():
        twin.write(data)
        twin.run_until_idle()
    twin.run_until(begin_ns)
    twin.write(twin.language.frame(MOVE))
    while twin.position_mm[0] <= 20.0:
        twin.run_until((twin.time_ns // 1_000_000 + 1) * 1_000_000)
    return twin.time_ns


def replied(begin_ns: int, line_speed: bool) -> int:
    """When the last byte of the reply to MOVE is on the line, ns: it is in the hand of a host from then on."""
    twin = Twin(plant="kinematic", line_speed=line_speed)
    assert twin.language is not None
    for data in twin.language.reference():
        twin.write(data)
        twin.run_until_idle()
    twin.read()
    twin.run_until(begin_ns)
    arrivals: list[int] = []
    twin.listen(lambda _, kind, what: arrivals.append(what.arrival_ns) if kind == "received" else None)
    twin.write(twin.language.frame(MOVE))
    twin.run_until_idle()
    return arrivals[-1]


@pytest.mark.parametrize("speed", [None, 200.0, 37.0])
def test_a_position_pauses_at_the_same_instant_at_any_speed(bench, browser, speed: float | None):
    page = browser(bench(speed=speed, ready=True))
    begin_ns = page.ask(pause=True)["time_ns"]
    assert page.request(trigger={"position": "x", "above": 20})["ok"]["trigger"]["hit_s"] is None
    assert "ok" in page.request(say=MOVE)
    page.ask(resume=True)
    page.until(lambda: page.frame["trigger"] and page.frame["trigger"]["hit_s"] is not None)
    page.until(lambda: page.frame["paused"])
    assert page.frame["time_ns"] == round(page.frame["trigger"]["hit_s"] * 1e9) == alone(begin_ns, speed is not None)
    page.ask(resume=True)
    page.until(lambda: page.frame["counts"][0] == 16000)
    assert not page.frame["paused"]


def test_an_edge_pauses_at_its_nanosecond_and_a_level_that_is_so_already_does_not(bench, browser):
    """The safety relay opens when the E-stop is pressed: every browser sees the trigger and its instant."""
    here = bench(speed=50.0, ready=True)
    one, other = browser(here), browser(here)
    assert one.frame["outputs"]["power"] == 1
    one.request(trigger={"output": "power", "is": 1})
    other.until(lambda: other.frame.get("trigger"))
    assert other.frame["trigger"] == {"when": {"output": "power", "is": 1}, "hit_s": None}
    other.request(trigger={"output": "power", "is": 0})
    pressed = one.ask(set={"estop": "pressed"})
    one.until(lambda: one.frame["paused"] and one.frame["trigger"]["hit_s"] is not None)
    assert pressed["time_ns"] <= round(one.frame["trigger"]["hit_s"] * 1e9) == one.frame["time_ns"]
    assert one.frame["outputs"]["power"] == 0
    assert one.request(trigger=False)["ok"] == {"trigger": None}


@pytest.mark.parametrize("speed", [None, 50.0])
def test_a_reply_pauses_with_its_last_byte_at_the_end_of_the_move(bench, browser, speed: float | None):
    """The iMC answers `0` to a move when it is over; the explanation of the reply is `done`."""
    page = browser(bench(speed=speed, ready=True))
    begin_ns = page.ask(pause=True)["time_ns"]
    assert page.request(trigger={"replied": "DONE"})["ok"]["trigger"]["hit_s"] is None
    assert "ok" in page.request(say=MOVE)
    page.ask(resume=True)
    page.until(lambda: page.frame["trigger"] and page.frame["trigger"]["hit_s"] is not None)
    page.until(lambda: page.frame["paused"])
    assert page.frame["time_ns"] == round(page.frame["trigger"]["hit_s"] * 1e9) == replied(begin_ns, speed is not None)
    assert page.frame["counts"][0] == 16000


def test_a_message_of_before_and_of_the_other_side_does_not_pause(bench, browser):
    page = browser(bench(speed=50.0, ready=True))
    page.ask(pause=True)
    page.request(trigger={"sent": "@0A"})
    page.request(say="@0P")  # another message, and its reply
    page.ask(resume=True)
    page.until(lambda: page.frame["trigger"] and page.frame["idle"])
    assert (page.frame["trigger"]["hit_s"], page.frame["paused"]) == (None, False)
    page.request(say=MOVE)
    page.until(lambda: page.frame["paused"] and page.frame["trigger"]["hit_s"] is not None)
    assert page.frame["counts"][0] < 16000


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"level": "p9.9", "is": 1}, "p9.9"),
        ({"position": "x"}, "allowed: above, below or both"),
        ({"position": "x", "above": 1, "timeout_s": 3}, "timeout_s"),
        ({"replied": ""}, "replied"),
        ({"sent": "@0A", "is": 1}, "says nothing of sent"),
        (True, "trigger"),
    ],
)
def test_what_is_refused_leaves_the_trigger_that_is_set(bench, browser, content: object, said: str):
    page = browser(bench())
    page.request(trigger={"collision": True})
    answer = page.request(trigger=content)
    assert said in answer["error"]
    page.until(lambda: page.frame["trigger"] == {"when": {"collision": True}, "hit_s": None})
