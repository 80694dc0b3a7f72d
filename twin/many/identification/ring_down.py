"""Frequency and damping of a machine that rings down, from a sound, an accelerometer or a position over time.

    x(t) = a exp(-z w t) cos(w sqrt(1 - z^2) t) + others

The signal from its greatest value on, less its mean; the line of its spectrum that is highest gives a first frequency,
what is BAND of it either way is kept, and made analytic (no negative frequencies):

    y(t) = A(t) exp(i phi(t))        frequency = slope of phi / 2 pi        z w = - slope of ln A

both by least squares while the amplitude is between FROM and TO of its greatest. A sound has the same frequency and
damping as the motion. Valid for one dominant mode, with three turns or more above TO.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LEAST_HZ = 2.0  # below it lies what is no ringing: creep, a hand
BAND = 0.5
FROM, TO = 0.85, 0.15
LEAST_SAMPLES = 16

Floats = NDArray[np.float64]


def ring_down(time_s: Floats, signal: Floats) -> tuple[float, float]:
    """Frequency in Hz and damping ratio of a signal [n] at even times [n]. Raises ValueError if nothing rings."""
    if len(signal) < LEAST_SAMPLES:
        raise ValueError(f"{len(signal)} samples are too few to see a ring-down; allowed: {LEAST_SAMPLES} or more")
    step_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if not step_s > 0.0 or np.abs(np.diff(time_s) - step_s).max() > 0.1 * step_s:
        raise ValueError("the times of a ring-down must rise evenly")
    own = signal - signal[-max(1, len(signal) // 4) :].mean()
    own = own[int(np.argmax(np.abs(own))) :]
    own = own - own.mean()
    size = 8 * len(signal)
    spectrum, hz = np.fft.fft(own, size), np.fft.fftfreq(size, step_s)
    able = hz >= max(LEAST_HZ, 1.0 / (len(own) * step_s))
    peak_hz = float(hz[able][np.argmax(np.abs(spectrum[able]))])
    kept = (hz >= (1.0 - BAND) * peak_hz) & (hz <= (1.0 + BAND) * peak_hz)
    analytic = np.fft.ifft(np.where(kept, 2.0 * spectrum, 0.0))[: len(own)]
    amplitude = np.abs(analytic)
    top = int(np.argmax(amplitude[: max(1, round(2.0 / (peak_hz * step_s)))]))
    below = np.flatnonzero(amplitude[top:] < TO * amplitude[top])
    end = top + (int(below[0]) if len(below) else len(amplitude) - top - 1)
    start = top + int(np.argmax(amplitude[top : end + 1] <= FROM * amplitude[top]))
    if amplitude[top] == 0.0 or (end - start) * step_s * peak_hz < 1.0:
        raise ValueError("nothing rings in this signal: it has died away within one turn")
    at_s = step_s * np.arange(start, end)
    turned = np.polyfit(at_s, np.unwrap(np.angle(analytic[start:end])), 1)[0]
    fall = -float(np.polyfit(at_s, np.log(amplitude[start:end]), 1)[0])
    whole = math.hypot(turned, fall)
    return float(abs(turned)) / (2.0 * math.pi), max(0.0, fall) / whole


def read_signal(path: Path) -> tuple[Floats, Floats]:
    """Times in s and signal of a CSV file: the first two columns that are numbers; a first line may name them. Raises
    ValueError, OSError."""
    rows = []
    with path.open(newline="", encoding="utf-8") as lines:
        for number, line in enumerate(csv.reader(lines), 1):
            try:
                rows.append((float(line[0]), float(line[1])))
            except (ValueError, IndexError):
                if number > 1 and line:
                    raise ValueError(f"line {number}: {','.join(line)!r}; allowed: time in s, signal") from None
    found = np.array(rows).reshape(-1, 2)
    return found[:, 0], found[:, 1]
