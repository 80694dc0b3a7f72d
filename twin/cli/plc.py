"""`isel-twin plc assemble|disassemble|explain|load`: programs of the PLC in a controller."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli.options import ControllerName, Json, check_writable, is_standard_input, standard_input, written
from isel_twin.cli.outputs import say_json

if TYPE_CHECKING:
    from isel_twin.firmware.plc import PlcProgram

plc = App(name="plc", help="Programs of a controller's PLC: STEP 5 text to bytes and back, explained, loaded.")

Source = Annotated[Path, Parameter(help='STEP 5 text, or an image that was assembled; "-" is standard input.')]


@plc.command
def assemble(
    source: Source,
    *,
    out: Annotated[
        Path | None, written("File for the image; without it the bytes are printed.", name=("--out", "-o"))
    ] = None,
    json: Json = False,
) -> int:
    """Assemble a program: text, one instruction a line, to an image for a controller.

    Without --out the bytes are printed in hexadecimal.
    """
    check_writable(out, kept=(source,))
    image = _program(source).image
    if out is not None:
        from isel_twin.base.files import atomic_write

        with call_errors(out):
            atomic_write(out, image)
    if json:
        say_json({"out": None if out is None else str(out), "bytes": len(image), "image": image.hex()})
    else:
        print(image.hex(" ").upper() if out is None else f"{out}: {len(image)} bytes")
    return 0


@plc.command
def disassemble(source: Source) -> int:
    """Print the text of an image; assembled again it gives the same bytes."""
    from isel_twin.firmware.plc.assembler import disassemble as text_of

    with call_errors(source):
        print(text_of(_program(source)), end="")
    return 0


@plc.command
def explain(source: Source, *, json: Json = False) -> int:
    """Print a program with a short explanation of each instruction."""
    from isel_twin.firmware.plc.assembler import explain as explained

    with call_errors(source):
        rows = explained(_program(source))
    if json:
        say_json([{"line": line, "words": words} for line, words in rows])
        return 0
    width = max(len(line) for line, _ in rows)
    for line, words in rows:
        print(f"{line:{width}}  {words}")
    return 0


@plc.command
def load(source: Source, *, controller: ControllerName) -> int:
    """Print the lines of a job that loads a program into a controller, for `isel-twin run` or a host."""
    from isel_twin.controller import offers
    from isel_twin.language import LoadsPlc, create_language, language_names

    with call_errors():
        language = create_language(controller)
    if not offers(language, LoadsPlc):
        able = [name for name in language_names() if offers(create_language(name), LoadsPlc)]
        raise CallError(f"controller {controller!r} takes no PLC program over its line; {', '.join(able)} does")
    for line in language.plc_lines(_program(source).image):
        print(line)
    return 0


def _program(source: Path) -> PlcProgram:
    """The program of a file, text or image. Raises CallError."""
    from isel_twin.firmware.plc.assembler import AssemblyError
    from isel_twin.firmware.plc.assembler import assemble as assembled
    from isel_twin.firmware.plc.image import MAGIC, PlcProgram

    name = "-" if is_standard_input(source) else str(source)
    with call_errors(source):
        data = standard_input().read() if is_standard_input(source) else source.read_bytes()
    try:
        return PlcProgram.read(data) if data.startswith(MAGIC) else assembled(data.decode())
    except AssemblyError as error:
        raise CallError(f"{name}:{error.line}: {error}") from None
    except UnicodeDecodeError:
        raise CallError(f"{name}: neither STEP 5 text nor an image of a program") from None
    except ValueError as error:
        raise CallError(f"{name}: {error}") from None
