"""The control cabinet: operator elements, hood, safety relay and spindle contactor, as hardware without software.

The machine loses power when a person needs it to, whatever the firmware does. A state machine with two states:

                       power_request rises, or the operator's power key,
                       and every condition to close holds
            +---------------------------------------------------+
            |                                                   v
        [ relay open ]                                    [ relay closed ]
            ^                                                   |
            +---------------------------------------------------+
                       a circuit opens: E-stop 1 or 2, over-temperature, supply off,
                       or the hood is open in automatic while axes move or the spindle runs

Conditions to close: supply on, both E-stop circuits closed, stages cool, and the hood closed or the key on setup.
The spindle contactor closes when the controller requests it while relay and hood are closed; it drops when one of the
three ends, and needs a new request.

Sources: iMC programming manual 2.2.3, 2.2.4 and section 5 (codes 9 and H); CPM operating manual ch. 5 for the
operator's side. What the manual leaves open: wiring/1, wiring/3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from isel_twin import machine
from isel_twin.controller import UnknownNameError

SIGNALS = machine.CABINETS["safety-relay"]  # contacts of the cabinet, as machine files name them
USER_INPUTS = tuple(name for name in SIGNALS if name.startswith("user_"))

# elements that can be operated from outside and their states; the first one is the state at power-on
ELEMENTS: Mapping[str, tuple[str, ...]] = {
    "hood": ("closed", "open", "forced"),
    "estop": ("released", "pressed"),
    "key": ("automatic", "setup"),
    "power": ("on", "off"),
    "start": ("up", "down"),
    "stop": ("up", "down"),
    "overtemperature": ("normal", "hot"),
    "probe": ("free", "touched"),
    **dict.fromkeys(USER_INPUTS, ("low", "high")),
}


class Cabinet(Protocol):
    """The cabinet of a machine: it is told of inputs, and shows contacts, relays and power."""

    elements: Mapping[str, tuple[str, ...]]  # what operators can set; the first state is that at power-on
    signals: tuple[str, ...]  # contacts it has

    @property
    def states(self) -> Mapping[str, str]:
        """State of each element now."""

    @property
    def powered(self) -> bool:
        """Stages and brakes have supply."""

    @property
    def relays(self) -> Mapping[str, int]:
        """Relays to show beside the controller's outputs."""

    def operate(self, element: str, state: str) -> str:
        """Operate an element; return the state it has now. Raises UnknownNameError for one that does not exist."""

    def operate_all(self, changes: Mapping[str, str]) -> None:
        """Operate elements at the same instant, without intermediate states. Raises as `operate`."""

    def output(self, name: str, value: int) -> None:
        """Take a change of a controller output; those that the cabinet does not use are ignored."""

    def sense(self, closed: Callable[[str], bool]) -> None:
        """Read contacts as they are wired: with a broken wire one is open although its element is closed."""

    def motion(self, moving: bool) -> None:
        """Tell whether a motion is being made, whatever the controller's outputs say."""

    def heat(self, hot: bool) -> None:
        """Tell whether a power stage has reached its thermal limit."""

    def touch(self, touched: bool) -> None:
        """Tell whether something touches the probe, or the plate for tool lengths."""

    def mains(self, on: bool) -> None:
        """Switch the mains; when it comes back, everything that people have not set is as at power-on."""

    def contacts(self) -> Mapping[str, bool]:
        """Closed (True) or open, for each of `signals`; the same object while nothing changes."""


class SafetyCabinet:
    """Implements `Cabinet` with a safety relay (module docstring)."""

    elements = ELEMENTS
    signals = SIGNALS

    def __init__(self) -> None:
        self.state: dict[str, str] = {name: states[0] for name, states in ELEMENTS.items()}
        self.relay = True  # safety relay: the power stages and the spindle contactor have supply
        self._outputs = {"hood_release": 1, "spindle": 0, "moving": 0, "power_request": 0}
        self._estop_closed = True
        self.stages_hot = False  # a power stage has reached its thermal limit; set by `heat`
        self.touched = False  # probe or plate
        self.spindle_runs = False  # spindle contactor on
        self._axes_move = False
        self._user = dict.fromkeys(USER_INPUTS, False)
        self._mains = True
        self._operated = 0  # counts what people have done
        self._shown: tuple[tuple[bool | int, ...], Mapping[str, bool]] = (
            (),
            {},
        )  # `contacts`, and what they follow from

    def operate(self, element: str, state: str) -> str:
        """A locked hood stays closed unless forced."""
        self.operate_all({element: state})
        return self.state[element]

    def operate_all(self, changes: Mapping[str, str]) -> None:
        for element, state in changes.items():
            if element not in ELEMENTS:
                raise UnknownNameError(f"unknown input {element!r}; there are: {', '.join(ELEMENTS)}")
            if state not in ELEMENTS[element]:
                raise UnknownNameError(
                    f"input {element!r} cannot be {state!r}; it can be: {', '.join(ELEMENTS[element])}"
                )
        for element, state in changes.items():
            if element == "hood" and state == "open" and self.locked:
                continue
            self.state[element] = "open" if state == "forced" else state
            if element in self._user:
                self._user[element] = state == "high"
        self._operated += 1
        if changes.get("power") == "on":
            self._close_relay()
        self._settle()

    def output(self, name: str, value: int) -> None:
        if name not in self._outputs:
            return
        rising = value and not self._outputs[name]
        self._outputs[name] = value
        if name == "power_request" and rising:
            self._close_relay()
        if name == "spindle" and rising:
            self.spindle_runs = self.relay and self.state["hood"] == "closed"
        if rising or name == "spindle":  # no relay opens because another output falls
            self._settle()

    def sense(self, closed: Callable[[str], bool]) -> None:
        """Both E-stop circuits must be closed as wired: a broken wire opens one without the button."""
        self._estop_closed = closed("estop_1") and closed("estop_2")
        self._settle()

    def motion(self, moving: bool) -> None:
        self._axes_move = moving
        if moving:
            self._settle()

    def heat(self, hot: bool) -> None:
        self.stages_hot = hot
        self._settle()

    def touch(self, touched: bool) -> None:
        self.touched = touched

    def mains(self, on: bool) -> None:
        """The relay closes as at power-on, if all conditions hold."""
        self._mains = on
        if on:
            self._close_relay()
        self._settle()

    @property
    def cool(self) -> bool:
        """The over-temperature contact is closed."""
        return self.state["overtemperature"] == "normal" and not self.stages_hot

    @property
    def states(self) -> Mapping[str, str]:
        """A hot stage shows as `overtemperature`, what the machine itself touches as `probe`."""
        shown = {"overtemperature": "hot"} if self.stages_hot else {}
        return self.state | shown | ({"probe": "touched"} if self.touched else {})

    @property
    def powered(self) -> bool:
        return self.relay

    @property
    def relays(self) -> Mapping[str, int]:
        """`power`: safety relay, `spindle_runs`: spindle contactor."""
        return {"power": int(self.relay), "spindle_runs": int(self.spindle_runs)}

    @property
    def locked(self) -> bool:
        """The hood lock holds: the hood is closed and the controller does not release it (wiring/2)."""
        return self.state["hood"] == "closed" and not self._outputs["hood_release"]

    def contacts(self) -> Mapping[str, bool]:
        state = (self._operated, self.stages_hot, self.spindle_runs, self.relay, self.touched)
        if state != self._shown[0]:
            self._shown = state, self._contacts()
        return self._shown[1]

    def _contacts(self) -> dict[str, bool]:
        released = self.state["estop"] == "released"
        closed = self.state["hood"] == "closed"
        setup = self.state["key"] == "setup"
        return {
            "estop_1": released,
            "estop_2": released,
            "overtemperature": self.cool,
            "start": self.state["start"] == "down",
            "stop": self.state["stop"] == "up",
            "probe": self.states["probe"] == "touched",
            "spindle": self.spindle_runs,
            "power_ok": self.relay,
            "hood_automatic": closed and not setup,
            "hood_setup": closed or setup,
            "key": setup,
            **self._user,
        }

    def _circuits_closed(self) -> bool:
        return self._mains and self.state["power"] == "on" and self._estop_closed and self.cool

    def _close_relay(self) -> None:
        if self._circuits_closed() and (self.state["hood"] == "closed" or self.state["key"] == "setup"):
            self.relay = True

    def _settle(self) -> None:
        closed = self.state["hood"] == "closed"
        hood_open_in_automatic = not closed and self.state["key"] == "automatic"
        dangerous = self._axes_move or self._outputs["moving"] or self.spindle_runs
        if not self._circuits_closed() or (hood_open_in_automatic and dangerous):
            self.relay = False
        if self.spindle_runs and not (self.relay and self._outputs["spindle"] and closed):
            self.spindle_runs = False


# kinds of cabinet by the name a machine file gives
CABINETS: Mapping[str, Callable[[], Cabinet]] = {"safety-relay": SafetyCabinet}
