"""Ports: terminals to input bytes, output bytes to named levels (2.2.3, 2.2.4).

Input terminals are called `p<port>.<bit>`; a terminal that is not wired reads 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from isel_twin.controller import Event, Output

_TERMINAL = re.compile(r"p([0-3])\.([0-7])")

# status inputs: name -> (port, bit). All of them fail safe: an open wire (0) is the alarm or the stricter state.
SIGNALS: Mapping[str, tuple[int, int]] = {
    "estop_1": (1, 0),
    "estop_2": (1, 1),
    "cool": (1, 2),
    "start": (1, 3),
    "stop_released": (1, 4),
    "probe": (1, 5),
    "spindle": (2, 0),
    "power_ok": (2, 1),
    "hood_automatic": (2, 5),
    "hood_setup": (2, 6),
    "setup": (2, 7),
}

_SIGNAL_AT = {place: signal for signal, place in SIGNALS.items()}

# contacts of the machine that do not have the name of their signal
CONTACTS = {"cool": "overtemperature", "stop_released": "stop", "setup": "key"}
LIMIT_PORT = 3

# where the contacts of machine and cabinet are wired to (2.2.3, 4.2.6; levels: decision wiring/1)
TERMINALS: Mapping[str, tuple[str, ...]] = {
    **{f"p{LIMIT_PORT}.{bit}": (f"limit_{'xyza'[bit // 2]}{bit % 2 + 1}",) for bit in range(8)},
    **{f"p{port}.{bit}": (CONTACTS.get(signal, signal),) for signal, (port, bit) in SIGNALS.items()},
    **{f"p0.{bit}": (f"user_{bit}",) for bit in range(8)},
}


class Inputs:
    """Levels at the input terminals, as port bytes and as named signals."""

    def __init__(self, levels: Mapping[str, bool]) -> None:
        self._ports = [0] * 4
        self.signals = dict.fromkeys(SIGNALS, False)
        """Levels of the status inputs."""
        for terminal, level in levels.items():
            self.set(terminal, level)

    def set(self, terminal: str, level: bool) -> tuple[int, int] | None:
        """Take a new level; return (port, bit) if this changes an input, else None."""
        match = _TERMINAL.fullmatch(terminal)
        if match is None:
            return None
        port, bit = int(match[1]), int(match[2])
        if bool(self._ports[port] >> bit & 1) == level:
            return None
        self._ports[port] ^= 1 << bit
        if (signal := _SIGNAL_AT.get((port, bit))) is not None:
            self.signals[signal] = level
        return port, bit

    def port(self, number: int) -> int:
        return self._ports[number]

    def bit(self, port: int, bit: int) -> bool:
        return bool(self._ports[port] >> bit & 1)

    def __getitem__(self, signal: str) -> bool:
        return self.signals[signal]


@dataclass(frozen=True)
class OutputPort:
    """Outputs of its bits, lowest first (None: not connected); byte: takes 0 to 255, else 0 and 1."""

    bits: tuple[str | None, ...]
    byte: bool


# output ports of 2.2.4. Ports 100 and 101 show the same outputs as 1 to 6 bit by bit.
OUTPUT_PORTS: Mapping[int, OutputPort] = {
    0: OutputPort(("user",), byte=True),
    1: OutputPort(("hood_release",), byte=False),
    2: OutputPort(("spindle",), byte=False),
    3: OutputPort(("stages",), byte=False),
    4: OutputPort(("analog",), byte=True),
    5: OutputPort(("current_lowering",), byte=False),
    6: OutputPort(("brake",), byte=False),
    100: OutputPort(
        ("current_lowering", None, "power_request", "stages", "spindle", "hood_release", "brake", "software_ok"),
        byte=True,
    ),
    101: OutputPort((None, None, None, None, None, "lamp_stop", "lamp_start", "lamp_fault"), byte=True),
}

# every output and its level after power-on or reset, before the power stages are considered (imc/23)
POWER_ON_LEVELS: Mapping[str, int] = {
    "software_ok": 1,
    **dict.fromkeys(("stages", "power_request", "brake", "spindle"), 0),
    "hood_release": 1,
    "current_lowering": 1,
    **dict.fromkeys(("analog", "user", "lamp_start", "lamp_stop", "lamp_fault", "moving", "flash_fault"), 0),
}


_event = cache(Output)  # an output has 256 levels at most


class Outputs:
    """Levels of the outputs; every change, and all levels at the first `reset`, are noted in `events`."""

    def __init__(self, events: list[Event]) -> None:
        self._events = events
        self._levels: dict[str, int] = {}

    def reset(self) -> None:
        for name, value in POWER_ON_LEVELS.items():
            self[name] = value

    def __getitem__(self, name: str) -> int:
        return self._levels[name]

    def __setitem__(self, name: str, value: int) -> None:
        if self._levels.get(name) != value:
            self._levels[name] = value
            self._events.append(_event(name, value))

    def read(self, number: int) -> int:
        bits = OUTPUT_PORTS[number].bits
        if len(bits) == 1 and bits[0] is not None:
            return self[bits[0]]
        return sum(self[name] << bit for bit, name in enumerate(bits) if name is not None)

    def levels_for(self, number: int, value: int) -> dict[str, int]:
        """Outputs that writing a value to a port sets, and their new levels."""
        bits = OUTPUT_PORTS[number].bits
        if len(bits) == 1 and bits[0] is not None:
            return {bits[0]: value}
        return {name: value >> bit & 1 for bit, name in enumerate(bits) if name is not None}
