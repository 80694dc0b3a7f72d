"""Records a twin: everything that happens to it, as messages, and all that is needed to build it again.

    Twin --- listen, observe ---> Recording --- message(channel, time, content) ---> a Sink: the file, or a replay

Messages are in the order of events; the same session gives the same messages, byte for byte, however its time is
divided into calls of `run`. `CHANNELS` (mcap.py) lists the channels. `/samples` come on a grid of virtual time and at
every change of a level, input or output, like those of a `Recorder` (recorder.py) (recordings/4).
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.core.position import position_error_mm
from isel_twin.core.told import StateError
from isel_twin.language import create_language
from isel_twin.machine import fixture_table
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.recorder import changes
from isel_twin.recordings.runs import described
from isel_twin.recordings.samples import sample_dtype, samples_schema
from isel_twin.wiring import scenario_text

if TYPE_CHECKING:
    from isel_twin.core.sampling import TwinSamples
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin
    from isel_twin.motion import Motion

# names of attachments: flash memory before power-on, scenario, machine files, fixtures clamped for the job
FLASH, SCENARIO, MACHINE, FIXTURES = "flash", "scenario.toml", "machine.json", "fixtures.json"
# folders in the names of attached files: of the MuJoCo model, and of the fixture on the table
MODEL, FIXTURE = "model", "fixture"
ASSETS: Final = (".xml", ".stl", ".obj", ".msh")  # types of files that a model may need
MOST_ASSET_BYTES = 1 << 24
GROUPS: Final = {"level": "/levels", "input": "/inputs", "output": "/outputs"}  # channels, by `recorder.Change.group`
MOST_LOOKS = 100  # most samples that wait for each other and for those of the plant, to be written together
_ERROR: Final = "position_error_mm"  # the field of a sample that follows from others
_READ: Final = {"current": "current_fraction"}  # what is read for a field of another name
PACKAGES: Final = ("mujoco", "numpy")


class Sink(Protocol):
    def sent(self, time_ns: int, data: bytes) -> None: ...
    def received(self, time_ns: int, data: bytes, byte_ns: int = 0) -> None: ...
    def message(self, channel: str, time_ns: int, content: Mapping[str, Any]) -> None: ...
    def samples(self, time_ns: NDArray[np.int64], rows: NDArray[np.void], schema: str) -> None: ...


class Recording:
    """Sends everything that happens to a twin from now on to a sink."""

    def __init__(self, twin: Twin, sink: Sink, interval_ns: int, forces: bool | None = None) -> None:
        """interval_ns: sampling interval in virtual time. forces: with those of the nuts; None: if there are any."""
        self._sink, self._twin = sink, twin
        self._step_mm = twin.step_mm
        forces = twin.physics if forces is None else forces
        self._dtype = sample_dtype(len(twin.counts), len(twin.current_fraction), forces)
        self._schema = samples_schema(self._dtype)
        self._read = tuple(_READ.get(name, name) for name in self._dtype.names or () if name != _ERROR)
        self._last: dict[str, dict[str, int | str]] = {group: {} for group in GROUPS}
        self._faults: Mapping[str, str | float] = {}
        self._motion: Motion | None = None
        self._looks: list[tuple[Any, ...]] = []  # time and what was read; waiting for earlier samples of the plant
        self._ended = False
        twin.listen(self._note)
        self._sampler = twin.sample(self._take, interval_ns)
        twin.observe(self._look, interval_ns if self._sampler is None else None)

    @property
    def waiting(self) -> bool:
        """True if the sink has not got everything."""
        return bool(self._looks) or (self._sampler is not None and self._sampler.waiting > 0)

    def hand_on(self) -> None:
        """Send everything so far to the sink."""
        if self._sampler is not None:
            self._sampler.hand_on()
        if self._looks:
            self._tell_samples(np.empty(0, dtype=np.int64), np.empty(0, dtype=self._dtype))

    def end(self) -> None:
        """Write the last message, with the present time."""
        self.hand_on()
        self._ended = True
        self._sink.message("/time", self._twin.time_ns, {"what": "end"})

    def _take(self, samples: TwinSamples) -> None:
        self._tell_samples(samples.time_ns, self._rows([getattr(samples, name) for name in self._read]))

    def _rows(self, columns: Sequence[Sequence[Any] | NDArray[Any]]) -> NDArray[np.void]:
        """Samples [n] of the columns [n, ...] that were read, in the order of `_read`."""
        rows = np.empty(len(columns[0]), dtype=self._dtype)
        read = iter(columns)
        for name in self._dtype.names or ():
            if name != _ERROR:
                rows[name] = next(read)
        rows[_ERROR] = position_error_mm(rows["position_mm"], rows["counts"], self._step_mm)
        return rows

    def _tell_samples(self, times_ns: NDArray[np.int64], rows: NDArray[np.void]) -> None:
        """Send samples of the plant, and samples at changes between them, in the order of time."""
        if self._looks:
            look_ns, *columns = zip(*self._looks, strict=True)
            self._looks = []
            at = np.searchsorted(times_ns, look_ns, side="right")
            times_ns = np.insert(times_ns, at, look_ns)
            whole = np.dtype((np.void, self._dtype.itemsize))  # copied as one piece, not field by field
            rows = np.insert(rows.view(whole), at, self._rows(columns).view(whole)).view(self._dtype)
        self._sink.samples(times_ns, rows, self._schema)

    def _note(self, time_ns: int, kind: str, what: Any) -> None:
        sink = self._sink
        if kind == "sent":
            sink.sent(time_ns, what)
        elif kind == "received":
            sink.received(what.arrival_ns, what.data, what.byte_ns)
        elif kind == "lost":
            sink.message("/host/lost", what.arrival_ns, {"hex": what.data.hex()})
        elif kind == "motion":
            self._follow(time_ns, what)
        elif kind == "counter":
            sink.message("/counters", time_ns, {"axis": what.axis, "value": what.value})
        elif kind == "flash":
            sink.message("/flash", time_ns, {"bytes": len(what), "sha256": hashlib.sha256(what).hexdigest()})
        elif kind == "remark":
            sink.message("/remarks", time_ns, {"text": what})
        elif kind == "collision":
            sink.message("/collisions", time_ns, what.content)
        elif kind == "restored":
            if not self._ended:
                raise StateError("a twin that is being recorded cannot go to another time; close its recording before")
        else:
            sink.message({"operated": "/operator", "scenario": "/scenario"}[kind], time_ns, what)

    def _follow(self, time_ns: int, motion: Motion | None) -> None:
        before, self._motion = self._motion, motion
        if motion is None:
            self._sink.message("/runs", time_ns, {"run": None})
            return
        continues = before is not None and motion.continues(before)
        run = described(motion, before if continues else None, time_ns)
        self._sink.message("/runs", time_ns, {"run": run, "continues": continues})

    def _look(self, twin: Twin) -> None:
        time_ns = twin.time_ns
        self._looks.append((time_ns, *[getattr(twin, name) for name in self._read]))
        if len(self._looks) >= MOST_LOOKS:
            self.hand_on()
        for group, values in (("level", twin.levels), ("input", twin.inputs), ("output", twin.outputs)):
            if changed := changes(self._last[group], values):
                self._sink.message(GROUPS[group], time_ns, changed)
        if (faults := twin.faults) != self._faults:
            self._faults = dict(faults)
            self._sink.message("/faults", time_ns, {"faults": self._faults})


class FileRecording:
    """A recording of a twin in a file, from now until `close`. Raises OSError if it cannot begin."""

    def __init__(
        self, path: str | os.PathLike[str], twin: Twin, interval_ns: int, said: Mapping[str, str] | None = None
    ) -> None:
        """said: further metadata. interval_ns: sampling interval."""
        self.path = Path(path)
        self._twin = twin
        self.writer = RecordingWriter(
            path,
            metadata(twin, interval_ns) | dict(said or {}),
            attachments(twin.origin),
            None if twin.language is None else create_language(twin.controller_name),
        )
        self._recording = Recording(twin, self.writer, interval_ns)

    def flush(self) -> None:
        """Pass everything recorded to the operating system."""
        self._recording.hand_on()
        self.writer.flush()

    @property
    def unwritten(self) -> bool:
        """True if something was recorded since the last `flush`."""
        return self.writer.unwritten or self._recording.waiting

    def tell_time(self, what: str) -> None:
        """Record how virtual time passes from now on."""
        self.writer.message("/time", self._twin.time_ns, {"what": what})

    def close(self) -> bool:
        """Close the file; False if the disk was full, which is logged. May be called again."""
        if not self.writer.ended:
            self._recording.end()
            self.writer.close()
        return not self.writer.broken


def metadata(twin: Twin, interval_ns: int) -> dict[str, str]:
    """Metadata of a recording of this twin, plain text by key."""
    origin = twin.origin
    return {
        "kind": "twin",
        "machine": origin.as_built.name,
        "controller": origin.controller,
        "plant": origin.plant,
        "seed": str(origin.seed),
        "line_speed": json.dumps(origin.line_speed),
        "adapter_ms": json.dumps(origin.adapter_ms),
        "overrides": json.dumps(dict(origin.overrides), default=_plain),
        "start_mm": json.dumps(origin.start_mm, default=_plain),
        "axes": str(len(twin.counts)),
        "motors": str(len(twin.current_fraction)),
        "forces": json.dumps(twin.physics),
        "carriages": " ".join(CARRIAGES),
        "step_mm": json.dumps(twin.step_mm.tolist()),
        "interval_ns": str(interval_ns),
        "held": json.dumps(twin.can_sample(interval_ns)),
        "begins_ns": str(twin.time_ns),
        "python": platform.python_version(),
        "platform": platform.platform(),
        **packages(),
    }


@functools.cache
def packages() -> Mapping[str, str]:
    """Versions of the packages that affect the last bit; looked up once, as they are those that were imported."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found


def attachments(origin: TwinSpec) -> dict[str, bytes]:
    """Files of the twin to attach, by name. Raises OSError for a missing scenario."""
    machine = origin.as_built
    text = machine.file.read_bytes() if machine.file.is_file() else b""
    files = {MACHINE: json.dumps(machine.tree, default=_plain).encode(), "machine.toml": text}
    for folder, model in ((MODEL, machine.model_file), (FIXTURE, machine.fixture_file)):
        if model is not None:
            for path in sorted(model.resolve().parent.iterdir()):
                if path.suffix.lower() in ASSETS and path.is_file() and path.stat().st_size <= MOST_ASSET_BYTES:
                    files[f"{folder}/{path.name}"] = path.read_bytes()
    for number, fixture in enumerate((*machine.fixtures, *origin.fixtures)):
        if fixture.file is not None:
            files[mesh_name(number, fixture.file)] = fixture.file.read_bytes()
    if origin.fixtures:
        first = len(machine.fixtures)
        tables = [
            fixture_table(one, "" if one.file is None else mesh_name(first + number, one.file))
            for number, one in enumerate(origin.fixtures)
        ]
        files[FIXTURES] = json.dumps(tables).encode()
    if origin.scenario is not None:
        files[SCENARIO] = origin.scenario.read_bytes()
    if origin.events:
        files[SCENARIO] = scenario_text(origin.events).encode()
    if origin.image is not None:
        files[FLASH] = origin.image
    return files


def mesh_name(number: int, file: Path) -> str:
    """Name of the attachment with the mesh of a fixture: of the machine's, and then the job's, from 0."""
    return f"{FIXTURE}/{number}-{file.name}"


def _plain(value: Any) -> Any:
    """Convert for JSON: numpy's numbers and arrays, paths."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
