"""One reader against many mutated files: what it may do is refuse them in one line of its own, quickly and in place."""

from __future__ import annotations

import resource
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from isel_twin.base.errors import CallError
from tests.fuzz.mutate import mutated
from tests.fuzz.readers import Reader

ALLOWED = (ValueError, CallError, OSError)  # errors of readers; anything else is a traceback for the user
MOST_CPU_S = 5.0
MOST_MB = 200.0


def trials(reader: Reader, folder: Path, number: int, first: int = 0) -> Iterator[tuple[int, str]]:
    """Seed and fault of the files with which something is wrong, of so many from seed `first` on."""
    own = folder / "own"
    own.mkdir()
    sample = reader.sample(own)
    place = folder / "tried"
    place.mkdir()
    (folder / "mine.txt").write_text("precious")
    path = place / (reader.name if "." in reader.name else f"{reader.name}.bin")
    path.write_bytes(sample)
    reader.read(path)  # the sample is sound
    megabytes = _peak_mb()
    for seed in range(first, first + number):
        path.write_bytes(mutated(sample, seed))
        began_s = time.process_time()
        why = _fault(reader, path)
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
            yield seed, why


def _fault(reader: Reader, path: Path) -> str:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader.read(path)
    except ALLOWED as error:
        lines = str(error).count("\n")
        return f"{lines + 1} lines: {error}" if lines else ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
