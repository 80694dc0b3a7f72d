"""The library as an object whose attributes are its functions; loaded when the first of them is asked for."""

from __future__ import annotations

import ctypes
import functools
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import compiling

_NUMBERS = {"int64_t": ctypes.c_int64, "double": ctypes.c_double}
_ELEMENTS: dict[str, np.dtype[Any]] = {
    "int8_t": np.dtype(np.int8),
    "uint8_t": np.dtype(np.uint8),
    "int16_t": np.dtype(np.int16),
    "int32_t": np.dtype(np.int32),
    "int64_t": np.dtype(np.int64),
    "double": np.dtype(np.float64),
}
_ARRAY = re.compile(r"(A1|A2|R)\((const )?(\w+), (\w+)((?:, [^,)]+)*)\)")
_LENGTH = re.compile(r"(?:(\d+) \* )?([a-z]\w*)(?: \+ (\d+))?")
_POINTER = re.compile(r"(?:const )?(\w+) \*\w+")
_NUMBER = re.compile(r"(int64_t|double) (\w+)")

_BUFFER: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer
_Length = tuple[int, str, int]  # times a length of that name, and so many more

RECORDS: dict[str, np.dtype[np.void]] = {}  # by the name of the C struct
POINTED: dict[str, dict[str, str]] = {}  # of a record: C types of what its fields of addresses point to


class CoreError(RuntimeError):
    """The library is missing or is not that of this source; the message says what to do."""


def record(name: str, fields: list[Any], pointed: dict[str, str] | None = None) -> np.dtype[np.void]:
    """The dtype of a C struct of that name: of these fields, aligned. pointed: C types of what its fields of addresses
    point to. records.h is written from these: `python -m isel_twin.native.records`."""
    made = np.dtype(fields, align=True)
    RECORDS[name], POINTED[name] = made, pointed or {}
    return made


def layout(dtype: np.dtype[np.void]) -> str:
    """Names, types and places of the fields, as records.h has them."""
    places = [
        f"{name} {kind.str[1:] if kind.subdtype is None else kind} {at}"
        for name, (kind, at, *_) in (dtype.fields or {}).items()
    ]
    return "; ".join([*places, str(dtype.itemsize)])


def address(array: NDArray[Any]) -> int:
    """Where the first element is, 0 without one. Keep the array as long as the address."""
    if not array.size:
        return 0
    if array.flags.writeable and array.dtype.names is None:  # a quarter of the time, but of records
        return ctypes.addressof(_BUFFER(array))
    return int(array.ctypes.data)


class Core:
    """The functions of the library, by name; or of that of another C file than core.c."""

    abreast: bool  # once it is loaded: axes go side by side in a register, with the same bits (drives/19)

    def __init__(self, source: Path | None = None) -> None:
        self._source = source
        self._raw: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        made = _checked(self.raw(name), name, _arguments(self.prototype(name)))
        setattr(self, name, made)
        return made

    def prototype(self, name: str) -> str:
        """The C prototype of a function. Raises CoreError if there is none."""
        try:
            return self._prototypes[name]
        except KeyError:
            raise CoreError(f"{self.path}: has no function {name}; {self._remedy}") from None

    def load(self) -> None:
        """Load the library now, so that what is wrong with it is said now. Raises CoreError."""
        self._prototypes  # noqa: B018

    def raw(self, name: str) -> Any:
        """A function that takes addresses and numbers as C does: after the address of an array come its dimensions."""
        if name not in self._raw:
            self._raw[name] = self._function(name)
        return self._raw[name]

    @property
    def _remedy(self) -> str:
        chosen = self._source is None and os.environ.get(compiling.CHOSEN)
        return f"{compiling.CHOSEN} names it: unset that" if chosen else compiling.REMEDY

    @functools.cached_property
    def path(self) -> Path:
        """The library of this source. Raises CoreError."""
        try:
            return compiling.library(self._source)
        except compiling.BuildError as error:
            raise CoreError(str(error)) from None

    @functools.cached_property
    def _library(self) -> ctypes.CDLL:
        try:
            found = ctypes.CDLL(str(self.path))
        except OSError as error:
            raise CoreError(f"{self.path}: cannot be loaded ({error}); {self._remedy}") from None
        try:
            ctypes.c_char_p.in_dll(found, "core_prototypes")
            if self._source is None:
                self.abreast = bool(found["has_avx2"]()) and os.environ.get("ISEL_TWIN_ABREAST") != "0"
                ctypes.c_int64.in_dll(found, "core_abreast").value = self.abreast
        except (AttributeError, ValueError):  # which __getattr__ must not see
            raise CoreError(f"{self.path}: is no library of this source; {self._remedy}") from None
        return found

    def text(self, name: str) -> str:
        """A text that the library carries."""
        return (ctypes.c_char_p.in_dll(self._library, name).value or b"").decode()

    @functools.cached_property
    def _prototypes(self) -> dict[str, str]:
        return {line.split("(", 1)[0].split()[-1]: line for line in self.text("core_prototypes").splitlines()}

    def _function(self, name: str) -> Any:
        prototype = self.prototype(name)
        made = self._library[name]
        kind = prototype.split(None, 1)[0]
        made.restype = None if kind == "void" else _NUMBERS[kind]
        types: list[Any] = []
        for argument in _arguments(prototype):
            if array := _ARRAY.fullmatch(argument):
                self._check(array[3])
                types += [ctypes.c_void_p, *[ctypes.c_int64] * {"R": 0, "A1": 1, "A2": 2}[array[1]]]
            elif number := _NUMBER.fullmatch(argument):
                types.append(_NUMBERS[number[1]])
            elif pointer := _POINTER.fullmatch(argument):
                self._check(pointer[1])
                types.append(ctypes.c_void_p)
            else:
                raise CoreError(f"{self.path}: {prototype}: what is {argument}?")
        made.argtypes = types
        return made

    def _check(self, element: str) -> None:
        """Raise CoreError unless a record, and what it points to, is laid out in C as here."""
        if element in RECORDS and self.text(f"layout_{element}") != layout(RECORDS[element]):
            raise CoreError(f"{self.path}: {element} is another record here; {self._remedy}")
        for pointed in set(POINTED.get(element, {}).values()):
            self._check(pointed)


def _arguments(prototype: str) -> list[str]:
    inner = prototype.split("(", 1)[1].rsplit(")", 1)[0].strip()
    return [] if inner in ("", "void") else re.split(r", (?![^()]*\))", inner)


def _checked(function: Any, name: str, arguments: list[str]) -> Callable[..., Any]:
    kinds: list[tuple[np.dtype[Any], int, bool, str, list[_Length]] | None] = []
    for argument in arguments:
        array = _ARRAY.fullmatch(argument)
        if array is None:
            kinds.append(None)
        else:
            dtype: np.dtype[Any] | None = _ELEMENTS.get(array[3], RECORDS.get(array[3]))
            if dtype is None:
                raise CoreError(f"{name}: {argument}: no record here has that name; import the module that makes it")
            dimensions = {"R": 0, "A1": 1, "A2": 2}[array[1]]
            kinds.append((dtype, dimensions, array[2] is None, argument, _lengths(array[5])))
    count = len(kinds)

    def call(*given: Any) -> Any:
        if len(given) != count:
            raise TypeError(f"{name}: takes {count} arguments, not {len(given)}: {', '.join(arguments)}")
        flat: list[Any] = []
        known: dict[str, int] = {}
        for kind, argument in zip(kinds, given, strict=True):
            if kind is None:
                flat.append(argument)
                continue
            dtype, dimensions, written, text, lengths = kind
            if (
                not isinstance(argument, np.ndarray)
                or (argument.dtype is not dtype and argument.dtype != dtype)
                or not (flags := argument.flags).c_contiguous
                or (written and not flags.writeable)
                or (argument.ndim != dimensions if dimensions else not argument.size)
            ):
                raise TypeError(f"{name}: {text}: got {_described(argument)}")
            for (times, word, more), length in zip(lengths, argument.shape, strict=False):
                if times * known.setdefault(word, (length - more) // times if word else 0) + more != length:
                    raise TypeError(f"{name}: {text}: got {_described(argument)}{_with(word, known)}")
            flat.append(address(argument))
            if dimensions:
                flat.extend(argument.shape)
        return function(*flat)

    call.__name__ = name
    return call


def _lengths(text: str) -> list[_Length]:
    """The lengths that a prototype gives an array; none, or one a dimension. A number is 0 times nothing, and more."""
    found: list[_Length] = []
    for given in text.split(", ")[1:]:
        word = _LENGTH.fullmatch(given)
        found.append((int(word[1] or 1), word[2], int(word[3] or 0)) if word else (0, "", int(given)))
    return found


def _with(word: str, known: dict[str, int]) -> str:
    return f", with {word} = {known[word]}" if word else ""


def _described(argument: Any) -> str:
    if not isinstance(argument, np.ndarray):
        return f"a {type(argument).__name__}, no array"
    dtype = argument.dtype if argument.dtype.names is None else "a record"
    pieces = "" if argument.flags.c_contiguous else ", not in one piece"
    return f"{dtype} {[*argument.shape]}{pieces}{'' if argument.flags.writeable else ', read only'}"
