"""`isel-twin export`: a recording as a file of another kind."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import call_errors
from isel_twin.cli.options import RECORDING, TRACES, Json, check_writable, written


def export(
    recording: Annotated[Path, Parameter(help="File that --record NAME.mcap has made.")],
    out: Annotated[
        Path,
        written(
            "What to write: .npz (steps), .vcd, .parquet, .csv (samples), .mcap (for viewers).", RECORDING, *TRACES
        ),
    ],
    /,
    *,
    json: Json = False,
) -> int:
    """Write a recording as a file for other tools: the same that `--record OUT` would have written.

    OUT.mcap is for viewers: the machine in 3D (Foxglove, Lichtblick), numbers with the names of their axes, events, and
    the times of the wall clock where the session had one (`serve`, `tap`). With the extra `trace` Foxglove's messages
    are Protocol Buffers, else JSON.

    An incomplete recording (a killed process, a full disk) is written as far as it goes.
    """
    from isel_twin.cli.outputs import say, say_json
    from isel_twin.recordings import write

    check_writable(out, kept=(recording,))
    with call_errors(recording):
        whole = write.export(recording, out)
    if not whole:
        say(f"{recording}: has no end, it was cut off; {out} has what there is")
    if json:
        say_json({"recording": str(recording), "out": str(out), "whole": whole})
    return 0
