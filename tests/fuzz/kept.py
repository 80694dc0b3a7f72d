"""What the product has written itself, and machines of others: flash images, journals, caches, registries, states."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, flock
from pathlib import Path
from random import Random
from typing import Any

from isel_twin.bridge.fmu import slaves
from isel_twin.bridge.serve import registry
from isel_twin.core.spec import TwinSpec
from isel_twin.firmware import flash_image
from isel_twin.firmware.bwo900 import memory
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.gmi99 import settings as gmi99
from isel_twin.firmware.imc import settings as imc
from isel_twin.machine import load_machine
from isel_twin.many.identification.replays import Replays
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.table import Table, journal_of
from isel_twin.testing import Desk
from tests.fuzz.mutate import Mutation, either, in_turn, mutated, renumbered, replanted, reshaped, restructured, retold
from tests.fuzz.trial import Reader
from tests.in_process import isel_twin

MODELS = Path(__file__).parents[2] / "models"
MODEL = MODELS / "4030" / "4030.xml"
SLOW = 20  # files
NOTHING = "(?!)"  # what stands behind a digest is refused at once, which is what the digest is for
JOB = "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30\n@0P => *\n"
SWEEP = '[sweep]\njob = "job.txt"\nplant = "kinematic"\nseeds = 2\n[machine]\n'
SWEEP += '"payload.mass" = { values = [0, 4], unit = "kg" }\n'


# ---- flash images --------------------------------------------------------------------------------------------------


def _imc() -> bytes:
    """A stored program of a reference run, a move and a pause."""
    desk = Desk.of("imc-s8")
    for command in ("@07", "@0IJ50", "@0i", "77", "0 100,200,300,400,0,0,0,0", "5 10", "9"):
        desk.send(command.encode() + b"\r")
        desk.run(0.5)
    assert desk.flash is not None
    return desk.flash


def _gmi99() -> bytes:
    return gmi99.encode(gmi99.Stored())


def _flash(controller: str, sample: Callable[[], bytes], after: bytes, decode: Callable[[bytes], Any]) -> Reader:
    """after: what a host then asks for."""

    def read(path: Path) -> None:
        image = path.read_bytes()
        desk = Desk.of(controller, flash=image)
        desk.send(after)
        desk.run(0.2)
        flash_image.decode(image.partition(b"\n")[0][:-8], image)
        if decode(image) is None:
            raise ValueError("no command has stored that")

    return Reader(
        f"flash-{controller}", lambda _: sample(), read, in_turn(mutated, _sealed, _sealed, _sealed), "damaged"
    )


def _sealed(image: bytes, seed: int) -> bytes:
    """Other content under a checksum that fits it."""
    head, _, body = image.partition(b"\n")
    body = in_turn(reshaped, renumbered)(body, seed // 4)
    return head[:-8] + b"%08x\n" % zlib.crc32(body) + body


def _sealed_memory(image: bytes, seed: int) -> bytes:
    """The same of a BWO 900: other parameters, statuses, programs."""
    parameters, store, _ = memory.read(image)
    draw = Random(seed)
    head = {
        "q": [list(item) for item in parameters.items()],
        "status": [list(item) for item in parameters.statuses()],
        "programs": [],
    }
    texts: list[bytes] = []
    for name, program in sorted(store.items()):
        packed = zlib.compress(restructured(program.text, seed) if draw.random() < 0.2 else program.text, 1)
        texts.append(packed)
        head["programs"].append([name, len(packed)])
    packed = zlib.compress(in_turn(reshaped, renumbered)(json.dumps(head).encode(), seed // 4), 1)
    rest = b"".join((*texts, packed, len(packed).to_bytes(memory.SIZE, "little")))
    return memory.MAGIC + zlib.crc32(rest).to_bytes(memory.SIZE, "little") + rest


def _memory(_: Path) -> bytes:
    parameters, store, _fault = memory.read(None)
    texts = {"P1": ["N10 G90 G1 F300 X10 Y5", "N20 M30"], "Z81": ["N5 X1"], "P20": [f"N{n} X{n}" for n in range(1, 90)]}
    store = Store({name: StoredProgram.of(name, text) for name, text in texts.items()})
    return memory.Memory(parameters, store).image()


def _of_memory(path: Path) -> None:
    image = path.read_bytes()
    desk = Desk.of("bwo900", flash=image)
    desk.send(b"\r\nD\r\nK1:P8800: 1\r\nK1:P8683: 2\r\nK1:P8684: 1\r\n#\r\n\x04\r\n")
    desk.run(0.2)
    if image[4:8] != zlib.crc32(image[8:]).to_bytes(4, "little"):
        raise ValueError("damaged")
    if memory.read(image)[2]:
        raise ValueError("nothing that it has stored")


# ---- machines ------------------------------------------------------------------------------------------------------


def _machine_file(name: str) -> Callable[[Path], bytes]:
    return lambda _: (MODELS / name / "machine.toml").read_bytes()


def _machine(based_on: str) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        folder = path.with_suffix("")
        folder.mkdir(exist_ok=True)
        for other in (MODELS / based_on).glob("*.xml"):
            (folder / other.name).write_bytes(other.read_bytes())
        (folder / "machine.toml").write_bytes(path.read_bytes())
        controller = {"4030-servo": "gmi99"}.get(based_on, "imc-s8")
        twin = TwinSpec(load_machine(folder), controller=controller, plant="kinematic").build()
        twin.run(0.02)

    return read


def _model(path: Path) -> None:
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    for name in ("machine.toml", "scene.xml"):
        (folder / name).write_bytes((MODELS / "4030" / name).read_bytes())
    (folder / "4030.xml").write_bytes(path.read_bytes())
    twin = TwinSpec(load_machine(folder), plant="mujoco").build()
    twin.run(0.005)


# ---- journals, registries, caches ------------------------------------------------------------------------------------


def _plan(folder: Path) -> Path:
    (folder / "job.txt").write_text(JOB)
    plan = folder / "plan.toml"
    plan.write_text(SWEEP)
    return plan


def _rows(folder: Path) -> bytes:
    done = isel_twin("sweep", _plan(folder), "--workers", "1")
    assert done.returncode == 0, done
    import pyarrow.parquet as pq

    rows = pq.read_table(folder / "plan.parquet").to_pylist()
    return "".join(json.dumps(row) + "\n" for row in rows).encode()


def _journal(path: Path) -> None:
    plan = load_plan(_plan(path.parent))
    file = path.parent / "plan.parquet"
    file.unlink(missing_ok=True)
    journal_of(file).write_bytes(path.read_bytes())
    with Table(file, plan, points(plan)) as table:
        kept = len(table.rows)
    if not kept:
        raise ValueError("no row is left")


def _lines_reshaped(data: bytes, seed: int) -> bytes:
    """One line of JSON, of many, is of another shape."""
    lines = data.splitlines()
    at = Random(seed).randrange(len(lines))
    lines[at] = reshaped(lines[at], seed)
    return b"".join(line + b"\n" for line in lines)


ENTRY = {
    "pid": 4711, "command": "serve", "machine": "4030", "controller": "imc-s8",
    "ports": [{"kind": "pty", "address": "/tmp/imc", "device": "/dev/pts/7"}, {"kind": "tcp", "address": "[::1]:9"}],
}  # fmt: skip


def _registry(path: Path) -> None:
    """Listed by `isel-twin ports`, while a server has it locked."""
    from tests.fuzz.shown import check_terminal

    with _environment(XDG_RUNTIME_DIR=str(path.parent)):
        ports = registry.folder()
        ports.mkdir(mode=0o700, parents=True, exist_ok=True)
        entry = ports / "4711-0.json"
        entry.write_bytes(path.read_bytes())
        with entry.open() as held:
            flock(held, LOCK_EX)
            told = isel_twin("ports")
            check_terminal(told)
            told = isel_twin("ports", "--json")
            check_terminal(told)
        if not json.loads(told.stdout):
            raise ValueError("nothing is listed")


@contextmanager
def _environment(**variables: str) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _replays(_: Path) -> bytes:
    return b"".join(json.dumps({"key": key, "values": [1.0, 2.5, -3.0]}).encode() + b"\n" for key in "abcdefgh")


def _of_replays(path: Path) -> None:
    if not Replays(journal=path)._known:
        raise ValueError("no replay is left")


# ---- states ----------------------------------------------------------------------------------------------------------


def _slave() -> slaves.StepsTwin:
    slave = slaves.StepsTwin(instance_name="steps", resources=".")
    slave.exit_initialization_mode()
    return slave


def _fmu_state(_: Path) -> bytes:
    slave = _slave()
    slave.do_step(0.0, 0.1)
    return slave._get_fmu_state()


def _fmu_restored(path: Path) -> None:
    slave = _slave()
    slave._set_fmu_state(path.read_bytes())
    slave.do_step(slave.time, 0.01)


_toml: Mutation = in_turn(mutated, retold, retold, restructured)

KEPT = (
    _flash("imc-s8", _imc, b"@0V\r@0P\r@0S\r", imc.decode),
    _flash("gmi99", _gmi99, b"Q7;1\r", gmi99.decode),
    Reader("flash-bwo900", _memory, _of_memory, in_turn(mutated, *[_sealed_memory] * 3), "damaged"),
    Reader("4030.toml", _machine_file("4030"), _machine("4030"), _toml, "not a TOML file", SLOW),
    Reader("4030-servo.toml", _machine_file("4030-servo"), _machine("4030-servo"), _toml, "not a TOML file", SLOW),
    Reader(
        "4030.xml",
        lambda _: MODEL.read_bytes(),
        _model,
        in_turn(either, *[replanted] * 3),
        "XML: ",
    ),
    Reader("plan.parquet.journal", _rows, _journal, in_turn(either, *[_lines_reshaped] * 3), "no row", SLOW),
    Reader("fit.journal", _replays, _of_replays, in_turn(either, *[_lines_reshaped] * 3), "no journal|no replay"),
    Reader(
        "registry", lambda _: json.dumps(ENTRY).encode(), _registry, in_turn(either, *[reshaped] * 3), "nothing", SLOW
    ),
    Reader("fmu-state", _fmu_state, _fmu_restored, mutated, NOTHING, SLOW),
)
