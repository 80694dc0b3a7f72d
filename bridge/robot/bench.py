"""The keywords. Needs the extra `robot` (robotframework)."""

from __future__ import annotations

import json
import os
import socket
import time
from typing import Any, Literal

from robot.api.deco import keyword, library

from isel_twin.base.axes import CARRIAGES
from isel_twin.bridge.operate.client import CONNECT_S, Client, ClientError
from isel_twin.bridge.operate.conditions import conditions
from isel_twin.bridge.operate.started import Started
from isel_twin.bridge.serve.tcp import parse_address
from isel_twin.language import Language, create_language
from isel_twin.version import VERSION

SILENT_S = 2.0  # a command that has no reply by then has none
ARRIVES_S = 0.05  # from one piece of a reply to the next, on this computer
CLOSED = "the twin has closed the line"
Axis = Literal["x", "y", "z"]


@library(scope="SUITE", version=VERSION, auto_keywords=False, doc_format="TEXT")
class Bench:
    """A bench with a simulated isel machine.

    `Start Twin` starts a server of its own, `Connect To Twin` takes one that runs (`isel-twin serve --control ...
    --tcp ...`). Times are virtual seconds; at speed max they cost only what has to be computed. One bench serves a
    suite; what it has started ends with it.
    """

    ROBOT_LISTENER_API_VERSION = 3

    def __init__(self) -> None:
        self.ROBOT_LIBRARY_LISTENER = self
        self._started: Started | None = None
        self._client: Client | None = None
        self._line: socket.socket | None = None
        self._language: Language | None = None

    def end_suite(self, data: Any, result: Any) -> None:
        """Of Robot's listeners: whatever the suite has left running ends."""
        self.stop_twin()

    # ---- a twin ----

    @keyword("Start Twin", tags=["twin"])
    def start_twin(
        self,
        machine: str = "4030",
        controller: str = "imc-s8",
        plant: str = "mujoco",
        seed: int = 0,
        speed: str = "max",
        *options: str,
    ) -> dict[str, Any]:
        """Start a twin in a process of its own; options: further ones of `isel-twin serve`. Returns what it prints."""
        self.stop_twin()
        call = ("--machine", machine, "--controller", controller, "--plant", plant, "--seed", str(seed))
        try:
            self._started = Started(*call, "--speed", speed, *options)
        except ClientError as error:
            raise AssertionError(str(error)) from None
        info = self._started.info
        self.connect_to_twin(info["control"], info["tcp"])
        return info

    @keyword("Connect To Twin", tags=["twin"])
    def connect_to_twin(self, control: str, tcp: str = "") -> None:
        """Take a twin that is served: the addresses that `serve` prints. Without tcp no commands can be sent.

        A token is taken from ISEL_TWIN_TOKEN."""
        self._disconnect()
        try:
            self._client = Client(control, os.environ.get("ISEL_TWIN_TOKEN") or None)
            if tcp:
                self._line = socket.create_connection(parse_address(tcp), CONNECT_S)
                self._language = create_language(self._state["controller"])
                self._arrived()  # nothing, or that somebody else has the line
        except OSError as error:
            raise AssertionError(f"{tcp}: {error.strerror or error}") from None
        except (ClientError, ValueError) as error:
            raise AssertionError(str(error)) from None

    @keyword("Stop Twin", tags=["twin"])
    def stop_twin(self) -> None:
        """Let go of the twin; one that was started here ends."""
        self._disconnect()
        started, self._started = self._started, None
        if started is not None:
            started.stop()

    # ---- the host's side ----

    @keyword("Send Command", tags=["host"])
    def send_command(self, command: str, expect: str | None = None, timeout: float = 600.0) -> str:
        """Send a line as in a job file, wait until the controller is idle, return its reply.

        Fails if the reply is not `expect`, or, without that, is a refusal. timeout: virtual seconds."""
        language, data = self._sent(command)
        reply = self._reply(timeout)
        text = language.text(reply)
        if expect is not None and text != expect:
            raise AssertionError(f"{command} is answered by {text!r}, not {expect!r}")
        if expect is None and not language.accepted(data, reply):
            raise AssertionError(f"{command} is refused: {text!r}")
        return text

    @keyword("Start Command", tags=["host"])
    def start_command(self, command: str) -> None:
        """Send a line and do not wait: the controller is at work meanwhile."""
        self._sent(command)

    # ---- the operator's side ----

    @keyword("Set Input", tags=["bench"])
    def set_input(self, name: str, state: str) -> None:
        """Operate an element of the cabinet or give a contact a fault: hood open, estop pressed, limit_x2 broken."""
        self._ask({"set": {name: state}})

    @keyword("Break", tags=["bench"])
    def break_contact(self, contact: str) -> None:
        """A wire of this contact comes off."""
        self.set_input(contact, "broken")

    @keyword("Mend", tags=["bench"])
    def mend(self, contact: str) -> None:
        """The contact is whole again."""
        self.set_input(contact, "ok")

    @keyword("Open Hood", tags=["bench"])
    def open_hood(self) -> None:
        """Unless it is locked."""
        self.set_input("hood", "open")

    @keyword("Close Hood", tags=["bench"])
    def close_hood(self) -> None:
        self.set_input("hood", "closed")

    @keyword("Press Emergency Stop", tags=["bench"])
    def press_emergency_stop(self) -> None:
        self.set_input("estop", "pressed")

    @keyword("Release Emergency Stop", tags=["bench"])
    def release_emergency_stop(self) -> None:
        self.set_input("estop", "released")

    @keyword("Let Happen", tags=["bench"])
    def let_happen(self, event: str) -> None:
        """An event of a scenario as JSON: {"force_n": {"x": 50}, "place": "tool"}."""
        try:
            self._ask(json.loads(event))
        except ValueError as error:
            raise AssertionError(f"{event}: is no JSON: {error}") from None

    # ---- time ----

    @keyword("Wait Until Idle", tags=["time"])
    def wait_until_idle(self, timeout: float = 600.0) -> None:
        """At most so many virtual seconds."""
        self._ask({"wait": {"idle": True, "timeout_s": timeout}})

    @keyword("Wait Until Position", tags=["time"])
    def wait_until_position(
        self,
        axis: Axis,
        above: float | None = None,
        below: float | None = None,
        timeout: float = 600.0,
        patience: float = 60.0,
    ) -> None:
        """Until the true position in mm, in the zero of the counters, is there; time then stands still.

        `Resume` lets it go on. timeout: virtual seconds, patience: real ones (at speed max none pass when nobody has
        anything to do)."""
        bounds = {name: value for name, value in (("above", above), ("below", below)) if value is not None}
        self._ask({"wait": {"position": axis, **bounds, "timeout_s": timeout, "wall_s": patience, "pause": True}})

    @keyword("Resume", tags=["time"])
    def resume(self) -> None:
        """Virtual time goes on."""
        self._ask({"resume": True})

    # ---- verdicts ----

    @keyword("Position Should Be", tags=["verdict"])
    def position_should_be(self, axis: Axis, mm: float, within: float = 0.05) -> None:
        """The true position in the zero of the counters."""
        there = self._state["position_mm"]["xyz".index(axis)]
        if not abs(there - mm) <= within:
            raise AssertionError(f"{axis} is at {there:.4f} mm, not at {mm:g} +- {within:g} mm")

    @keyword("Input Should Be", tags=["verdict"])
    def input_should_be(self, name: str, state: str) -> None:
        """Of an element or an end switch (free, struck)."""
        self._should("input", self._state["inputs"], name, state)

    @keyword("Output Should Be", tags=["verdict"])
    def output_should_be(self, name: str, value: int) -> None:
        """Of the controller, or a relay: power, spindle_runs."""
        self._should("output", self._state["outputs"], name, value)

    @keyword("No Step Should Be Lost", tags=["verdict"])
    def no_step_should_be_lost(self) -> None:
        """By the rule of all verdicts: half a slip of the motor is a loss, less is load angle."""
        state = self._state
        told = [text for name, text in conditions(state).items() if text and name.startswith("lost_")]
        forgotten = zip(CARRIAGES, state["forgotten_steps"], strict=False)
        told += [f"{axis} had lost {steps:.0f} steps before its counter was set" for axis, steps in forgotten if steps]
        if told:
            raise AssertionError("; ".join(told))

    @keyword("Margin Should Be At Least", tags=["verdict"])
    def margin_should_be_at_least(self, percent: float) -> None:
        """The least pull-out margin of each motor since power-on; 100: no load, 0: it may have lost steps."""
        for axis, margin in zip("xyz", self._state["margin"], strict=False):
            if margin is not None and margin * 100.0 < percent:
                raise AssertionError(f"{axis} had a margin of {margin:.1%}, less than {percent:g} %")

    @keyword("Get State", tags=["verdict"])
    def get_state(self) -> dict[str, Any]:
        """All that the control port says of the machine."""
        return self._state

    # ---- inside ----

    @property
    def _state(self) -> dict[str, Any]:
        return self._ask({"state": True})

    def _should(self, kind: str, values: dict[str, Any], name: str, wanted: Any) -> None:
        if name not in values:
            raise AssertionError(f"{kind} {name}: there is none; there are {', '.join(values)}")
        if values[name] != wanted:
            raise AssertionError(f"{kind} {name} is {values[name]}, not {wanted}")

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        if self._client is None:
            raise AssertionError("there is no twin: Start Twin, or Connect To Twin")
        try:
            return self._client.ask(request)
        except ClientError as error:
            raise AssertionError(str(error)) from None

    def _sent(self, command: str) -> tuple[Language, bytes]:
        """Send a line; the controller's language, and its bytes."""
        if self._line is None or self._language is None:
            raise AssertionError("there is no line to the controller: Connect To Twin with its tcp address")
        data = self._language.frame(command)
        try:
            self._line.settimeout(CONNECT_S)
            self._line.sendall(data)
        except OSError as error:
            raise AssertionError(f"{CLOSED}: {error.strerror or error}") from None
        return self._language, data

    def _reply(self, timeout: float) -> bytes:
        """What the controller says until it is idle. It may be so still, before the command has reached it."""
        silent = time.monotonic() + SILENT_S
        reply = self._arrived()
        while not (reply or time.monotonic() > silent):
            self.wait_until_idle(timeout)
            reply = self._arrived()
        self.wait_until_idle(timeout)
        return reply + self._arrived()

    def _arrived(self) -> bytes:
        """What has come over the line by now, and shortly after."""
        assert self._line is not None
        self._line.settimeout(ARRIVES_S)
        reply = b""
        while True:
            try:
                piece = self._line.recv(4096)
            except TimeoutError:
                return reply
            except OSError:
                piece = b""
            if not piece:
                raise AssertionError(reply.decode("latin-1").strip() or CLOSED)
            reply += piece

    def _disconnect(self) -> None:
        for part in (self._client, self._line):
            if part is not None:
                part.close()
        self._client = self._line = self._language = None
