"""What browsers ask of a served twin, and what they are shown, over the panel's own socket."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from isel_twin import Twin
from isel_twin.bridge.operate.panel.frame import Asked
from isel_twin.bridge.operate.panel.guest import FRAMES_PER_S, SAID_BYTES, Panel
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from tests.panel.conftest import LOOPBACK, WAIT_S


def test_two_browsers_operate_one_machine_and_see_the_same(bench, browser):
    here = bench()
    one, other = browser(here), browser(here)
    assert one.ask(set={"estop": "pressed"})["inputs"] == {"estop": "pressed"}
    for each in (one, other):
        each.until(lambda each=each: each.frame.get("inputs", {}).get("estop") == "pressed")
        assert each.frame["outputs"]["power"] == 0
    other.ask(set={"limit_x2": "broken"})
    one.until(lambda: one.frame["faults"] == {"limit_x2": "broken"})
    same = ("time_ns", "counts", "inputs", "outputs", "levels", "faults")
    other.until(lambda: other.frame["faults"])
    assert {key: one.frame[key] for key in same} == {key: other.frame[key] for key in same}


@pytest.mark.parametrize("controller", ["imc-s8", "ismif"])
def test_one_page_for_every_controller(bench, browser, controller: str):
    """All that a page is built from comes from tables of the twin."""
    here = bench(controller=controller)
    page = browser(here)
    page.until(lambda: page.frame)
    assert page.about["controller"] == controller
    assert page.about["settable"] == {name: list(states) for name, states in here.twin.settable.items()}
    assert page.frame["levels"].keys() <= page.about["terminals"].keys()
    assert len(page.frame["counts"]) == len(page.about["axes"]) == len(page.frame["step_hz"])


def test_a_typed_command_goes_in_as_that_of_a_host_and_both_are_explained(bench, browser):
    page = browser(bench(ready=True))
    assert page.request(say="@0P")["ok"] == {"sent": 4}
    page.until(lambda: [line for line in page.lines if line["who"] == "twin"])
    host, twin = page.lines[-2:]
    assert (host["who"], host["text"]) == ("host", "@0P")
    assert "position" in host["means"]
    assert twin["text"].startswith("0")
    assert host["means"]
    assert twin["means"]


def test_who_types_does_not_take_the_line_from_a_host_that_holds_it(bench, browser):
    here = bench()
    page = browser(here)
    with socket.create_connection(parse_address(here.line.address), timeout=WAIT_S) as host:
        host.sendall(b"@07\r")
        assert host.recv(1) == b"0"
        assert page.request(say="@0P") == {
            "error": "request: say: a host holds the line (tcp); allowed: when it has gone"
        }
        page.until(lambda: len(page.lines) >= 2)
        assert [line["text"] for line in page.lines] == ["@07", "0"]
        page.until(lambda: page.frame["hosts"] == ["tcp"])
    page.until(lambda: page.frame["hosts"] == [])
    assert "ok" in page.request(say="@0P")


def test_what_is_typed_while_time_stands_still_is_bounded(bench, browser):
    page = browser(bench(speed=1.0))
    page.ask(pause=True)
    answers = [page.request(say="@0P\n" * 1000) for _ in range(3)]
    assert [answer.keys() for answer in answers[:1]] == [{"ok"}]
    assert "the line is full" in answers[-1]["error"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({}, "request: nothing to do; allowed: one of ask, say, job"),
        ({"say": 7}, "request: say: no text"),
        ({"say": "\u20ac"}, "request: say: "),
        ({"say": "@0P\n" * SAID_BYTES}, "bytes; allowed: up to"),
        ({"ask": {"set": {"estop": "half"}}}, "input 'estop' cannot be 'half'"),
        ({"ask": {"step": 0.1}}, "virtual time does not stand still"),
        ({"ask": [], "else": 1}, "request"),
    ],
)
def test_what_is_wrong_is_one_line_and_changes_nothing(bench, browser, content, said):
    page = browser(bench())
    before = page.ask(state=True)
    answer = page.request(**content)
    assert said in answer["error"]
    assert "\n" not in answer["error"]
    assert page.ask(state=True) == before


def test_what_is_no_request_is_told_and_the_connection_goes_on(bench, browser):
    page = browser(bench())
    for text in ("{]", "[1]", b"\xff", "[" * 60_000):
        page.answers.clear()
        page.socket.send(text)
        page.until(lambda: None in page.answers)
        assert "no JSON" in page.answers[None]["error"] or "no object" in page.answers[None]["error"]
    assert page.ask(state=True)


def test_a_wait_is_answered_when_it_is_so_and_steps_are_made_while_paused(bench, browser):
    here = bench(speed=1.0)
    page, other = browser(here), browser(here)
    stood = page.ask(pause=True)["time_ns"]
    assert page.ask(step=0.25)["time_ns"] == stood + 250_000_000
    page.until(lambda: page.frame["paused"] and page.frame["time_ns"] == stood + 250_000_000)
    other.until(lambda: other.frame["time_ns"] == page.frame["time_ns"])
    other.ask(resume=True)
    page.until(lambda: page.frame["time_ns"] > stood + 250_000_000)
    assert page.ask(speed="max")
    page.until(lambda: page.frame["speed"] == "max")


def test_a_button_that_is_held_is_let_go_when_its_browser_goes(bench, browser):
    here = bench()
    page, other = browser(here), browser(here)
    page.request(ask={"set": {"start": "down"}}, gone={"set": {"start": "up"}})
    other.until(lambda: other.frame and other.frame["inputs"]["start"] == "down")
    page.close()
    other.until(lambda: other.frame["inputs"]["start"] == "up")


def test_a_button_that_was_let_go_is_not_let_go_again_when_its_browser_goes(bench, browser):
    here = bench()
    page, other = browser(here), browser(here)
    page.request(ask={"set": {"start": "down"}}, gone={"set": {"start": "up"}})
    page.request(ask={"set": {"start": "up"}})
    other.request(ask={"set": {"start": "down"}})
    page.close()
    other.until(lambda: len(here.panel._site._browsers) == 1)
    assert other.ask(state=True)["inputs"]["start"] == "down"


def test_more_browsers_than_there_is_room_for_are_told(bench, browser):
    from isel_twin.bridge.operate.panel.site import BROWSERS

    here = bench()
    for _ in range(BROWSERS):
        browser(here)
    with pytest.raises(Exception, match="is open 16 times already"):
        browser(here)


def test_who_asks_without_end_is_let_go_and_nobody_else(bench, browser):
    from isel_twin.bridge.operate.panel.site import UNANSWERED

    here = bench()
    page, other = browser(here), browser(here)

    def without_end() -> None:
        for number in range(2 * UNANSWERED):
            page.socket.send(json.dumps({"id": number, "ask": {"wait": {"input": "hood", "is": "open"}}}))
        page.until(lambda: False)

    with pytest.raises(ConnectionClosed, match=f"more than {UNANSWERED} requests at once"):
        without_end()
    assert other.ask(set={"hood": "forced"})["inputs"] == {"hood": "open"}


def test_who_asks_as_much_as_is_allowed_at_once_is_answered(bench, browser):
    from isel_twin.bridge.operate.panel.site import UNANSWERED

    here = bench()
    page, other = browser(here), browser(here)
    for number in range(UNANSWERED):
        page.socket.send(json.dumps({"id": number, "ask": {"wait": {"input": "hood", "is": "open"}}}))
    other.ask(set={"hood": "forced"})
    page.until(lambda: page.answers.keys() == {*range(UNANSWERED)})


def test_a_browser_that_comes_later_gets_what_was_said_and_plotted(bench, browser):
    here = bench(ready=True)
    first = browser(here)
    first.request(say="@0P")
    first.until(lambda: any(line["who"] == "twin" for line in first.lines))
    said = [line["text"] for line in first.lines]
    second = browser(here)
    second.until(lambda: len(second.lines) >= len(said))
    assert [line["text"] for line in second.lines] == said


def test_what_went_over_the_line_before_anybody_looked_is_there(bench, browser):
    here = bench(ready=True)
    with socket.create_connection(parse_address(here.line.address), timeout=WAIT_S) as host:
        host.sendall(b"@0P\r")
        assert len(host.recv(19)) > 0
    page = browser(here)
    page.until(lambda: any(line["who"] == "twin" for line in page.lines))
    assert page.lines[0]["text"] == "@0P"


FRAMES = 20
"""A second of them."""


class NoSite:
    """A page that is looked at, by nobody in particular; `frames` are what it was shown."""

    def __init__(self, watched: bool) -> None:
        self.watched = watched
        self.frames: list[dict[str, object]] = []
        self.enough: Callable[[], None] = lambda: None
        """Called once it was shown FRAMES."""

    def start(self, about: object, machine: object, recording: object) -> None: ...
    def show(self, frame: dict[str, object]) -> None:
        self.frames.append(frame)
        if len(self.frames) == FRAMES:
            self.enough()

    def answer(self, client: int, answer: object) -> None: ...
    def close(self) -> None: ...


def test_its_end_ends_all_waits_and_the_page():
    """And it may end before there is a server, and again."""
    answers, closed = [], []

    class Site(NoSite):
        def answer(self, client: int, answer: object) -> None:
            answers.append((client, answer))

        def close(self) -> None:
            closed.append(True)

    panel = Panel(LOOPBACK, site=Site(False))
    panel.close()
    panel.attach(Server(Twin(plant="kinematic"), Pacer(1.0), []))
    panel.take(Asked(3, {"id": 7, "ask": {"wait": {"time": 1000}}}))
    panel.look()
    assert (answers, closed) == ([], [True])
    panel.close()
    panel.close()
    assert answers == [(3, {"id": 7, "error": "wait: the server stops"})]
    assert closed == [True] * 3


def session(site: NoSite | None, speed: float | None) -> tuple[bytes, np.ndarray, int, int]:
    """Replies, stream and times of a session of a host, with a panel that is looked at, one that is not, or none."""
    panel = None if site is None else Panel(LOOPBACK, site=site)
    line = TcpEndpoint(LOOPBACK)
    twin = Twin(plant="kinematic", line_speed=speed is not None)
    replies = bytearray()
    server = Server(
        twin,
        Pacer(speed),
        [line],
        None if panel is None else panel.monitor,
        guests=[] if panel is None else [panel],
    )

    def host() -> None:
        with socket.create_connection(parse_address(line.address), timeout=WAIT_S) as port:
            for command, size in ((b"@07\r", 1), (b"@0R7\r", 1), (b"@0A 900,9000,500,5000,0,1000,0,1000\r", 1)):
                port.sendall(command)
                while size:
                    data = port.recv(size)
                    replies.extend(data)
                    size -= len(data)
        server.stop()

    thread = threading.Thread(target=host)
    thread.start()
    server.run()
    thread.join(WAIT_S)
    steps = twin.steps
    return bytes(replies), np.asarray(steps.delta), twin.time_ns, len(steps)


def test_a_panel_that_is_looked_at_changes_nothing():
    """Same replies, same stream, same virtual time at `max`, where nothing but the machine takes time."""
    watched, unwatched = NoSite(True), NoSite(False)
    bare = session(None, None)
    for site in (watched, unwatched):
        seen = session(site, None)
        assert seen[0] == bare[0] == b"000"
        assert (seen[1] == bare[1]).all()
        assert seen[2:] == bare[2:]
    assert watched.frames
    assert not unwatched.frames


def test_there_are_no_more_frames_than_twenty_in_a_second():
    site = NoSite(True)
    panel = Panel(LOOPBACK, site=site)
    twin = Twin(plant="kinematic")
    server = Server(twin, Pacer(1.0), [], panel.monitor, guests=[panel])
    site.enough = server.stop
    began = time.monotonic()
    server.run()
    took_s = time.monotonic() - began
    assert FRAMES <= len(site.frames) <= math.ceil(took_s * FRAMES_PER_S) + 1
    assert panel.wait_s() is not None


def test_it_stays_usable_while_the_machine_runs_at_max(bench, browser):
    """A host that never lets the line rest: frames come, requests are answered, what is pressed stops the machine."""
    here = bench(ready=True)
    page = browser(here)
    stop, replies = threading.Event(), []

    def host() -> None:
        with socket.create_connection(parse_address(here.line.address), timeout=WAIT_S) as port:
            while not stop.is_set():
                for way in (20_000, -20_000):
                    port.sendall(f"@0A {way},2000,0,800,0,800,0,800\r".encode())
                    replies.append(port.recv(1))

    thread = threading.Thread(target=host)
    thread.start()
    try:
        seen: set[int] = set()
        while len(seen) < 20:
            page.hear()
            seen.add(page.frame["time_ns"])
        assert max(seen) - min(seen) > 20_000_000_000  # of virtual time, which flies
        assert page.ask(state=True)["counts"][0] in range(20_001)
        page.ask(set={"estop": "pressed"})
        page.until(lambda: page.frame["outputs"]["power"] == 0 and page.frame["counts"] == here.twin.counts.tolist())
    finally:
        stop.set()
        thread.join(WAIT_S)
    assert b"0" in replies
    assert replies[-1] != b"0"
