"""What `run` and `drive` write of a job; one file that cannot be written costs neither the verdict nor another file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError
from isel_twin.cli import outputs
from isel_twin.cli.options import check_kind, check_writable
from isel_twin.cli.recording import begin, check_record, keep

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.recorder import Recorder
    from isel_twin.recordings.recording import FileRecording

MOST_SAMPLES = 100_000_000
"""Samples of a trace beyond which a job is not begun: ten gigabytes, and two hours to take them."""

StepsPath = Annotated[Path | None, Parameter(help="Write the step stream (npz: t_ns, delta).")]
VcdPath = Annotated[Path | None, Parameter(help="Write step, direction, levels and positions (VCD).")]
TracePath = Annotated[Path | None, Parameter(help="Write samples of counters, positions, levels (.parquet, .csv).")]


@dataclass(frozen=True)
class Files:
    """The files that a call asks for."""

    steps: Path | None
    vcd: Path | None
    trace: Path | None
    report: Path | None
    record: Path | None
    interval_s: float
    """Virtual time between two samples."""

    @property
    def needs_recorder(self) -> bool:
        """Some of them are made of samples that are kept in memory."""
        return any(path is not None for path in (self.vcd, self.trace, self.report))

    @property
    def sampled(self) -> bool:
        """Some of them have samples."""
        return self.needs_recorder or self.record is not None

    @property
    def needs_stream(self) -> bool:
        """Some of them need the whole step stream."""
        return self.needs_recorder or self.steps is not None

    def check(self, *kept: Path | None) -> None:
        """Raise CallError unless all of them can be written, without replacing a file that the call needs (`kept`)."""
        check_writable(self.steps, self.vcd, self.trace, self.report, self.record, kept=kept)
        self.kinds()
        if self.report is not None and self.report.suffix.lower() == ".png" and find_spec("matplotlib") is None:
            raise CallError(
                f"report {self.report}: a picture needs matplotlib: pip install 'isel-twin[report]'", option=True
            )
        check_record(self.record)

    def kinds(self) -> tuple[str, str, str]:
        """The kinds of steps, vcd and trace, as their names say. Raises CallError."""
        return (
            check_kind("steps", self.steps, ".npz"),
            check_kind("vcd", self.vcd, ".vcd"),
            check_kind("trace", self.trace, ".parquet", ".csv"),
        )

    def begin(self, twin: Twin, said: Mapping[str, str], stack: ExitStack) -> Writing:
        """Begin to keep what the twin does. said: what a recording says of itself. Raises CallError."""
        recorder = outputs.record(twin, self.interval_s, stack) if self.needs_recorder else None
        recording = None if self.record is None else begin(self.record, twin, self.interval_s, said, stack)
        return Writing(self, twin, recorder, recording)


@dataclass(frozen=True)
class Writing:
    """Files in the making."""

    files: Files
    twin: Twin
    recorder: Recorder | None
    recording: FileRecording | None

    def write(self, page: Callable[[Path, Recorder], None]) -> bool:
        """Write all of them, `page` the report; return whether the recording is whole.

        Raises the last CallError when all others have been written.
        """
        files, whole = self.files, True
        failures: list[CallError] = []
        from isel_twin.recordings.write import write_trace

        for path, kind in zip((files.steps, files.vcd, files.trace), files.kinds(), strict=True):
            if path is not None:
                with outputs.put_off(failures, path):
                    write_trace(path, self.twin, self.recorder, kind)
        if self.recording is not None and files.record is not None:
            with outputs.put_off(failures, files.record):
                whole = keep(self.recording, files.record)
        if files.report is not None and self.recorder is not None:
            with outputs.put_off(failures, files.report):
                page(files.report, self.recorder)
        outputs.tell(failures)
        return whole
