"""Files that commands write: `--record`, and the files of `run` and `drive`. One that cannot be written prevents
neither the others nor the verdict, which names it and is then not well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.files import kind_of
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import outputs
from isel_twin.cli.options import PAGE, RECORDING, TRACES, check_writable, written

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.recorder import Recorder
    from isel_twin.recordings.recording import FileRecording

MOST_SAMPLES = 100_000_000  # most samples of a trace: ten gigabytes, two hours to take them
SAMPLES = ".parquet", ".csv"
StepsPath = Annotated[Path | None, written("Write the step stream (npz: t_ns, delta).", ".npz", bare=True)]
VcdPath = Annotated[Path | None, written("Write step, direction, levels and positions (VCD).", ".vcd", bare=True)]
TracePath = Annotated[
    Path | None, written("Write samples of counters, positions, levels (.parquet, .csv).", *SAMPLES, bare=True)
]
ReportPath = Annotated[
    Path | None, written("Write a page about it (HTML; a picture if it ends in .png).", *PAGE, ".png", bare=True)
]
RecordPath = Annotated[
    Path | None,
    written(
        "Keep all that happens: .mcap, as it goes; or at the end .npz (steps), .vcd, .parquet, .csv.",
        RECORDING,
        *TRACES,
    ),
]


@dataclass(frozen=True)
class Files:
    steps: Path | None
    vcd: Path | None
    trace: Path | None
    report: Path | None
    record: Path | None
    interval_s: float  # virtual time between two samples

    @property
    def needs_recorder(self) -> bool:
        """True if a file needs the samples of a `Recorder`."""
        return any(path is not None for path in (self.vcd, self.trace, self.report))

    @property
    def sampled(self) -> bool:
        """True if a file has samples."""
        return self.needs_recorder or self.record is not None

    @property
    def needs_stream(self) -> bool:
        """True if a file needs the whole step stream."""
        return self.needs_recorder or self.steps is not None

    def check(self, *kept: Path | None) -> None:
        """Raise CallError unless all of them can be written, without replacing a file that the call needs (`kept`)."""
        check_writable(self.steps, self.vcd, self.trace, self.report, self.record, kept=kept)

    def begin(self, twin: Twin, said: Mapping[str, str], stack: ExitStack) -> Writing:
        """Begin to record the twin. said: further metadata of a recording. Raises CallError."""
        recorder = outputs.record(twin, self.interval_s, stack) if self.needs_recorder else None
        recording = None if self.record is None else begin(self.record, twin, self.interval_s, said, stack)
        return Writing(self, twin, recorder, recording)


class Unwritten(NamedTuple):
    """Files that are not on the disk, or a recording that is not whole, and why not, as far as nobody has said it."""

    names: list[str]
    failures: list[CallError]

    @contextmanager
    def noted(self, path: Path) -> Iterator[None]:
        failed = len(self.failures)
        with outputs.put_off(self.failures, path):
            yield
        if len(self.failures) > failed:
            self.names.append(str(path))


@dataclass(frozen=True)
class Writing:
    files: Files
    twin: Twin
    recorder: Recorder | None
    recording: FileRecording | None

    def write(self, page: Callable[[Path, Recorder], None]) -> Unwritten:
        """Write all files, the report by `page`."""
        files = self.files
        missing = Unwritten([], [])
        from isel_twin.recordings.write import write_trace

        for path, kinds in ((files.steps, (".npz",)), (files.vcd, (".vcd",)), (files.trace, SAMPLES)):
            if path is not None:
                with missing.noted(path):
                    write_trace(path, self.twin.steps, self.recorder, kind_of(path, kinds, bare=True))
        if self.recording is not None and files.record is not None:
            with missing.noted(files.record):
                if not keep(self.recording, files.record):
                    missing.names.append(str(files.record))
        if files.report is not None and self.recorder is not None:
            with missing.noted(files.report):
                page(files.report, self.recorder)
        return missing


def now_in_words() -> str:
    """The wall clock, for the metadata of a recording made in real time."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def begin(record: Path, twin: Twin, interval_s: float, said: Mapping[str, str], stack: ExitStack) -> FileRecording:
    """Begin the recording: in its place or, for another kind, in a temporary folder. Raises CallError."""
    from isel_twin.recordings.recording import FileRecording

    path = record
    if record.suffix.lower() != RECORDING:
        import tempfile

        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="isel-twin-"))
        path = Path(folder) / f"{record.stem}{RECORDING}"
    with call_errors(record):
        recording = FileRecording(path, twin, round(interval_s * SECOND_NS), said)
    stack.callback(recording.close)
    return recording


def keep(recording: FileRecording, record: Path) -> bool:
    """End the recording, and write it as its kind. False if it is incomplete, on a full disk. Raises OSError."""
    whole = recording.close()
    if record.suffix.lower() != RECORDING:
        from isel_twin.recordings.write import export

        export(recording.path, record)
    return whole
