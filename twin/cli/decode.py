"""`isel-twin decode`: the meaning of bytes on the line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli.options import STANDARD_INPUT, STREAMS, is_standard_input, standard_input
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.jobs.decode import Piece, Row
    from isel_twin.language import Language
    from isel_twin.recordings.reading import Recorded

CHUNK_BYTES = 1 << 16  # read at once, so that a file of any size takes the same memory
MARKED_BYTES = 1 << 26  # largest file of marked lines: 64 MiB
_FILE_NAME = re.compile(r".*/.*|[\w-][\w. -]*\.[A-Za-z]\w{0,7}", re.DOTALL)  # rather than a command (jobs/1)


def decode(
    source: Annotated[str, Parameter(help='File of bytes, or text as it is typed; "-" is standard input.')],
    *,
    controller: Annotated[
        str, Parameter(help=f"Name of a controller; what a recording says, or {TwinSpec.controller}.")
    ] = "",
    sent: Annotated[bool, Parameter(help="The host has sent it. The default.")] = False,
    received: Annotated[bool, Parameter(help="The controller has sent it.")] = False,
    marked: Annotated[bool, Parameter(help="Lines of text: > sent by the host, < received; <13> is a byte.")] = False,
    text: Annotated[bool, Parameter(help="The argument is text, whether there is such a file or not.")] = False,
    json: Annotated[bool, Parameter(help="One JSON object a message.")] = False,
    to: Annotated[
        Literal["gcode", "ncp"] | None, Parameter(help="A job file of the motions instead: what the tool has done.")
    ] = None,
    machine: Annotated[
        str, Parameter(help=f"With --to: the machine, for its steps a mm; what a recording says, or {MACHINE}.")
    ] = "",
) -> int:
    """Explain the bytes of a line: one row for each message, with all bytes.

    A file is read as bytes of one direction. Text is taken as in a job file: a command is sent with its end, <253> is a
    byte. A recording (.mcap) is explained with the times of its messages, both directions. Every controller with a
    language can be explained.

    With --to what a host has sent is carried out without physics, and its motions become a job file in mm from the zero
    of the machine: cuts at the speeds they had, arcs where they were arcs (docs/jobfiles.md).
    """
    if to is not None and (json or received):
        raise CallError("--to: a file is made of what the host has sent; leave --json and --received out")
    if sent + received + marked > 1:
        raise CallError("--sent, --received, --marked: only one of them can be so")
    from isel_twin.jobs.decode import Piece, explain
    from isel_twin.language import create_language
    from isel_twin.recordings.compare import traffic

    recorded = _recording(source) if not text else None
    if recorded is not None and sent + received + marked:
        raise CallError(f"{source}: a recording says itself who has sent what; leave --sent, --received, --marked out")
    controller = controller or (recorded.controller if recorded is not None else "") or TwinSpec.controller
    with call_errors():
        language = create_language(controller)
    if language is None:
        raise CallError(f"controller {controller!r} has no language, which would say what its bytes mean")
    with call_errors(source):
        if recorded is None:
            pieces = _pieces(source, text, marked, not received, to is not None, language, controller)
        else:
            pieces = (Piece(data, by_host, time_ns) for time_ns, data, by_host, _ in traffic(recorded))
        first = next(pieces, None)  # find errors of the source before anything is printed
    if to is not None:
        machine = machine or (recorded.metadata.get("machine", "") if recorded is not None else "") or MACHINE
        _tell_file(to, source, chain([first] if first else [], pieces), TwinSpec(machine, controller))
        return 0
    timed = recorded is not None
    if not json:
        print(f"{'no':>6} {'time / s' if timed else 'offset':>{14 if timed else 8}}  dir   {'text':<32}  explanation")
    for row in explain(chain([first] if first else [], pieces), language):
        print(_json(row) if json else _line(row, timed), flush=source == STANDARD_INPUT)
    return 0


def _tell_file(to: str, source: str, pieces: Iterator[Piece], spec: TwinSpec) -> None:
    """Print the file. Raises CallError before the first line if the host has moved nothing."""
    from isel_twin.cam.files import WRITERS
    from isel_twin.cam.toolpath import Arc, Element, Line
    from isel_twin.jobs.recovered import recovered

    with call_errors():
        path = recovered((piece.data for piece in pieces if piece.sent), spec)
    begin: list[Element] = []
    while not (begin and isinstance(begin[-1], Line | Arc)):
        element = next(path, None)
        if element is None:
            raise CallError(
                f"{source}: a host that sends this moves nothing but reference runs; a job file becomes a session by "
                "run --record"
            )
        begin.append(element)
    for line in WRITERS[to](chain(begin, path)):
        print(line)


def _recording(source: str) -> Recorded | None:
    """The recording in a file; None if it is something else. Raises CallError."""
    path = Path(source)
    if is_standard_input(path) or not _exists(path) or not path.is_file():
        return None
    from isel_twin.recordings.container import MAGIC
    from isel_twin.recordings.reading import read

    with call_errors(source):
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                return None
        return read(path)


def _pieces(
    source: str, is_text: bool, marked: bool, sent: bool, carried_out: bool, language: Language, controller: str
) -> Iterator[Piece]:
    from isel_twin.cli.outputs import say
    from isel_twin.jobs import decode

    path = Path(source)
    if not is_text and (source == STANDARD_INPUT or _exists(path)):
        if path.is_dir():
            raise CallError(f"{source}: is a folder, not a file")
        if path.is_file() and (found := _another(path, language, controller)):
            if carried_out:
                raise CallError(found)
            say(found)  # its bytes are still explained
        chunks = _chunks(path)
        if not marked:
            return (decode.Piece(chunk, sent) for chunk in chunks)
        return _of_marked(STREAMS.get(source, source), chunks, language, controller)
    if not is_text and _FILE_NAME.fullmatch(source):
        raise CallError(f"{source}: there is no such file; if it is text that goes over the line, add --text")
    if marked:
        return _of_marked("text", [source.encode("utf-8", "surrogateescape")], language, controller)
    return iter(decode.typed(source, sent, language, controller))


def _another(path: Path, language: Language, controller: str) -> str:
    """What a file is that looks like a program or a job of another controller, or of a CAM program; "" otherwise."""
    from isel_twin.cam.reader import head_of
    from isel_twin.cam.registry import reader_for
    from isel_twin.jobs.foreign import check_others
    from isel_twin.jobs.job import JobError

    with path.open("rb") as file:
        data = file.read(CHUNK_BYTES)
    try:
        check_others(data.decode("latin-1"), language, controller)
        reader = reader_for(head_of(data))
    except JobError as error:
        return f"{path}: {error}"
    except ValueError:  # a drawing, or no text: bytes can be anything
        return ""
    if reader is None:
        return ""
    return f"{path}: is {reader.title}, a file of a CAM program; run plays it, convert writes it as commands"


def _of_marked(name: str, chunks: Any, language: Language, controller: str) -> Iterator[Piece]:
    from isel_twin.jobs.decode import DecodeError, marked
    from isel_twin.jobs.job import JobError, decode_job

    data = bytearray()
    for chunk in chunks:
        data += chunk
        if len(data) > MARKED_BYTES:
            raise CallError(f"{name}: is longer than {MARKED_BYTES >> 20} MiB; explain it in parts")
    try:
        return iter(list(marked(decode_job(bytes(data)), language, controller)))
    except (DecodeError, JobError) as error:
        raise CallError(f"{name}: {error}") from None


def _exists(path: Path) -> bool:
    """True if the file exists; text may be too long for a name, or contain a byte 0."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _chunks(path: Path) -> Iterator[bytes]:
    """The content of a file in pieces, or of standard input as it comes."""
    if is_standard_input(path):
        yield from iter(lambda: standard_input().read1(CHUNK_BYTES), b"")
        return
    with path.open("rb") as file:
        yield from iter(lambda: file.read(CHUNK_BYTES), b"")


def _line(row: Row, timed: bool) -> str:
    where: str | int = row.offset
    if timed:
        where = "" if row.time_ns is None else f"{row.time_ns / SECOND_NS:.6f}"
    by = "host" if row.sent else "twin"
    return f"{row.number:>6} {where:>{14 if timed else 8}}  {by}  {row.text:<32}  {row.explanation}".rstrip()


def _json(row: Row) -> str:
    from json import dumps

    told = {
        "number": row.number, "offset": row.offset, "sent": row.sent, "hex": row.data.hex(), "text": row.text,
        "explanation": row.explanation, "complete": row.complete,
    }  # fmt: skip
    return dumps(told if row.time_ns is None else {**told, "time_s": row.time_ns / SECOND_NS})
