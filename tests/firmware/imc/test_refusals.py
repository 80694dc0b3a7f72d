"""A command is refused before it changes anything: every row of the tables, in whatever state the device may be.

state A --read, admitted--> Refusal          state A
state A --read, admitted--> what to do       state A  --do--> never a Refusal
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from typing import Any

import numpy as np
import pytest

from isel_twin.firmware.imc.commands import CNC, DNC, INITIALISATION, Command
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.replies import Refusal
from isel_twin.testing import Desk

ROWS = [(code, command) for table in (DNC, INITIALISATION, CNC) for code, command in table.items()]
TEXTS = ["Rp", "S0", "Rx", "isel", "x" * 33, "\x07"]
NUMBERS = [-9_000_000, -300, -1, 0, 1, 1, 2, 3, 7, 8, 15, 30, 100, 128, 255, 900, 900, 2000, 8_388_607, 70_000]
SITUATIONS: dict[str, list[str | tuple[str, str]]] = {
    "just switched on": [],
    "not referenced": ["@07"],
    "ready": ["@07", "@0N7"],
    "ready, with A": ["@07", "@08", "@0N7", "@0N8", "@0e2"],
    "ready, X alone, 3D": ["@01", "@0N1", "@0z1"],
    "test mode": ["@07", "@0T1"],
    "IO only": ["@07", "@0IO1"],
    "limit switch struck": ["@07", "@0N7", "@0A-70000,40000,0,900,0,900,0,900"],
    "hood open": ["@07", "@0N7", ("hood", "open")],
    "emergency stop": ["@07", "@0N7", ("estop", "pressed")],
    "after an emergency stop": ["@07", "@0N7", ("estop", "pressed"), ("estop", "released")],
    "hot": [("overtemperature", "hot")],
    "near the end of the counter": ["@07", "@0T1", "@0N7", "@0R7", "@0A8000000,40000,0,900,0,900,0,900", "@0N2"],
}
"""How each comes about: commands, and what the operator does."""


def desk_in(situation: str) -> Desk:
    desk = Desk.of("imc-s8", carriage=(60_000, 48_000, 22_000, 50_000))
    for step in SITUATIONS[situation]:
        if isinstance(step, str):
            desk.query(step)
        else:
            desk.set(*step)
    return desk


def device_of(desk: Desk) -> Device:
    device: Device = desk.controller._device
    return device


def state(desk: Desk) -> list[Any]:
    """Everything a device remembers, and whether it has told anything."""
    device = device_of(desk)
    memory = [
        *[device.settings, device.flash, device.modal, device.axes, device.number, device.safety],
        *[device.port_condition, device.counts, device.now_ns, list(device.referenced), list(device.virtual_zero)],
        *[dict(device.outputs._levels), dict(device.limits._found), dict(device.limits._released_ns)],
    ]
    return [*memory, device.executor.request, device.executor.parked, desk.controller.take()]


def drawn(random: np.random.Generator, command: Command, device: Device) -> str:
    """Parameters, mostly as many as the command wants."""
    if command.parameters is None:
        return str(random.choice(TEXTS))
    wanted = command.parameters(device) if callable(command.parameters) else command.parameters
    count = len(wanted) + int(random.choice([0] * 9 + [1]))
    values = []
    for number in (*wanted, *wanted[:1])[:count]:
        fitting = [n for n in NUMBERS if number.low <= n <= number.high] if random.random() < 0.95 else []
        values.append(str(random.choice(fitting or NUMBERS)))
    return ",".join(values)


@pytest.mark.parametrize("situation", SITUATIONS)
def test_a_refusal_changes_nothing(situation: str) -> None:
    """Nor does what is not refused, until it is done."""
    random = np.random.default_rng(1)
    desk = desk_in(situation)
    before, device = state(desk), device_of(desk)
    for code, command in ROWS * 8:
        text = drawn(random, command, device)
        with contextlib.suppress(Refusal):
            command.admitted(device, command.read(device, text))
        assert state(desk) == before, (code, text)


def test_the_situations_refuse_for_every_reason() -> None:
    """All codes but those of storing (6, 8, G) and stopping (F)."""
    random = np.random.default_rng(2)
    codes = set()
    for desk in map(desk_in, SITUATIONS):
        for _, command in ROWS * 4:
            try:
                command.admitted(
                    device_of(desk), command.read(device_of(desk), drawn(random, command, device_of(desk)))
                )
            except Refusal as refusal:
                codes.add(refusal.code)
    assert codes == set("1234579DHR")


@pytest.mark.parametrize("situation", SITUATIONS)
def test_what_is_done_is_not_refused(situation: str) -> None:
    """Activities are not begun here: they may end by a Refusal."""
    random = np.random.default_rng(3)
    desk, done = desk_in(situation), 0
    for index in random.integers(0, len(ROWS), 400):
        code, command = ROWS[index]
        device = device_of(desk)
        if CNC.get(code) is command and not device.axes:
            continue  # a program runs with axes only
        try:
            arguments = command.admitted(device, command.read(device, drawn(random, command, device)))
        except Refusal:
            continue
        result = command.do(device, *arguments)
        if isinstance(result, Generator):
            result.close()
        done += 1
    assert done > 50


def test_a_refused_move_leaves_a_stopped_one_to_be_resumed() -> None:
    desk = Desk.of("imc-s8", carriage=(60_000, 48_000, 22_000, 50_000))
    assert desk.query("@07") + desk.query("@0N7") == "00"
    desk.start("@0A2000,2000,0,900,0,900,0,900")
    desk.run(0.3)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    for text, reply in [("@0A1,9,0,900,0,900,0,900", "D"), ("@0R8", "3"), ("@0A9000000,900,0,900,0,900,0,900", "1")]:
        assert desk.query(text) == reply
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == 2000
