"""Places in a TOML file that know their line, for errors that name file, line and key.

    [[event]]                           event 1
    set.hood = "open"                   event 1.set.hood
    force_n = {                         event 1.force_n
        x = 50 }                        event 1.force_n.x         found by looking for the name in the value above

A table of an array `[[name]]` has the key "name NUMBER", from 1. tomllib does not give lines, so they are searched:
headers, and keys before an equals sign. A key that is not found has the line of the nearest table or key around it;
quotes and blanks in keys and dots within quotes are ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isel_twin.base.parameters import FileError, Place, parse_toml, read_text

_HEADER = re.compile(r"\s*(\[\[?)([^\[\]=,]+)\]\]?\s*(#.*)?")
_KEY = re.compile(r"\s*([\w.\"'\- ]+?)\s*=")


@dataclass(frozen=True)
class LinePlace(Place):
    """A place in a file with this text."""

    text: str = ""

    def __str__(self) -> str:
        line = line_of(self.text.splitlines(), self.key)
        return f"{self.file}:{line}: {self.key}" if line else super().__str__()


def read_lines(file: str | Path, error: type[FileError]) -> tuple[dict[str, Any], LinePlace]:
    """The tree of a file, and its place. Raises OSError if it cannot be opened, `error` if it is not valid TOML."""
    place = LinePlace(file, error, text=read_text(Place(file, error)))
    return parse_toml(place.text, Place(file, error)), place


def line_of(lines: Sequence[str], key: str) -> int:
    """Line number of a key, or of the nearest thing around it; 0: not found."""
    path = _parts(key)
    entries = list(_entries(lines))
    if exact := [number for number, entry in entries if path and entry[: len(path)] == path]:
        return exact[0]
    around = [(number, entry) for number, entry in entries if path[: len(entry)] == entry]
    if not around:
        return 0
    at, entry = max(around, key=lambda found: len(found[1]))
    end = next((number for number, _ in entries if number > at), len(lines) + 1)
    for name in path[len(entry) :]:
        pattern = re.compile(rf"(^|[\s{{,.\[\"']){re.escape(name)}[\"']?\s*[=.\]]")
        found = next((number for number in range(at, end) if pattern.search(lines[number - 1])), None)
        if found is None:
            break
        at = found
    return at


def _entries(lines: Sequence[str]) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Headers and keys: number of the line, and all parts of the key from the top of the file."""
    table: tuple[str, ...] = ()
    counts: dict[str, int] = {}
    for number, line in enumerate(lines, 1):
        if header := _HEADER.fullmatch(line):
            first, *rest = _parts(header[2])
            if header[1] == "[[" and not rest:
                counts[first] = counts.get(first, 0) + 1
            table = (f"{first} {counts[first]}" if first in counts else first, *rest)
            yield number, table
        elif key := _KEY.match(line):
            yield number, table + _parts(key[1])


def _parts(key: str) -> tuple[str, ...]:
    return tuple(part.strip("\"' ") for part in key.split(".")) if key else ()
