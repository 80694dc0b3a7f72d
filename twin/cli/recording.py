"""`--record`: what `serve` and `run` have in common about it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.recordings.recording import FileRecording

RecordPath = Annotated[
    Path | None,
    Parameter(help="Keep all that happens: .mcap, as it goes; or at the end .npz (steps), .vcd, .parquet, .csv."),
]

MCAP = ".mcap"


def check_record(record: Path | None) -> None:
    """Raise CallError unless the name says what is to be written, and it can be."""
    if record is None or record.suffix == MCAP:
        return
    from isel_twin.recordings.write import trace_kind

    try:
        trace_kind(record)
    except ValueError as error:
        text = str(error).replace("must end in ", f"must end in {MCAP}, ")
        raise CallError(f"record {text}", option=True) from None


def begin(record: Path, twin: Twin, interval_s: float, said: Mapping[str, str], stack: ExitStack) -> FileRecording:
    """Begin the recording: in its place, or, if it is to be of another kind, in the folder for temporary files.

    Raises CallError.
    """
    from isel_twin.recordings.recording import FileRecording

    path = record
    if record.suffix != MCAP:
        import tempfile

        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="isel-twin-"))
        path = Path(folder) / f"{record.stem}{MCAP}"
    with call_errors(record):
        recording = FileRecording(path, twin, round(interval_s * SECOND_NS), said)
    stack.callback(recording.close)
    return recording


def keep(recording: FileRecording, record: Path) -> bool:
    """End the recording; of another kind, write it as that. False if there was no room for some of it.

    Raises OSError.
    """
    whole = recording.close()
    if record.suffix != MCAP:
        from isel_twin.recordings.export import export

        export(recording.path, record, record.suffix)
    return whole
