"""Chooses the reader by the file name of a capture.

.vcd        value change dump                       vcd.py
.csv        table of text, also .txt and .tsv       table.py
.npz        ticks: t_ns, delta; from `isel-twin run --steps`; no signals, so no map
.dump .out  streams of Klipper and grblHAL without a board           firmware_files.py
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.capture.firmware_files import read_grblhal, read_klipper
from isel_twin.capture.mapping import parse_map, recognise
from isel_twin.capture.table import Table
from isel_twin.capture.ticks import Needs, Ticks, ticks_of
from isel_twin.capture.vcd import Dump
from isel_twin.capture.wave import LONGEST_NS, CaptureError, WrongCallError

KINDS = (".vcd", ".csv", ".txt", ".tsv", ".npz", ".dump", ".out")
TICKS = (".npz", ".dump", ".out")  # kinds with ticks in place of signals


def load(
    path: Path,
    maps: Sequence[str] = (),
    *,
    edge: str = "rising",
    needs: Needs | None = None,
    time_unit: str | None = None,
    sample_rate_hz: float | None = None,
    reverse: str = "",
) -> Ticks:
    """The stream in a capture. Raises CaptureError with one line, OSError for a file that cannot be read.

    maps: as in mapping.py; without any, signals with usual names are recognised. edge: "rising", "falling" or "both".
    time_unit, sample_rate_hz: of a `Table`. reverse: axes with inverted direction.
    """
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise CaptureError(f"{path}: the name must end in {', '.join(KINDS[:-1])} or {KINDS[-1]}")
    signals = parse_map(maps) if maps else {}
    if kind in TICKS:
        if signals:
            raise WrongCallError(f"map: an {kind} has ticks and no signals; leave the map out")
        if kind == ".npz":
            ticks = _load_npz(path)
        else:
            ticks = read_klipper(path, sample_rate_hz) if kind == ".dump" else read_grblhal(path)
    else:
        file = Dump(path) if kind == ".vcd" else Table(path, time_unit, sample_rate_hz)
        try:
            signals = signals or recognise(file.names)
        except CaptureError as error:
            raise CaptureError(f"{path}: {error}") from None
        capture = file.read([signal.name for signal in signals.values()])
        ticks = ticks_of(capture, signals, needs or Needs(), edge)
    if not ticks.t_ns.size:
        kinds = (".step", ".plus", ".minus")
        steps = ", ".join(signal.name for role, signal in signals.items() if role.endswith(kinds))
        raise CaptureError(f"{path}: has no step in it{f'; nothing happens on {steps}' if steps else ''}")
    axes = AXIS_NAMES[: ticks.delta.shape[1]]
    for axis in (name.strip().lower() for name in reverse.split(",") if name.strip()):
        if axis not in axes:
            raise WrongCallError(f"reverse {axis}: there are {', '.join(axes)}")
        ticks.delta[:, AXIS_NAMES.index(axis)] *= -1
    return ticks


def _load_npz(path: Path) -> Ticks:
    try:
        with np.load(path, allow_pickle=False) as file:
            if missing := {"t_ns", "delta"} - set(file.files):
                raise CaptureError(f"{path}: has no {' and no '.join(sorted(missing))}; write it by run --steps")
            t_ns, delta = file["t_ns"], file["delta"]
    except (CaptureError, OSError):
        raise
    except Exception as error:  # numpy, zipfile and zlib raise a dozen types for damaged bytes
        reason = " ".join(str(error).split())[:80]
        raise CaptureError(f"{path}: is no .npz, or damaged ({reason}); write it again") from None
    if t_ns.ndim != 1 or t_ns.dtype.kind != "i" or delta.ndim != 2 or delta.dtype.kind != "i":
        raise CaptureError(f"{path}: needs t_ns [n] and delta [n, axes] of whole numbers; write it by run --steps")
    if len(delta) != len(t_ns) or not 1 <= delta.shape[1] <= len(AXIS_NAMES):
        raise CaptureError(f"{path}: t_ns {t_ns.shape} and delta {delta.shape} do not belong together; write it again")
    if delta.dtype != np.int8:
        raise CaptureError(f"{path}: has set points ({delta.dtype}), not steps; a drive with step inputs has none")
    t_ns = t_ns.astype(np.int64)
    if t_ns.size and (t_ns[0] < 0 or t_ns[-1] > LONGEST_NS):
        raise CaptureError(f"{path}: times must lie from 0 to {LONGEST_NS} ns; write it again")
    if (back := np.flatnonzero(np.diff(t_ns) < 0)).size:
        raise CaptureError(f"{path}: t_ns[{back[0] + 1}] is less than the one before; sort the ticks by time")
    return Ticks(t_ns, delta, int(t_ns[-1]) if t_ns.size else 0)
