"""What is kept over a power cut: images read back, images that are damaged, and what a key press costs."""

from __future__ import annotations

import json
import pickle
import random
import tracemalloc
import zlib
from time import process_time

import pytest

from isel_twin.firmware.bwo900.memory import MAGIC, SIZE, Memory, read
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram


def full(blocks: int = 50) -> tuple[Parameters, Store]:
    """Parameters, their status, and some programs, one of them empty."""
    parameters = Parameters()
    for number, value in ((100, 1.5), (8_800, 7.0), (12_004, 6_000.0), (159, -0.1)):
        parameters.write(number, value)
    parameters.write(500, None)
    parameters.set_status(159, 0x0102)
    draw = random.Random(1)
    lines = [f"N{n + 1} X{draw.random() * 100:.3f} Y{draw.random() * 100:.3f}" for n in range(blocks)]
    texts = {"P1": ["N1 M30"], "P20": lines, "Z81": ["N5 X1 ; \xe4 \xf6"], "P3": []}
    return parameters, Store({name: StoredProgram.of(name, text) for name, text in texts.items()})


def kept(parameters: Parameters, store: Store) -> object:
    """All that an image has to hold."""
    programs = {name: (program.name, list(program.blocks)) for name, program in store.items()}
    return dict(parameters.items()), dict(parameters.statuses()), programs


def test_an_image_gives_back_what_it_was_made_of() -> None:
    parameters, store = full()
    again, programs, fault = read(Memory(parameters, store).image())
    assert not fault
    assert kept(again, programs) == kept(parameters, store)


def test_an_image_follows_every_change() -> None:
    """New programs, other ones of the same name, none: as a memory that has never made an image."""
    parameters, store = full()
    memory = Memory(parameters, store)
    for change in range(5):
        match change:
            case 1:
                store["P1"] = StoredProgram.of("P1", ["N1 X5", "N2 M30"])
            case 2:
                store["P10"] = StoredProgram.of("P10", ["N1 Y5"])
            case 3:
                del store["P20"]
            case 4:
                parameters.write(100, 2.5)
        image = memory.image()
        assert image == Memory(parameters, store).image()
        assert kept(*read(image)[:2]) == kept(parameters, store)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_image_is_noticed(seed: int) -> None:
    """One byte is another, or the end is missing: a new control that says so, and no exception."""
    draw = random.Random(seed)
    image = bytearray(Memory(*full()).image())
    if seed % 4:
        image[draw.randrange(len(image))] ^= draw.randrange(1, 256)
    else:
        del image[draw.randrange(len(image)) :]
    assert read(bytes(image))[2]
    assert not read(bytes(image))[1]


NONE: dict[str, object] = {"q": [], "status": [], "programs": []}


@pytest.mark.parametrize(
    "head",
    [
        *([], 7, {}, {**NONE, "q": 7}, {**NONE, "q": [[float("inf"), 1.0]]}, {**NONE, "status": [[float("inf"), 1]]}),
        *({**NONE, "q": [[170, float("inf")]]}, {**NONE, "q": [[60_000, 1.0]]}),
        *({**NONE, "programs": [["P1", "all"]]}, {**NONE, "programs": [["P1", 3]]}, {**NONE, "programs": [[7, 0]]}),
    ],
)
def test_a_head_of_another_program_is_noticed_though_its_checksum_is_right(head: object) -> None:
    packed = zlib.compress(json.dumps(head).encode())
    rest = packed + len(packed).to_bytes(SIZE, "little")
    assert read(MAGIC + zlib.crc32(rest).to_bytes(4, "little") + rest)[2]


def test_a_program_that_swells_beyond_any_text_is_noticed_before_it_does() -> None:
    """Deflate makes up to 1030 bytes of one; the control's own makes 230 of equal lines, which are read."""
    assert not read(Memory(Parameters(), Store(P1=StoredProgram.of("P1", [""] * 100_000))).image())[2]
    bomb = zlib.compress(bytes(100_000_000), 9)
    head = zlib.compress(json.dumps({**NONE, "programs": [["P1", len(bomb)]]}).encode())
    rest = bomb + head + len(head).to_bytes(SIZE, "little")
    tracemalloc.start()
    assert read(MAGIC + zlib.crc32(rest).to_bytes(4, "little") + rest)[2]
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 80_000_000


def test_the_state_of_a_control_does_not_grow_by_its_image() -> None:
    memory = Memory(*full(blocks=5_000))
    before = len(pickle.dumps(memory))
    image = memory.image()
    assert len(pickle.dumps(memory)) == before
    assert pickle.loads(pickle.dumps(memory)).image() == image


def test_a_key_press_does_not_compress_the_programs_again() -> None:
    """A program of 2 MB: 20 ms the first time; then the parameters alone."""
    parameters, store = full(blocks=100_000)
    memory = Memory(parameters, store)
    began = process_time()
    memory.image()
    first = process_time() - began
    costs = []
    for press in range(5):
        parameters.write(8_684, float(press))
        began = process_time()
        memory.image()
        costs.append(process_time() - began)
    assert min(costs) < first / 5
