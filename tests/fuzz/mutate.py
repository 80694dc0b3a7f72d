"""Mutated files, each from a seed: some bytes changed, or whole lines, words and numbers of a file that stays one of
its kind, so that a reader gets further than the first of them."""

from __future__ import annotations

import json
import random
import re
import tomllib
from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree

from isel_twin.base.toml import toml_line

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
WORD = re.compile(rb"[^\s,;=|]+")
NEAR = (b"0", b"-0", b"1", b"-7", b"0.001", b"1e3", b"65536", b"4294967296", b"1000000000")
ODD = (None, True, -1, 0.5, 1e308, 10**30, "", "x", "\x1b[2J\n", "<zz a='1'>", "../../x", [], {}, [[]], {"x": None})

Mutation = Callable[[bytes, int], bytes]


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


# ---- by structure --------------------------------------------------------------------------------------------------


def restructured(data: bytes, seed: int, head: int = 0) -> bytes:
    """The data with one to four changes of lines, words and numbers. The first `head` lines stay."""
    draw = random.Random(seed)
    lines = data.splitlines(keepends=True)
    kept, rest = lines[:head], lines[head:]
    for _ in range(draw.randint(1, 4)):
        rest = draw.choice(_OF_LINES)(rest, draw) if rest else rest
    return b"".join((*kept, *rest))


def renumbered(data: bytes, seed: int) -> bytes:
    """One or two numbers are other ones."""
    draw = random.Random(seed)
    for _ in range(draw.randint(1, 2)):
        data = b"".join(_number_changed([data], draw))
    return data


def in_turn(*mutations: Mutation) -> Mutation:
    """One after the other, by the seed."""
    return lambda data, seed: mutations[seed % len(mutations)](data, seed)


def below(head: int) -> Mutation:
    """Changes of structure below the first `head` lines."""
    return lambda data, seed: restructured(data, seed, head)


either = in_turn(mutated, restructured)


def _swapped(lines: list[bytes], draw: random.Random) -> list[bytes]:
    a, b = draw.randrange(len(lines)), draw.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return lines


def _doubled(lines: list[bytes], draw: random.Random) -> list[bytes]:
    at = draw.randrange(len(lines))
    return lines[: at + draw.randint(1, 8)] + lines[at:]


def _dropped(lines: list[bytes], draw: random.Random) -> list[bytes]:
    at = draw.randrange(len(lines))
    return lines[:at] + lines[at + 1 :]


def _nested(lines: list[bytes], draw: random.Random) -> list[bytes]:
    """A stretch many times, its first lines before its last ones."""
    a, b = sorted((draw.randrange(len(lines)), draw.randrange(len(lines))))
    middle, times = (a + b + 1) // 2, draw.choice((2, 3, 60))
    return lines[:a] + lines[a:middle] * times + lines[middle : b + 1] * times + lines[b + 1 :]


def _words_changed(lines: list[bytes], draw: random.Random) -> list[bytes]:
    """One word swapped with one of any line, doubled or left out."""
    at, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    words, others = list(WORD.finditer(lines[at])), list(WORD.finditer(lines[other]))
    if words and others:
        word, by = draw.choice(words), draw.choice(others)[0]
        new = draw.choice((by, b"", word[0] + b" " + by, word[0] + b" " + word[0], word[0] + by))
        lines[at] = lines[at][: word.start()] + new + lines[at][word.end() :]
    return lines


def _number_changed(lines: list[bytes], draw: random.Random) -> list[bytes]:
    """One number is another one of the file, or one at a border."""
    at = draw.randrange(len(lines))
    numbers = list(NUMBER.finditer(lines[at]))
    if numbers:
        found = draw.choice(numbers)
        new = draw.choice((*NEAR, *NUMBER.findall(lines[draw.randrange(len(lines))])))
        lines[at] = lines[at][: found.start()] + new + lines[at][found.end() :]
    return lines


_OF_LINES = (_swapped, _doubled, _dropped, _nested, _words_changed, _words_changed, *[_number_changed] * 3)


def reshaped(data: bytes, seed: int) -> bytes:
    """JSON with one to four values swapped, doubled, left out, nested or made odd."""
    draw, tree = random.Random(seed), [json.loads(data)]
    for _ in range(draw.randint(1, 4)):
        _reshape(tree, draw)
    return json.dumps(tree[0]).encode()


def retold(data: bytes, seed: int) -> bytes:
    """TOML with one to four values changed in the same way: it stays TOML."""
    draw = random.Random(seed)
    tree: list[Any] = [tomllib.loads(data.decode())]
    for _ in range(draw.randint(1, 4)):
        _reshape(tree, draw, [value for value in ODD if value is not None and value != {"x": None}])
    table = tree[0] if isinstance(tree[0], dict) else {"x": tree[0]}
    return "".join(f"{toml_line(key, value)}\n" for key, value in table.items()).encode("utf-8", "replace")


def _reshape(tree: list[Any], draw: random.Random, odd: Sequence[Any] = ODD) -> None:
    places: list[tuple[Any, Any]] = []
    waiting: list[Any] = [tree]
    while waiting:
        each = waiting.pop()
        inner = list(each.items() if isinstance(each, dict) else enumerate(each))
        places += [(each, key) for key, _ in inner]
        waiting += [value for _, value in inner if isinstance(value, dict | list)]
    each, key = draw.choice(places)
    other, at = draw.choice(places)
    match draw.randrange(6):
        case 0:
            each[key] = draw.choice(odd)
        case 1 if each is not tree:
            del each[key]
        case 2:
            each[key] = json.loads(json.dumps(other[at]))
        case 3:
            each[key] = [each[key]] * draw.choice((1, 2, 50))
        case 4 if isinstance(each, dict):
            each[str(draw.choice(ODD))] = each[key]
        case _ if isinstance(each[key], int | float):
            each[key] = draw.choice((0, -1, 1, 2**31, 2**63, 1e-300, -each[key], each[key] * 10, each[key] + 1))
        case _:
            each[key] = {"x": each[key]}


def replanted(data: bytes, seed: int) -> bytes:
    """XML with one to four elements or attributes moved, doubled, left out, or with other words."""
    draw, root = random.Random(seed), ElementTree.fromstring(data)
    for _ in range(draw.randint(1, 4)):
        every = list(root.iter())
        parent, one = draw.choice([(parent, child) for parent in every for child in parent] or [(root, root)])
        key = draw.choice([*one.attrib, ""])
        match draw.randrange(6):
            case 0:
                parent.insert(0, ElementTree.fromstring(ElementTree.tostring(one)))
            case 1 if len(every) > 20 and one is not root:
                parent.remove(one)
            case 2:
                place = draw.choice([each for each in every if each.tag == parent.tag])
                place.append(
                    ElementTree.fromstring(re.sub('name="', 'name="' + place.tag, ElementTree.tostring(one, "unicode")))
                )
            case 3 if key:
                del one.attrib[key]
            case 4 if key:
                others = [each.attrib[key] for each in every if key in each.attrib]
                one.set(key, draw.choice(others))
            case _ if key:
                text = restructured(one.get(key, "").encode() + b" ", draw.randrange(1 << 30))
                one.set(key, "".join(c for c in text.decode("utf-8", "replace") if c.isprintable() or c == " "))
    return ElementTree.tostring(root)
