"""Mutated files: one or several changes of bytes, each from a seed."""

from __future__ import annotations

import random
import re

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
NUMBERS = (
    b"0",
    b"-1",
    b"1e308",
    b"-1e308",
    b"nan",
    b"inf",
    b"99999999999999999999",
    b"1.5",
    b"true",
    b'"x"',
    b"[]",
    b"{}",
)
TOKENS = (
    b"[[",
    b"{",
    b'"',
    b"'",
    b"\n",
    b"\r",
    b"\x00",
    b"\xff",
    b"=",
    b"[" * 3000,
    b"# ",
    b"../../x",
    b"=> ",
    b"<",
    b"%",
)


def mutated(data: bytes, seed: int) -> bytes:
    """The data with one to four changes."""
    draw = random.Random(seed)
    for _ in range(draw.randint(1, 4)):
        data = draw.choice(_CHANGES)(data, draw)
    return data


def _flipped(data: bytes, draw: random.Random) -> bytes:
    at = draw.randrange(len(data) + 1)
    return data[:at] + bytes([byte ^ (1 << draw.randrange(8)) for byte in data[at : at + 1]]) + data[at + 1 :]


def _cut(data: bytes, draw: random.Random) -> bytes:
    return data[: draw.randrange(len(data) + 1)]


def _left_out(data: bytes, draw: random.Random) -> bytes:
    at = draw.randrange(len(data) + 1)
    return data[:at] + data[at + draw.randint(1, 64) :]


def _twice(data: bytes, draw: random.Random) -> bytes:
    at, size = draw.randrange(len(data) + 1), draw.randint(1, 256)
    return data[: at + size] + data[at : at + size] + data[at + size :]


def _told(data: bytes, draw: random.Random) -> bytes:
    at = draw.randrange(len(data) + 1)
    return data[:at] + draw.choice(TOKENS) + data[at:]


def _renumbered(data: bytes, draw: random.Random) -> bytes:
    numbers = list(NUMBER.finditer(data))
    if not numbers:
        return _told(data, draw)
    found = draw.choice(numbers)
    return data[: found.start()] + draw.choice(NUMBERS) + data[found.end() :]


_CHANGES = (_flipped, _cut, _left_out, _twice, _told, _renumbered, _renumbered)
