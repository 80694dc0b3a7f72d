"""Random strings to every controller: bytes, text, commands, most of them spoilt, at random times. Nothing may raise.

    python -m tests.reliability.strings 1000000          # so many strings a controller, all drawn from one seed each

A string goes to the firmware as the clock of a twin would bring it (never past `next_ns`), now and then together with a
level that changes, and to the controller's language, which must give out every byte again. Now and then the controller
is reset and made ready, and contacts put right, so that it does not wait for ever; an exception, which is shown,
counts, and a fresh controller goes on.
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent))  # as under pytest

import numpy as np
from golden.random_sessions import Draw, chance, pick, spoil
from hunt.host import Dialect, dialect_of

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import Controller, Reply, create_controller
from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed
from tests.reliability.figures import Figure, main

NUMBER = 1_000_000
CONTROLLERS = ("imc-s8", "imc-m", "imc-mp", "c142", "ismif")
A_RESET = 1000
"""Strings from one reset to the next."""
A_RIGHT = 100
"""Strings after which all contacts are as they should be."""
MOST_CALLS = 50
"""Calls of a controller between two strings, after which the next one comes without waiting for its time."""
ENDS = (b"\r", b"\r", b"\r", b"\r\n", b"\x01", b"")
BYTES = np.arange(256, dtype=np.uint8)
PRINTED = np.frombuffer(b"@#$0123456789,-+ ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz@@00,,", dtype=np.uint8)


class Subject:
    """One controller, its language, and what is told to both."""

    def __init__(self, name: str) -> None:
        self.language = needed(create_language(name), name)
        self.talk = {True: bytearray(), False: bytearray()}
        """What has gone over the line, sent and received, and not come out of the language yet."""
        self.controller: Controller = create_controller(name)
        self.calm = dict(Twin(controller=name, plant="kinematic").levels)
        """Levels of a machine that is ready."""
        self.levels = dict(self.calm)
        self.t_ns = 0
        self.controller.power_on(0, self.levels)
        self._take()

    def send(self, data: bytes) -> None:
        self._hear(data, sent=True)
        self.controller.receive(self.t_ns, data)
        self._take()

    def toggle(self, terminal: str) -> None:
        self.levels[terminal] = not self.levels[terminal]
        self.controller.set_input(self.t_ns, terminal, self.levels[terminal])
        self._take()

    def put_right(self) -> None:
        """Everybody takes their hands off."""
        for terminal, level in self.calm.items():
            if self.levels[terminal] != level:
                self.toggle(terminal)

    def wait(self, duration_ns: int) -> None:
        """Let time pass, but stop after MOST_CALLS calls."""
        until_ns = self.t_ns + duration_ns
        for _ in range(MOST_CALLS):
            next_ns = self.controller.next_ns
            self.t_ns = until_ns if next_ns is None else min(max(next_ns, self.t_ns), until_ns)
            self.controller.advance(self.t_ns)
            self._take()
            if self.t_ns >= until_ns:
                return

    def _take(self) -> None:
        for event in self.controller.take():
            if isinstance(event, Reply):
                self._hear(event.data, sent=False)

    def _hear(self, data: bytes, *, sent: bool) -> None:
        """The language may keep bytes for later, and neither lose nor change any."""
        talk = self.talk[sent]
        talk += data
        out = b"".join(message.data for message in self.language.messages(data, sent))
        if bytes(talk) != out + self.language.rest(sent):
            raise AssertionError(f"the language has made {out + self.language.rest(sent)!r} of {bytes(talk)!r}")
        del talk[: len(out)]


def string(draw: Draw, dialect: Dialect) -> bytes:
    """Any bytes, any text, or a command, mostly with something wrong about it; mostly with an end."""
    kind, end = int(draw.integers(7)), pick(draw, ENDS)
    if kind >= 4:
        line = dialect.line(draw)
        return (line if kind == 6 else spoil(draw, line)).encode("latin-1", "replace") + bytes(end)
    letters = PRINTED if kind % 2 else BYTES
    length = int(draw.integers(1, pick(draw, (4, 12, 40, 300))))
    return letters[draw.integers(0, len(letters), length)].tobytes() + bytes(end)


def raised(name: str, number: int) -> int:
    """Exceptions in so many strings to a controller; each is shown."""
    draw = np.random.default_rng([*name.encode()])
    dialect, subject, count = dialect_of(name), Subject(name), 0
    terminals = sorted(subject.levels)
    for at in range(number):
        data = string(draw, dialect)
        terminal = pick(draw, terminals) if chance(draw, 0.02) else None
        if at % A_RESET == 0:
            data = dialect.reset
        elif chance(draw, 0.02):
            data = dialect.ready
        try:
            if at % A_RIGHT == 0:
                subject.put_right()
            subject.send(data)
            if terminal is not None:
                subject.toggle(terminal)
            subject.wait(int(10.0 ** draw.uniform(0.0, 9.0)) if chance(draw, 0.5) else MILLISECOND_NS)
        except Exception:
            print(f"{name}, string {at}: {data!r}\n{traceback.format_exc()}", file=sys.stderr)
            subject, count = Subject(name), count + 1
    return count


def measure(number: int = NUMBER) -> list[Figure]:
    """Exceptions, by controller."""
    return [
        Figure(f"exceptions in {number} random strings to {name}", raised(name, number), "", 0.0)
        for name in CONTROLLERS
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
