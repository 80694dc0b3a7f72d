"""Parts for languages of text."""

from __future__ import annotations

import operator
from collections.abc import Sequence

from isel_twin.language.language import LanguageError


def encoded(text: str) -> bytes:
    """One byte a character (Latin-1). Raises LanguageError for a character that has none."""
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise LanguageError(f"{text[error.start]!r} is not a character a serial line can carry") from None


_READABLE = tuple(chr(byte) if 32 <= byte < 127 and byte != ord("<") else f"<{byte}>" for byte in range(256))


def readable(data: bytes) -> str:
    """Bytes as a job file has them: printable ASCII as it is, any other byte as its number, <13>."""
    return "".join(map(_READABLE.__getitem__, data))


def integers(values: Sequence[int], count: int) -> list[int]:
    """`count` plain whole numbers, for a target. Raises LanguageError for anything else."""
    try:
        numbers = [operator.index(value) for value in values]
    except TypeError:
        numbers = []
    if len(numbers) != count:
        raise LanguageError(f"the target is {values!r}; give {count} whole numbers, the counters to move to")
    return numbers


class Pieces:
    """Cuts the bytes of one direction into pieces as they come.

    A piece ends with one of the bytes `ends`. A byte of `alone` is a piece by itself, wherever it stands, and cuts off
    what has come before it. So does a length of `longest` bytes, so that memory is bounded whatever comes.
    """

    def __init__(self, ends: bytes, alone: bytes = b"", longest: int = 4096) -> None:
        self._ends = ends
        self._alone = alone
        self._longest = longest
        self._rest = bytearray()

    @property
    def rest(self) -> bytes:
        return bytes(self._rest)

    def cut(self, data: bytes) -> list[bytes]:
        pieces = []
        for byte in data:
            if byte in self._alone and self._rest:
                pieces.append(self._take())
            self._rest.append(byte)
            if byte in self._ends or byte in self._alone or len(self._rest) >= self._longest:
                pieces.append(self._take())
        return pieces

    def _take(self) -> bytes:
        piece = bytes(self._rest)
        self._rest.clear()
        return piece
