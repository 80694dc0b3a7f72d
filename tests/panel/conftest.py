"""Served twins with a panel, in threads of this process."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser as Chromium
from playwright.sync_api import Page, ViewportSize, expect, sync_playwright
from websockets.sync.client import ClientConnection, connect

from isel_twin import Twin
from isel_twin.bridge.operate.panel.guest import Panel
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint
from tests.forked import PATIENCE_S
from tests.panel.chromium import ARGUMENTS, MISSING, find_browser

LOOPBACK = "127.0.0.1:0"
WAIT_S = PATIENCE_S
"""Longest wait for anything; a healthy panel needs a small part of it."""
VIEWPORT: ViewportSize = {"width": 1280, "height": 800}


class Bench:
    """A served twin with a panel; `ready`: its host has made the reference run before anything else."""

    def __init__(
        self,
        speed: float | None = None,
        controller: str = "imc-s8",
        ready: bool = False,
        address: str = LOOPBACK,
        token: str | None = None,
        machine: str = "4030",
        plant: str = "kinematic",
        scenario: Path | None = None,
        look: Callable[[Twin], None] | None = None,
        paused: bool = False,
    ) -> None:
        """look: called each 10 ms of virtual time; paused: time goes on when it is asked to."""
        self.panel = Panel(address, token)
        self.line = TcpEndpoint(LOOPBACK)
        self.twin = Twin(machine, controller, plant=plant, line_speed=speed is not None, scenario=scenario)
        if ready:
            assert self.twin.language is not None
            for data in self.twin.language.reference():
                self.twin.write(data)
                assert self.twin.run_until_idle()
                assert self.twin.language.accepted(data, self.twin.read())
        self.server = Server(
            self.twin, Pacer(speed, self.twin.time_ns), [self.line], self.panel.monitor, guests=[self.panel]
        )
        if paused:
            self.server.pacer.pause(self.twin.time_ns)
        if look is not None:
            self.twin.observe(look, 10_000_000)
        self.thread = threading.Thread(target=self.server.run, daemon=True)
        self.thread.start()

    @property
    def port(self) -> int:
        return int(self.panel.address.rpartition(":")[2])

    def close(self) -> None:
        self.server.stop()
        self.thread.join(WAIT_S)
        assert not self.thread.is_alive()


class Browser:
    """What a page does, without one."""

    def __init__(self, bench: Bench, **headers: str) -> None:
        self.socket: ClientConnection = connect(
            f"ws://127.0.0.1:{bench.port}/operate", additional_headers=headers, max_size=None
        )
        self.frame: dict[str, Any] = {}
        self.lines: list[dict[str, Any]] = []
        self.plots: list[list[Any]] = []
        self.answers: dict[Any, dict[str, Any]] = {}
        self.about: dict[str, Any] = self.hear()["about"]
        self._number = 0
        self.until(lambda: self.frame)

    def hear(self) -> dict[str, Any]:
        """The next message, taken in."""
        message: dict[str, Any] = json.loads(self.socket.recv(timeout=WAIT_S))
        self.frame = message.get("frame", self.frame)
        self.lines += message.get("lines", [])
        self.plots += message.get("plots", [])
        self.answers |= {answer["id"]: answer for answer in message.get("answers", [])}
        return message

    def until(self, so: Callable[[], Any]) -> None:
        """Listen until it is so."""
        begin_s = time.monotonic()
        while not so():
            self.hear()
            assert time.monotonic() < begin_s + WAIT_S, self.frame

    def request(self, **content: Any) -> dict[str, Any]:
        """Its answer, ok or not."""
        self._number += 1
        self.socket.send(json.dumps({"id": self._number, **content}))
        self.until(lambda: self._number in self.answers)
        return {key: value for key, value in self.answers.pop(self._number).items() if key != "id"}

    def ask(self, **action: Any) -> Any:
        answer = self.request(ask=action)
        assert answer.keys() == {"ok"}, answer
        return answer["ok"]

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    """bench(...) starts one."""
    running: list[Bench] = []

    def start(*args: Any, **kwargs: Any) -> Bench:
        running.append(Bench(*args, **kwargs))
        return running[-1]

    yield start
    for one in running:
        one.close()


@pytest.fixture
def browser() -> Iterator[Callable[..., Browser]]:
    """browser(bench) opens the panel."""
    opened: list[Browser] = []

    def start(bench: Bench, **headers: str) -> Browser:
        opened.append(Browser(bench, **headers))
        return opened[-1]

    yield start
    for one in opened:
        one.close()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Chromium]:
    """For one file of tests: its event loop runs in this thread, where others want one of their own."""
    if find_browser() is None:
        pytest.skip(MISSING)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_browser(), args=list(ARGUMENTS))
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def window(chromium: Chromium) -> Iterator[Page]:
    """A page that all tests of a file show theirs in: a new one for each costs as much as what is in it."""
    context = chromium.new_context(viewport=VIEWPORT)
    context.set_default_timeout(WAIT_S * 1000)
    expect.set_options(timeout=WAIT_S * 1000)
    yield context.new_page()
    context.close()


@pytest.fixture
def empty_page(window: Page) -> Iterator[Page]:
    """It, empty, of the usual size, alone and without cookies."""
    window.set_viewport_size(VIEWPORT)
    yield window
    for page in window.context.pages:
        if page is not window:
            page.close()
    window.unroute_all()
    window.goto("about:blank")
    window.context.clear_cookies()
