"""Moves by hand and held jobs, in the words of every controller's language; places from the scale of the counters."""

from __future__ import annotations

import pytest

from isel_twin.bridge.operate.panel import desk as desk_module
from isel_twin.language import create_language

pytestmark = pytest.mark.long(seconds=5)

CONTROLLERS = [("imc-s8", "4030"), ("ismif", "4030"), ("gmi99", "4030-servo"), ("bwo900", "4030-servo")]


def done(page) -> dict:
    """The desk when nothing moves any more."""
    taken = page.request(desk={"hold": True})["ok"]["taken"]
    page.until(lambda: page.frame["desk"]["taken"] == taken and not page.frame["desk"]["doing"])
    return page.frame["desk"]


def counted(here) -> list[float]:
    """Counters in mm, to a micrometre: half a step of the finest is less, one of the coarsest more."""
    return [round(mm, 4) for mm in (here.twin.counts[:3] * here.twin.step_mm[:3]).tolist()]


def desk(page, **act) -> dict:
    answer = page.request(desk=act)
    assert answer.keys() == {"ok"}, answer
    return answer["ok"]


@pytest.mark.parametrize(("controller", "machine"), CONTROLLERS)
def test_home_steps_zero_and_a_place_of_the_workpiece(bench, browser, controller: str, machine: str) -> None:
    """Five clicks at once are five steps. Z of the workpiece grows upwards, the counter downwards."""
    here = bench(controller=controller, machine=machine)
    page = browser(here)
    desk(page, home=True)
    assert done(page)["why"] == ""
    for _ in range(5):
        desk(page, jog={"axis": "x", "mm": 1.0, "mm_s": 20})
    desk(page, jog={"axis": "z", "mm": 8.0})
    assert done(page)["why"] == ""
    assert counted(here) == [5.0, 0.0, 8.0]
    shown = desk(page, zero={"x": 0, "y": 0, "z": 2})
    assert shown["work_mm"] == pytest.approx([0, 0, 2])
    desk(page, go={"x": 10, "y": 4, "z": 5}, mm_s=30)
    shown = done(page)
    assert shown["work_mm"] == pytest.approx([10, 4, 5], abs=1e-9)
    assert counted(here) == [15.0, 4.0, 5.0]


@pytest.mark.parametrize(("controller", "machine"), CONTROLLERS)
def test_a_jog_goes_on_until_its_key_is_let_go(bench, browser, controller: str, machine: str) -> None:
    """And the machine can be moved again, from where it stands."""
    here = bench(speed=5.0, controller=controller, machine=machine, ready=True)
    page = browser(here)
    desk(page, jog={"axis": "x", "way": 1, "mm_s": 20})
    page.until(lambda: page.frame["desk"]["work_mm"][0] > 2.0)
    desk(page, stop=True)
    assert done(page)["why"] == ""
    page.until(lambda: page.frame["idle"])
    stood = counted(here)[0]
    assert 2.0 < stood < 300.0
    desk(page, jog={"axis": "x", "mm": -1})
    assert done(page)["why"] == ""
    assert counted(here)[0] == pytest.approx(stood - 1.0, abs=2e-4)


def test_a_key_of_which_nothing_more_is_heard_is_let_go(bench, browser, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk_module, "HELD_S", 0.05)
    here = bench(speed=2.0, ready=True)
    page = browser(here)
    desk(page, jog={"axis": "y", "way": 1, "mm_s": 5})
    assert done(page)["why"] == ""
    page.until(lambda: page.frame["idle"])
    assert counted(here)[1] < 100.0


def test_the_emergency_stop_ends_a_jog_and_the_desk_says_why(bench, browser) -> None:
    here = bench(speed=2.0, ready=True)
    page = browser(here)
    desk(page, jog={"axis": "x", "way": 1, "mm_s": 5})
    desk(page, jog={"axis": "y", "mm": 5})
    page.until(lambda: page.frame["desk"]["work_mm"][0] > 0.2)
    page.ask(set={"estop": "pressed"})
    shown = done(page)
    assert "safety chain open" in shown["why"]
    assert shown["waiting"] == 0, "what waited behind it is forgotten"
    assert "safety chain" in (desk(page, jog={"axis": "x", "mm": 1}) and done(page))["why"]


@pytest.mark.parametrize(
    ("act", "why"),
    [
        ({"jog": {"axis": "a", "mm": 1}}, "desk.jog.axis: 'a'; allowed: x, y, z"),
        ({"jog": {"axis": "x"}}, "desk.jog: how far?"),
        ({"jog": {"axis": "x", "mm": 1, "way": 1}}, "desk.jog: how far?"),
        ({"jog": {"axis": "x", "way": 2}}, "desk.jog.way: 2; allowed: 1, -1"),
        ({"jog": {"axis": "x", "way": 1}}, "speed max; allowed: steps"),
        ({"jog": {"axis": "x", "mm": "far"}}, "desk.jog.mm: "),
        ({"jog": {"axis": "x", "mm": 1, "mm_s": 0}}, "desk.jog.mm_s: "),
        ({"go": {}}, "desk.go: no axis"),
        ({"go": {"x": 1}, "home": True}, "allowed: one of home, jog"),
        ({"zero": {"q": 1}}, "desk.zero: 'q'"),
        ({"home": 1}, "desk.home: 1; allowed: true"),
        (5, "request: desk: "),
    ],
)
def test_a_wrong_request_is_one_line_and_changes_nothing(bench, browser, act, why: str) -> None:
    here = bench(ready=True)
    page = browser(here)
    before = page.frame["desk"]
    assert why in page.request(desk=act)["error"]
    assert page.request(desk={"stop": True})["ok"] == before
    assert counted(here) == [0.0, 0.0, 0.0]


def test_job_desk_and_typist_do_not_speak_at_once(bench, browser) -> None:
    page = browser(bench(speed=1.0, ready=True))
    page.request(job={"open": {"name": "job.txt", "text": "@0A6400,1600,0,30,0,30,0,30\n"}})
    desk(page, jog={"axis": "x", "way": 1, "mm_s": 5})
    assert "at work" in page.request(job={"start": True})["error"]
    assert "moved by hand" in page.request(say="@0P")["error"]
    desk(page, stop=True)
    done(page)
    page.until(lambda: page.frame["idle"])
    page.request(job={"start": True})
    page.until(lambda: page.frame["job"]["state"] == "running")
    assert "a job is running" in page.request(desk={"jog": {"axis": "x", "mm": 1}})["error"]
    page.request(job={"stop": True})


def test_a_cam_file_begins_at_the_zero_that_was_set_at_the_desk(bench, browser) -> None:
    """Also if it was opened before."""
    here = bench(ready=True)
    page = browser(here)
    page.request(job={"open": {"name": "part.nc", "text": "G21 G90\nG0 X5 Y4\nM2\n"}})
    desk(page, jog={"axis": "x", "mm": 20})
    done(page)
    desk(page, zero={"x": 0})
    page.request(job={"start": True})
    page.until(lambda: page.frame["job"]["state"] == "done")
    assert counted(here)[:2] == [25.0, 4.0]


HELD = {
    "imc-s8": "@0A16000,3200,0,30,0,30,0,30\n",
    "ismif": "#E0,800\nL0,X4000<1>\n",
    "bwo900": "P1\nN10 G90 G1 X50 F600\nN20 M30\n",
}


@pytest.mark.parametrize("controller", HELD)
def test_a_job_is_held_gone_on_with_and_held_and_given_up(bench, browser, controller: str) -> None:
    """50 mm: it stands still between, ends where it should, and after a stop nothing is left of it. Its 5 s are slow
    enough for a pause that a busy computer sends late."""
    here = bench(
        speed=2.0, controller=controller, machine="4030-servo" if controller == "bwo900" else "4030", ready=True
    )
    page = browser(here)
    page.request(job={"open": {"name": "part", "text": HELD[controller]}})

    def held() -> float:
        assert page.request(job={"start": True}).keys() == {"ok"}
        page.until(lambda: (job := page.frame["job"]).get("state") == "running" and job["made"] == job["commands"] - 1)
        page.until(lambda: page.frame["step_hz"][0] > 100)
        while page.request(job={"pause": True}).get("error"):  # a program may still be on the line
            page.hear()
        page.until(lambda: page.frame["job"]["state"] == "paused")
        return counted(here)[0]

    stood = held()
    time_s = page.frame["time_s"]
    page.until(lambda: page.frame["time_s"] > time_s + 0.5)
    assert 0.0 < counted(here)[0] == stood < 50.0
    assert "it is not running" in page.request(job={"pause": True})["error"]
    page.request(job={"go_on": True})
    page.until(lambda: page.frame["job"]["state"] not in ("paused", "running"))
    assert page.frame["job"]["state"] == "done", page.frame["job"]
    assert counted(here)[0] == 50.0
    if controller != "bwo900":  # a program begins with a reference run
        desk(page, go={"x": 0})
        done(page)
    held()
    page.request(job={"stop": True})
    page.until(lambda: page.frame["idle"])
    desk(page, go={"x": 1})
    assert done(page)["why"] == ""
    assert counted(here)[0] == 1.0


def test_one_line_of_the_file_at_a_time(bench, browser) -> None:
    """All commands of a line of a CAM file belong to it."""
    here = bench(ready=True)
    page = browser(here)
    page.request(job={"open": {"name": "part.nc", "text": "G21 G90 F600\nG1 X5\nG1 Y4\nM2\n"}})
    seen, made = [], 0
    while page.frame["job"].get("state") != "done":
        page.request(job={"line": True})
        page.until(lambda: (job := page.frame["job"]).get("made", 0) > made and job["state"] in ("paused", "done"))  # noqa: B023
        made = page.frame["job"]["made"]
        seen.append(tuple(counted(here)[:2]))
        assert len(seen) < 10
    assert [place for i, place in enumerate(seen) if place not in seen[:i]] == [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0)]


def test_a_controller_that_cannot_hold_pauses_behind_the_line(bench, browser) -> None:
    here = bench(speed=5.0, controller="gmi99", machine="4030-servo", ready=True)
    page = browser(here)
    assert page.about["desk"]["pauses"] == "after the line"
    page.request(job={"open": {"name": "job.txt", "text": "f20000\n87h 20000 0 0\n87h 0 0 0\n"}})
    page.request(job={"start": True})
    page.until(lambda: page.frame["step_hz"][0] > 0)
    page.request(job={"pause": True})
    page.until(lambda: page.frame["job"]["state"] == "paused")
    page.until(lambda: page.frame["idle"])
    assert counted(here)[0] == 20.0
    page.request(job={"go_on": True})
    page.until(lambda: page.frame["job"]["state"] == "done")
    assert counted(here)[0] == 0.0


def test_every_language_that_holds_says_what_is_held() -> None:
    """2.2.31 of the iMC: the stopped command is answered F; 6.17 of the iSMIF: the job does not tell its end."""
    imc, ismif = create_language("imc-s8"), create_language("ismif")
    assert [imc.held(reply) for reply in (b"F", b"0", b"")] == [True, False, False]
    assert [ismif.held(reply) for reply in (b"\r\r", b"\r\x02\r")] == [True, False]
