"""Sessions of machines that have what the shipped one has not, as scripts of fixed_sessions.py: electronic damping,
uneven screws, errors of stages, a common supply, a probe, a cut, a stall that shakes the structure, servo drives with
load.

All take samples, so that what does not show in replies and positions is in their digests, too.
"""

from __future__ import annotations

from typing import Any

from isel_twin.machine import Fixture

START_MM = (60.0, 60.0, 30.0)
BEGIN = "sample 0.001\n> @07\n> @0N7\n"
MOVES = """
> @0M6400,16000,3200,12000,800,9000,0,30
> @0M-3200,9000,6400,16000,1600,9000,0,30
run 0.3
> @0M-2400,777,6080,300,1500,900,0,30
"""
EXTERNAL = "sample 0.001\n> out power_request=1 stages=1 brake=1\\n\nrun 0.05\n"
UNWATCHED = {"controller.watchdog_ms": 0}  # the host may be silent
STAGE_ERRORS = {"imperfections.step_accuracy": True, "imperfections.current_offset": True}
UNEVEN = {f"imperfections.{name}": True for name in ("cyclic_error", "free_length", "growth", "lead_error")}
PROBING = (  # the box from above, then into the bore of the ring, to its wall and away, and too far
    "0,30,0,30,2240,4000",
    "0,30,0,30,-2560,4000",
    "25600,16000,0,30,0,30",
    "0,30,0,30,4800,9000",
    "5120,4000,0,30,0,30",
    "-5120,4000,0,30,0,30",
    "0,30,6400,6000,0,30",
)
SUPPLY = {"supply.enabled": True, "supply.capacitance": 9000.0}
LIVELY = {  # much to brake, little current to heat, a voltage near that of the source before the stop
    **SUPPLY,
    "supply.chopper_voltage": 48.1,
    "supply.source_resistance": 0.05,
    "axes.all.stage.current": 3.0,
    "axes.all.coupling_inertia": 1e-4,
}
SERVO_SUPPLY = {
    **SUPPLY,
    "supply.undervoltage": 45.0,
    "supply.release": 50.0,
    "supply.chopper_voltage": 60.1,
    "supply.source_resistance": 0.05,
    "payload.mass": 8.0,
}

BOX = Fixture("box", "box", (40.0, 30.0, 20.0), (80.0, 80.0, 0.0), 20.0)
RING = Fixture("ring", "ring", (60.0, 30.0, 15.0), (160.0, 80.0, 0.0))
PLATE = Fixture("plate", "cylinder", (30.0, 20.0), (80.0, 80.0, 0.0), plate=True)

PUSHED = """
[[event]]
at = 0.15
force_n = { x = 120.0, y = -60.0 }
for = 0.2

[[event]]
at = 0.6
phase_lost = { y = "a" }
for = 0.1
"""
SAGGING = """
[[event]]
at = 0.2
undervoltage = 0.9
for = 0.3
"""
CUTS = """
[[event]]
at = 0.1
[event.cut]
diameter = 6.0
flutes = 2
depth = 0.5
width = 3.0
spindle = 18000
material = "aluminium"
stickout = 20.0

[[event]]
at = 1.1
[event.cut]
diameter = 4.0
flutes = 3
depth = 1.0
width = 4.0
spindle = 9000
kc = { value = 800, unit = "N/mm2", grade = "estimate", source = "a golden session" }
edge = 5.0
edge_radial = 3.0

[[event]]
at = 1.9
cut = "off"
"""
BLOCKED = """
[[event]]
at = 0.3
force_n = { x = 50.0, y = 500.0 }
for = 0.6

[[event]]
at = 0.9
obstacle_mm = { x = 95.0 }
"""

SCRIPTS: dict[str, tuple[Any, ...]] = {
    "imc-s8 machine damped": (
        {"start_mm": START_MM, "overrides": {"axes.all.stage.kind": "digital"}},
        BEGIN + MOVES,
        PUSHED,
    ),
    "imc-s8 machine damped with errors": (
        {"start_mm": START_MM, "overrides": {"axes.all.stage.kind": "digital", **STAGE_ERRORS}},
        BEGIN + MOVES,
    ),
    "imc-s8 machine errors": (
        {
            "start_mm": START_MM,
            "overrides": {"axes.x.stage.kind": "slow", "axes.y.stage.kind": "mixed", **STAGE_ERRORS},
        },
        BEGIN + MOVES,
        PUSHED,
    ),
    "imc-s8 machine half steps": (
        {"start_mm": START_MM, "overrides": {"axes.all.steps_per_rev": 400.0, **STAGE_ERRORS}},
        BEGIN + "> @0M1600,2000,800,2000,200,900,0,30\nrun 0.3\n> @0M0,2000,0,2000,0,900,0,30\n",
    ),
    "imc-s8 machine full steps": (
        {"start_mm": START_MM, "overrides": {"axes.all.steps_per_rev": 200.0, **STAGE_ERRORS}},
        BEGIN + "> @0M800,900,400,900,100,300,0,30\nrun 0.3\n> @0M0,900,0,900,0,300,0,30\n",
    ),
    "imc-s8 machine uneven screws": ({"start_mm": START_MM, "overrides": UNEVEN}, BEGIN + MOVES, PUSHED),
    "imc-s8 machine supply": (
        {"start_mm": START_MM, "overrides": {**SUPPLY, "payload.mass": 8.0}},
        BEGIN + MOVES,
        SAGGING,
    ),
    "imc-s8 machine chopper": (
        {"start_mm": START_MM, "overrides": LIVELY},
        BEGIN + "> @0J800\n" + 3 * "> @0A3200,16000,3200,16000,1600,16000,0,30\n> @0A-3200,16000,0,30,0,30,0,30\n",
    ),
    "imc-s8 machine probe": (
        {
            "start_mm": (80.0, 80.0, 82.0),
            "overrides": {"probe.enabled": True, "imperfections.bounce": False},
            "fixtures": (BOX, RING),
        },
        BEGIN + "".join(f"> @0A{line},0,30\nrun 0.1\n" for line in PROBING),
    ),
    "imc-s8 machine plate": (
        {"start_mm": (78.0, 83.0, 110.0), "fixtures": (PLATE,)},
        BEGIN + "> @0A0,30,0,30,6400,3000,0,30\nrun 0.2\n> @0A0,30,0,30,-3200,3000,0,30\n",
    ),
    "imc-s8 machine cuts": ({"start_mm": START_MM}, BEGIN + MOVES, CUTS),
    "external machine stall": (
        {"start_mm": (60.0, 4.0, 20.0), "overrides": UNWATCHED},
        EXTERNAL + ">> go 4800 0 -14400 0\\n\nrun 3.0\n",
    ),
    "external machine servo with load": (
        {
            "machine": "4030-servo",
            "start_mm": START_MM,
            "overrides": {**UNWATCHED, "payload.mass": 8.0, "axes.all.servo.i2t_time_constant": 0.5, **UNEVEN},
        },
        EXTERNAL + ">> go 30000 20000 9000 4000\\n\nrun 1.0\n>> go 60000 50000 0 0\\n\nrun 1.0\n",
        BLOCKED,
    ),
    "external machine servo on a supply": (
        {"machine": "4030-servo", "start_mm": START_MM, "overrides": {**UNWATCHED, **SERVO_SUPPLY}},
        EXTERNAL + ">> go 60000 30000 9000 4000\\n\nrun 1.2\n>> go 60000 -20000 0 0\\n\nrun 1.0\n",
        SAGGING,
    ),
}
