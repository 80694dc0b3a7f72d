"""What `warm_up` leaves uncompiled, a host waits for: nothing that a session with a twin calls."""

from __future__ import annotations

import json
import subprocess
import sys

from isel_twin.controller import controller_names

SESSIONS = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
from isel_twin import Twin
from isel_twin.core.warm import warm_up
from isel_twin.language import MoveSettings, create_language

def called():
    ours = (one for one in gc.get_objects() if isinstance(one, Dispatcher) and one.__module__.startswith("isel_twin"))
    return {f"{one.__module__}.{one.__name__}{types}" for one in ours for types in one.overloads}

plants, controllers = ("kinematic", "mujoco"), sys.argv[1:]
for plant in plants:
    warm_up(plant, controllers=controllers)
warm = called()
for plant in plants:
    for controller in controllers:
        language = create_language(controller)
        machine = "4030-servo" if controller in ("gmi99", "bwo900") else "4030"
        uneven = {"imperfections.cyclic_error": machine == "4030", "probe.enabled": plant == "kinematic"}
        twin = Twin(machine, controller=controller, plant=plant, start_mm=(1.0, 1.0, 1.0), overrides=uneven)
        twin.watch_margin()
        for command in (*language.reference(), *language.move((400, 200, 100), MoveSettings(speed_hz=2000))):
            twin.write(command)
            twin.run(0.3)
        twin.write(language.break_off())
        twin.run(0.1)
        twin.margin, twin.current_fraction
print(json.dumps(sorted(called() - warm)))
"""


def test_sessions_with_every_controller_compile_nothing_more() -> None:
    command = [sys.executable, "-c", SESSIONS, *controller_names()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == []
