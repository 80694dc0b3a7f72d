"""A recording as one page that plays by itself: the machine in 3D, a scope, the line, all on one time axis (report/2).

    Recorded --- session ---> Session: JSON, and columns of whole numbers --- playback_page ---> one HTML file

The page loads nothing, so it can be handed on. It holds all there is: each sample, and each step with its time. What
does not fit into the bytes asked for is left out from the finest on, and told on the page: first samples, of which the
least and the largest of ever more remain, then the single steps.

    script      playback.js (time, line), scope.js (signals, cursors, trigger, VCD), machine.js (WebGL)
    data        zlib of: length of the JSON (4 bytes, little endian), JSON, columns

A column is whole numbers of a unit: differences (of differences), zigzag, 7 bits a byte, the lowest first.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.language import create_language, readable
from isel_twin.plant import PLACES
from isel_twin.plant.scene import body_meshes
from isel_twin.recordings.compare import traffic
from isel_twin.recordings.places import Places, places
from isel_twin.recordings.reading import Recorded, RecordingError
from isel_twin.recordings.recording import GROUPS
from isel_twin.report.page import whole_page
from isel_twin.report.svg import escape

MOST_BYTES = 5_000_000  # of a file that is handed on
LEAST_SAMPLES = 2000  # below that samples are not thinned out any more
NOTHING = -(10**9)  # in a column: no value
PAUSE = 3  # intervals between samples from which on nothing moved meanwhile (scope.js)

# what is shown of the samples: name, unit, resolution
QUANTITIES = (
    ("position_mm", "mm", 1e-4),
    ("position_error_mm", "mm", 1e-5),
    ("velocity_mm_s", "mm/s", 1e-2),
    ("lost_steps", "steps", 1e-2),
    ("margin", "1", 1e-3),
    ("force_n", "N", 0.1),
    ("current", "1", 1e-3),
    ("supply_v", "V", 1e-2),
)


class TooLargeError(RecordingError):
    """A session does not fit into a file of the size asked for, whatever is left out."""


@dataclass(frozen=True)
class Session:
    """What a page holds, before it is compressed."""

    about: dict[str, Any]
    columns: tuple[bytes, ...]

    def data(self) -> bytes:
        """Compressed."""
        head = json.dumps({**self.about, "sizes": [len(column) for column in self.columns]}, separators=(",", ":"))
        told = head.encode()
        return zlib.compress(b"".join([len(told).to_bytes(4, "little"), told, *self.columns]), 9)


def playback_page(recorded: Recorded, most_bytes: int | None = MOST_BYTES) -> tuple[str, list[str]]:
    """The page, and what it leaves out, in words. most_bytes: None for all there is.

    Raises RecordingError for a recording of a real controller, TooLargeError.
    """
    if not recorded.of_twin:
        raise RecordingError(f"{recorded.path}: has bytes of a line and nothing else; `isel-twin decode` explains them")
    try:
        machine = places(recorded)
    except RecordingError as error:  # it does not begin at power-on
        machine, why = None, str(error).removeprefix(f"{recorded.path}: ")
    else:
        why = ""
    every, steps = 1, True
    while True:
        left_out = [f"the machine in 3D: the recording {why}"] if why else []
        if every > 1:
            left_out.append(f"of {2 * every} samples, all but the least and largest, for the size of the file")
        left_out += [] if steps else ["single steps, for the size of the file"]
        page = _page(recorded, session(recorded, machine, every, steps, left_out).data())
        if most_bytes is None or len(page) <= most_bytes:
            return page, left_out
        if len(recorded.sample_times_ns) // (2 * every) >= LEAST_SAMPLES and (every < 8 or not steps):
            every *= 2
        elif steps:
            steps, every = False, 1
        else:
            raise TooLargeError(f"{recorded.path}: is too long for a page of {most_bytes / 1e6:g} MB")


def _page(recorded: Recorded, data: bytes) -> str:
    name = f"{recorded.metadata.get('machine', '')} · {recorded.controller}"
    body = [
        f"<header><h1>{escape(recorded.path.name)}</h1><span>{escape(name)}</span></header>",
        "<noscript><p>The recording is played by a script, which this browser does not run.</p></noscript>",
        '<main id="playback"></main>',
        f'<script type="text/plain" id="session">{base64.b64encode(data).decode()}</script>',
    ]
    return whole_page(
        f"{recorded.path.name} · isel-twin", body, ("playback.js", "scope.js", "machine.js"), "playback.css"
    )


def session(
    recorded: Recorded, machine: Places | None, every: int = 1, steps: bool = True, left_out: list[str] | None = None
) -> Session:
    """Content of the page. every: of twice as many samples two are taken, the least and the largest of each value;
    steps: with each step."""
    columns: list[bytes] = []

    def column(values: NDArray[Any], order: int = 1) -> int:
        columns.append(packed(values, order))
        return len(columns) - 1

    times_ns = recorded.sample_times_ns
    kept = np.flatnonzero(np.append(np.diff(times_ns) > 0, True)[: len(times_ns)])
    groups = _groups(times_ns[kept], every, recorded.interval_ns)
    rows = kept[_middles(groups, len(kept))]
    about: dict[str, Any] = {
        "axes": list(AXIS_NAMES[: recorded.axes]),
        "end_ns": recorded.end_ns,
        "interval_ns": recorded.interval_ns * every,
        "left_out": left_out or [],
        "times": column(times_ns[rows], 2),
        "samples": [
            {
                "name": name,
                "unit": unit,
                "step": step,
                "nothing": NOTHING,
                "columns": [column(_extremes(one, groups)) for one in parts],
            }
            for name, unit, step, parts in _quantities(recorded.samples[kept])
        ],
        "changes": _changes(recorded),
        "lines": list(_lines(recorded)),
        "machine": None if machine is None else _machine(machine, rows, column),
        "ticks": None,
    }
    if steps:
        stream = recorded.steps()
        moved = [column(stream.delta[:, axis], 0) for axis in range(recorded.axes)]
        about["ticks"] = {"times": column(stream.t_ns, 2), "moved": moved, "led": bool(stream.dtype != np.int8)}
    return Session(about, tuple(columns))


def _groups(times_ns: NDArray[np.int64], every: int, interval_ns: int) -> NDArray[np.int64]:
    """First of each group of twice `every` samples without a pause. The last one before a pause, whose values hold
    through it, is alone."""
    ends = np.append(np.diff(times_ns) > PAUSE * interval_ns, True)[: len(times_ns)]
    numbers = np.arange(len(times_ns))
    begins = np.maximum.accumulate(np.where(np.append(True, ends[:-1])[: len(ends)], numbers, 0))
    return np.flatnonzero(((numbers - begins) % (2 * every) == 0) | ends)


def _middles(firsts: NDArray[np.int64], number: int) -> NDArray[np.int64]:
    """The samples whose times the two of each group get: its first one, and the one in its middle if it has more."""
    sizes = np.diff(firsts, append=number)
    found: NDArray[np.int64] = np.sort(np.concatenate([firsts, (firsts + sizes // 2)[sizes > 1]]))
    return found


def _extremes(values: NDArray[np.int64], firsts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The least and the largest of each group, in the order of the way from its first to its last."""
    if not len(values):
        return values
    lasts = np.append(firsts[1:], len(values)) - 1
    low = np.minimum.reduceat(np.where(values == NOTHING, -NOTHING, values), firsts)
    low, high = np.where(low == -NOTHING, NOTHING, low), np.maximum.reduceat(values, firsts)
    rises = values[firsts] <= values[lasts]
    pairs = np.stack([np.where(rises, low, high), np.where(rises, high, low)], axis=1)
    found: NDArray[np.int64] = pairs[np.stack([lasts >= firsts, lasts > firsts], axis=1)]
    return found


def _quantities(samples: NDArray[np.void]) -> Iterator[tuple[str, str, float, list[NDArray[np.int64]]]]:
    """Of each quantity that has values: name, unit, resolution, whole numbers [n] of each axis."""
    for name, unit, step in QUANTITIES:
        if name in (samples.dtype.names or ()):
            values = np.asarray(samples[name], dtype=np.float64).reshape(len(samples), -1)
            if np.isfinite(values).any():
                whole = np.where(np.isfinite(values), np.rint(np.nan_to_num(values) / step), NOTHING).astype(np.int64)
                yield name, unit, step, list(whole.T)


def _changes(recorded: Recorded) -> dict[str, list[list[Any]]]:
    """Of each level, input and output: [time in ns, value], each change."""
    found: dict[str, list[list[Any]]] = {}
    for group, channel in GROUPS.items():
        for entry in recorded.of(channel):
            for name, value in entry.content.items():
                found.setdefault(f"{group} {name}", []).append([entry.time_ns, value])
    return found


def _lines(recorded: Recorded) -> Iterator[list[Any]]:
    """[time in ns, who, text, meaning] of each message of the line and each event, in the order of time."""
    found: list[list[Any]] = []
    language = None if not recorded.controller else _language(recorded.controller)
    for time_ns, data, by_host, _ in traffic(recorded):
        who = "host" if by_host else "twin"
        if language is None:
            found.append([time_ns, who, data.hex(" "), ""])
        else:
            messages = language.messages(data, by_host)
            found += [[time_ns, who, one.text or readable(one.data), one.explanation] for one in messages]
    for entry in recorded.of("/operator", "/scenario", "/remarks", "/collisions", "/port"):
        if entry.content != {"watch_margin": True}:
            who = {"/operator": "hand", "/scenario": "event"}.get(entry.channel, "")
            found.append([entry.time_ns, who, *_in_words(entry.channel, entry.content)])
    return iter(sorted(found, key=lambda line: line[0]))


def _in_words(channel: str, content: Mapping[str, Any]) -> tuple[str, str]:
    if channel == "/collisions":
        return "collision", f"{content.get('first')} and {content.get('second')}"
    if channel in ("/remarks", "/port"):
        return "", str(content.get("text", ""))
    return json.dumps(content), ""


def _language(controller: str) -> Any:
    try:
        return create_language(controller)
    except ValueError:  # a plug-in that is not installed here
        return None


def _machine(machine: Places, rows: NDArray[np.int64], column: Any) -> dict[str, Any]:
    """The tree of bodies, their meshes, and where the carriages are."""
    model = machine.model
    names = [axis.name for axis in machine.machine.axes]
    joints = {model.joint(name).id: names.index(name) for name in names}
    bodies = []
    for number in range(model.nbody):
        first, many = int(model.body_jntadr[number]), int(model.body_jntnum[number])
        bodies.append(
            {
                "name": model.body(number).name,
                "parent": int(model.body_parentid[number]),
                "position": _short(model.body_pos[number]),
                "wxyz": _short(model.body_quat[number]),
                "joints": [
                    {
                        "slides": bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE),
                        "along": _short(model.jnt_axis[joint]),
                        "at": _short(model.jnt_pos[joint]),
                        "axis": joints[joint],
                    }
                    for joint in range(first, first + many)
                    if joint in joints
                ],
            }
        )
    ids = {body["name"]: number for number, body in enumerate(bodies)}
    meshes = [
        {
            "body": ids[mesh.body],
            "rgba": mesh.rgba,
            "vertices": _short(mesh.vertices, 4),
            "faces": mesh.faces.ravel().tolist(),
        }
        for mesh in body_meshes(model)
    ]
    tool, table = (model.site(PLACES[place]).id for place in ("tool", "table"))
    return {
        "bodies": bodies,
        "meshes": meshes,
        "centre": _short(model.stat.center),
        "extent": float(model.stat.extent),
        "tool": {"body": int(model.site_bodyid[tool]), "at": _short(model.site_pos[tool])},
        "table": int(model.site_bodyid[table]),
        "columns": [
            column(np.rint(machine.position_mm[rows, axis] / 1e-3).astype(np.int64)) for axis in range(len(CARRIAGES))
        ],
        "step": 1e-6,
    }


def _short(values: NDArray[Any], digits: int = 6) -> list[float]:
    return np.round(np.asarray(values, dtype=np.float64), digits).ravel().tolist()


def packed(values: NDArray[Any], order: int) -> bytes:
    """Whole numbers [n] in few bytes. order: 0 the numbers, 1 differences, 2 differences of differences."""
    numbers = np.asarray(values, dtype=np.int64)
    for _ in range(order):
        numbers = np.diff(numbers, prepend=np.int64(0))
    zigzag = ((numbers << 1) ^ (numbers >> 63)).astype(np.uint64)
    sizes = np.ones(len(zigzag), dtype=np.int64)
    for bits in range(7, 64, 7):
        sizes += zigzag >= np.uint64(1 << bits)
    starts = np.cumsum(sizes) - sizes
    out = np.zeros(int(sizes.sum()), dtype=np.uint8)
    for k in range(int(sizes.max(initial=0))):
        longer = sizes > k
        seven = (zigzag[longer] >> np.uint64(7 * k)) & np.uint64(127)
        out[starts[longer] + k] = seven | np.where(sizes[longer] > k + 1, 128, 0).astype(np.uint64)
    return out.tobytes()
