"""`isel-twin convert`: a file of a CAM program as the commands of a controller, of any length in little memory."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import TextIOWrapper
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.printable import unchanged
from isel_twin.cli import options
from isel_twin.cli.jobs import DEFAULT_PART, PartOptions, cam_settings, check_file, job_name, say_cautions, say_zero
from isel_twin.cli.outputs import say
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.cam.reader import Reader
    from isel_twin.cam.settings import CamSettings
    from isel_twin.cam.toolpath import Toolpath


def convert(
    file: Annotated[Path, Parameter(help="NCP, G-code, HPGL or Excellon.")],
    /,
    *,
    controller: options.ControllerName = TwinSpec.controller,
    machine: options.MachineName = MACHINE,
    set: options.Overrides = (),
    cam: options.CamOptions = options.AS_IT_LOOKS,
    part: PartOptions = DEFAULT_PART,
    out: Annotated[Path | None, options.written("Write them here; standard output.", name=("--out", "-o"))] = None,
) -> int:
    """Write a file of a CAM program as commands of a controller, one a line, or as a program of it.

    Zero point, tools, heights and outputs are in the [cam] table of isel-twin.toml or of the machine's folder
    (docs/jobfiles.md). What was read in one of several ways is said on standard error. `run` does the same and carries
    it out.

    Exit code 0 if all of it could be written; else 2, and no file is left.
    """
    from isel_twin.cam.reader import text_lines
    from isel_twin.jobs.job import JobError
    from isel_twin.jobs.toolpaths import Watched, machine_axes, written
    from isel_twin.language import create_language

    if options.is_standard_input(file):
        raise CallError("-: settings stand beside a file; name it")
    check_file(file)
    options.check_writable(out, kept=(file,))
    call = TwinSpec(machine, controller, "kinematic", overrides=options.parse_overrides(set))
    asked = replace(cam.reading(), part=part.lines())
    with call_errors(job_name(file)):
        language = create_language(controller)
        settings = cam_settings(file, call)
        axes = machine_axes(call.fitted())
        reader = _reader(file, asked.form or settings.format or None)

    def read(settings: CamSettings) -> Toolpath:
        with file.open("rb") as source:
            yield from reader.read(text_lines(source), settings)

    told = []
    with _output(out) as into:
        try:
            taken, settings = asked.taken(read, axes, settings)
            watched = Watched(settings, asked.part, by_line=False)
            for line in written(taken, watched, language, controller, axes):
                into.write(f"{line.text}\n")
                if line.caution is not None:
                    told.append(line.caution)
        except JobError as error:
            raise CallError(f"{file}: {error}") from None
    say_zero(file, asked, None if asked.zero is None else settings.zero)
    say_cautions(file, (*watched.cautions, *told))
    if not_made := watched.section.not_made:
        say(f"{file}: {not_made} not made")
    return 0


def _reader(file: Path, form: str | None) -> Reader:
    from isel_twin.cam.reader import HEAD_BYTES, head_of, statements
    from isel_twin.cam.registry import reader_for, reader_named, reader_names

    if form is not None:
        with call_errors(file):
            return reader_named(form)
    try:
        with file.open("rb") as source:
            head = head_of(source.read(HEAD_BYTES))
        reader = reader_for(head, file.suffix)
    except ValueError as error:
        raise CallError(f"{file}: {error}") from None
    if reader is None and not statements(head):
        raise CallError(f"{file}: there is no line of a CAM program in it; a job of commands needs no converting")
    if reader is None:
        raise CallError(
            f"{file}: is in none of the formats {', '.join(reader_names())}; if it is in one, say which by --format"
        )
    return reader


@contextmanager
def _output(file: Path | None) -> Iterator[IO[str]]:
    """The file, which is there when all of it is written, or standard output."""
    from isel_twin.base.files import replacing

    if file is None:
        yield sys.stdout if sys.stdout.isatty() else unchanged(sys.stdout)  # data for a pipe
        return
    with (
        call_errors(file),
        replacing(file) as raw,
        TextIOWrapper(raw, encoding="latin-1", errors="replace", newline="\n") as into,
    ):
        yield into
