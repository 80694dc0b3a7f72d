"""Compiles the physics before it is needed, so that no host waits for its first reply.

numba compiles a function at its first call and caches the result beside the package: seconds on a new installation,
later a fraction of one. `warm_up` calls every compiled function that a twin can use.

The compiled code does not depend on the machine: ticks are int64 and int8, set points int32, and all drives are records
of one type. tests/test_warm.py plays sessions with every controller that compile nothing more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.compile_watch import log_compiling, told_of_compiling
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import Compiles, PluginError, controller_names, create_controller, offers
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.stability import limit_rad_s
from isel_twin.drives.stage import Stage
from isel_twin.machine import load_machine, with_overrides
from isel_twin.motion import StepRun, circle, line, trapezoid
from isel_twin.motion.joined import joined
from isel_twin.motion.pieces import chain, piece
from isel_twin.plant import Plant, Sampled, Threshold
from isel_twin.plant.touch import TARGET, Felt


def warm_up(plant: str, tell: Callable[[str], None] = log_compiling, controllers: Iterable[str] = ()) -> None:
    """Load or compile all that a twin with this plant ("mujoco" or "kinematic") and one of these controllers needs."""
    with told_of_compiling(tell):
        time_law = trapezoid(2000, 10_000, 400, 100_000)  # its ramps have 499 ticks
        for path in (line((2000, 7, 0, 0)), circle(2000, 0, 250, 0, 1, 1, clockwise=False)):
            t_ns, delta = StepRun(path, time_law, 0).window(0, 2000)
        machine = _plant(plant)
        machine.set_power(stages=True, brake_released=True, lowering=True)
        until_ns = 2 * MILLISECOND_NS
        if isinstance(machine, Sampled):
            machine.sample_every(MILLISECOND_NS)
        machine.advance(until_ns, *_up_to(until_ns, t_ns, delta))
        if plant == "mujoco":
            limit_rad_s(MOTORS["23HS32-4004S"], Stage(supply_v=48.0, current_a=4.2), Screw(), 0.0)
        machine.advance(2 * until_ns, np.array([2 * until_ns]), np.ones((1, 4), dtype=np.int32), lead_ns=until_ns)
        machine.watch_margin()
        Felt(load_machine("4030"), np.zeros(0, TARGET), 0.0, 0.0).take(np.zeros(len(CARRIAGES)))  # without MuJoCo
        servos = _plant(plant, "4030-servo")
        servos.reset_drives()
        servos.current_fraction  # noqa: B018
        _join()
        for name in controllers:
            controller = create_controller(name)
            if offers(controller, Compiles):
                controller.warm_up()


def warm_up_all(tell: Callable[[str], None] = log_compiling) -> None:
    """Load or compile what twins with either plant and any installed controller that works need."""
    working = []
    for name in controller_names():
        with suppress(PluginError):
            create_controller(name)
            working.append(name)
    for plant in ("kinematic", "mujoco"):
        warm_up(plant, tell, working)


def kept_in() -> Path | None:
    """The folder in which the compiled loop of the plant is kept; None if there is none that can be written to."""
    from isel_twin.plant.kernel import advance

    path = advance._cache.cache_path
    return Path(path) if path and any(Path(path).glob("*.nbi")) else None


def _join() -> None:
    """Plan, sample, hold and go on along pieces that are joined (motion/joined.py)."""
    single = piece((200.0, 0.0), 200.0, 2000.0, 50_000.0)  # one row, of which numpy calls the columns contiguous
    for pieces in (single, chain([single, single])):
        plan = joined(pieces, 4 * MILLISECOND_NS)
        held = plan.replanned(plan.ticks // 2, hold=True)
        held.replanned(held.ticks, hold=False).deltas(0, plan.ticks)
        plan.speed(1)


def _plant(name: str, machine_name: str = "4030") -> Plant:
    """A plant with all kinds of thresholds, and screws that are not even."""
    machine = with_overrides(load_machine(machine_name), {"imperfections.cyclic_error": True})
    thresholds = [Threshold(axis, "position", -1.0, -1, 0.1) for axis in range(len(CARRIAGES))]
    thresholds.append(Threshold(0, "lag", 1e6))
    start_mm = np.full(len(CARRIAGES), 50.0)
    if name == "kinematic":
        from isel_twin.plant.kinematic import KinematicPlant

        return KinematicPlant(machine, thresholds, start_mm)
    from isel_twin.plant.mujoco import MujocoPlant

    return MujocoPlant(machine, thresholds, start_mm)


def _up_to(until_ns: int, t_ns: Any, delta: Any) -> tuple[Any, Any]:
    count = int(np.searchsorted(t_ns, until_ns, side="right"))
    return t_ns[:count], delta[:count]
