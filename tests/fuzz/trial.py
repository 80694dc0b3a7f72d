"""One reader against many mutated files: what it may do is refuse them in one line of its own, quickly and in place."""

from __future__ import annotations

import math
import re
import resource
import signal
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

from isel_twin.base.errors import CallError
from isel_twin.plant import PlantError
from tests.fuzz.mutate import Mutation, either

ALLOWED = (ValueError, CallError, OSError, PlantError)  # errors of readers; anything else is a traceback for the user
MOST_CPU_S = 5.0
MOST_WALL_S = 120  # a reader that hangs is broken off
MOST_MB = 200.0


@dataclass(frozen=True)
class Reader:
    """sample: makes a valid file in a folder; read: reads it there, by the name it has been given. at_once: the words
    of a refusal at the first thing that is looked at."""

    name: str
    sample: Callable[[Path], bytes]
    read: Callable[[Path], object]
    mutate: Mutation = either
    at_once: str = r"\bline 1\b"
    files: int = 200  # that `make thorough` tries


@dataclass
class Tally:
    """The outcome of many files: how many were read, how many were refused before anything was looked at, and seed and
    fault of those with which something is wrong."""

    tried: int = 0
    read: int = 0
    at_once: int = 0
    refusals: Counter[str] = field(default_factory=Counter)  # by their words without numbers and names
    wrong: list[tuple[int, str]] = field(default_factory=list)

    @property
    def past(self) -> float:
        """The share of files that got past the first refusal."""
        return 1.0 - self.at_once / max(1, self.tried)


class Hang(BaseException):
    """A reader does not come to an end."""


def trials(reader: Reader, folder: Path, number: int, first: int = 0, most_s: float = math.inf) -> Tally:
    """So many files from seed `first` on, or as many as there is time for."""
    own = folder / "own"
    own.mkdir()
    sample = reader.sample(own)
    place = folder / "tried"
    place.mkdir()
    (folder / "mine.txt").write_text("precious")
    path = place / (reader.name if "." in reader.name else f"{reader.name}.bin")
    path.write_bytes(sample)
    reader.read(path)  # the sample is sound
    tally = Tally()
    megabytes = _peak_mb()
    until_s = time.monotonic() + most_s
    for seed in range(first, first + number):
        if time.monotonic() > until_s:
            break
        path.write_bytes(reader.mutate(sample, seed))
        began_s = time.process_time()
        why = _fault(reader, path, tally)
        spent_s = time.process_time() - began_s
        if not why and spent_s > MOST_CPU_S:
            why = f"{spent_s:.1f} s of CPU"
        if not why and _peak_mb() - megabytes > MOST_MB:
            why = f"{_peak_mb() - megabytes:.0f} MB more"
            megabytes = _peak_mb()
        outside = Counter(entry.name for entry in folder.iterdir()) - Counter(["own", "tried", "mine.txt"])
        if not why and (outside or (folder / "mine.txt").read_text() != "precious"):
            why = f"outside its folder: {', '.join(outside)}"
        if why:
            tally.wrong.append((seed, why))
    return tally


def _fault(reader: Reader, path: Path, tally: Tally) -> str:
    tally.tried += 1
    try:
        with warnings.catch_warnings(), _no_longer_than(MOST_WALL_S):
            warnings.simplefilter("ignore")
            reader.read(path)
        tally.read += 1
    except ALLOWED as error:
        text = str(error)
        tally.at_once += bool(re.search(reader.at_once, text))
        tally.refusals[re.sub(r"\d+|'[^']*'|\S*/\S*", "_", text)[:70]] += 1
        lines = text.count("\n")
        return f"{lines + 1} lines: {error}" if lines else ""
    except (Exception, Hang) as error:
        return f"{type(error).__name__}: {error}"
    return ""


@contextmanager
def _no_longer_than(seconds: int) -> Iterator[None]:
    def give_up(number: int, frame: FrameType | None) -> None:
        raise Hang(f"no end within {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
