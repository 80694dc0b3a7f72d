"""A twin that has been saved and restored is the same twin, to the bit: here, in another twin, in another process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden.digest import load
from golden.session import build, digest_of
from golden.sessions import FILE, session

from isel_twin import Twin
from isel_twin.sampling import TwinSamples
from isel_twin.state import StateError
from isel_twin.trace.recorder import Recorder

READY = ("@0d8000,4000,4000", "@07", "@0R7")
"""Speeds and a reference run of an imc-s8."""
KEPT = load(FILE)


def astray(twin: Twin, draw: np.random.Generator) -> None:
    """Do something that leaves traces everywhere."""
    for _ in range(int(draw.integers(1, 4))):
        match int(draw.integers(6)):
            case 0:
                twin.write(bytes([253, 255, 13, 254][int(draw.integers(4))] for _ in range(2)))
            case 1:
                name = str(draw.choice(sorted(twin.settable)))
                twin.set_input(name, str(draw.choice(twin.settable[name])))
            case 2:
                twin.write(b"@07\r@0A500,2000,300,3000,0,100,0,100\r")
            case 3:
                twin.apply_force(int(draw.integers(3)), float(draw.uniform(-50.0, 50.0)))
            case 4:
                twin.line_speed = not twin.line_speed
            case _:
                twin.write(b"#E1,900\r#DX,0,1,1,1\rL1,X30,Y-9\x01")
        twin.run(float(draw.uniform(0.0, 0.3)))
        twin.read()


def detours(number: int, another: Callable[[], Twin]) -> Callable[[Twin], Twin]:
    """Every now and then the twin is saved, goes astray and is restored; or another goes on, which was elsewhere."""
    draw = np.random.default_rng(number)

    def detour(twin: Twin) -> Twin:
        choice = draw.random()
        if choice < 0.04:
            other = another()
            astray(other, draw)
            other.restore(pickle.loads(pickle.dumps(twin.save())))
            return other
        if choice < 0.2:
            state = twin.save()
            astray(twin, draw)
            twin.restore(state)
        return twin

    return detour


@pytest.mark.parametrize("controller", ["c142", "imc-m", "imc-mp", "imc-s8", "ismif"])
def test_sessions_with_detours_are_those_on_file(controller: str) -> None:
    """Faults, scenarios, noise, bounces, stored programs, reference runs, other machines: golden sessions."""
    for number in range(3, 30, 3):
        name = f"{controller}/kinematic/{number:03}"
        played = session(name)
        assert digest_of(played, detours(number, lambda played=played: build(played, seed=99))) == KEPT[name], name


@pytest.mark.parametrize("name", ["imc-s8/mujoco/003", "imc-mp/mujoco/007", "ismif/mujoco/002"])
def test_sessions_with_physics_and_detours(name: str) -> None:
    played = session(name)
    assert digest_of(played, detours(1, lambda: build(played, seed=99))) == digest_of(played)
