"""A world: everything about one run of the hunt that can be drawn before it begins.

    seed --> options of the twin, an earlier life of its flash, events in time, habits of the host, how time is cut

Each part has random numbers of its own, so that a change in one leaves the others as they were. What the host says
depends on what it is told and is drawn while it talks (host.py), with `World.draw("host")`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from golden.random_sessions import IMC_FIELDS, IMC_SETTINGS, OVERRIDES, STATES, Draw, chance, fill, pick

from hunt.host import HABITS
from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import MICROSECOND_NS, SECOND_NS
from isel_twin.core.twin import Twin
from isel_twin.machine import load_machine
from isel_twin.wiring import FAULTS
from isel_twin.wiring.cabinet import ELEMENTS

Doing = tuple[Any, ...]
"""("set", name, state), ("force", axis, newton), ("phase", axis, phases), ("noise", chance), and for the other faults
("fault", key, value, seconds), as an event of a scenario has them."""

CONTROLLERS = ("imc-s8", "imc-s8", "ismif", "ismif", "c142", "imc-m", "imc-mp")
MACHINES = ("4030", "4030", "4030-portal", "traverse")
MORE_OVERRIDES: tuple[dict[str, Any], ...] = (
    {"switches.bounce": 5.0},
    {"switches.hysteresis": 0.0, "imperfections": "ideal"},
    {"switches.repeatability": 0.1},
    {"axes.all.backlash": 0.2},
    {"axes.all.guide_friction": 0.0},
    {"axes.z.brake": 500.0},
    {"timing.motor_substep": 50.0},
    {"axes.all.steps_per_rev": 400},
    {"axes.all.travel": 60.0, "axes.all.power_on_low": 2.0, "axes.all.power_on_high": 50.0},
    {"axes.all.motor": "57HS56-2804", "axes.all.stage.current": 2.8},
    {"axes.all.motor": "23HS22-2804S", "axes.all.stage.current": 2.8},
    {"axes.all.stage.supply": 30.0, "axes.all.stage.idle_current": 0.2, "axes.all.stage.idle_delay": 5.0},
    {"axes.all.stage.thermal_time_constant": 2.0},
    {"axes.all.steps_per_rev": 12_800},
    {"axes.all.lead": 10.0, "payload.mass": 3.0},
    {"structure.flex_x.stiffness": 4.0, "structure.flex_y.stiffness": 6.0, "imperfections": "dynamic"},
    {"timing.mujoco_step": 0.25},
)
SETTINGS: tuple[dict[str, int | bool], ...] = (
    {"loop_depth": 2, "program_memory_bytes": 60},
    {"line_bytes": 60, "input_bytes": 100},
    {"debounce_ms": 20, "settle_ms": 1, "relay_ms": 30},
    {"cycle_ms": 7, "erase_ms": 100},
    {"extra_values": True, "relative_unreferenced": True},
    {"start_stop_hz": 400, "acceleration_hz_per_ms": 150, "step_out_hz": 50},
)
"""What a machine file may say of the controllers of the iMC family."""
LINE_KEYS = ("dropped", "doubled", "line_cut")
PHYSICAL_KEYS = ("friction_n", "undervoltage")
"""Faults that are drawn beside `swapped`, of the line and of the machine."""
SWITCHES = tuple(f"limit_{axis}{end}" for axis in CARRIAGES for end in (1, 2))
POWER_ON_MM = (1.0, 12.0)
"""Where carriages stand at power-on, so that references are near."""
PACED = (0.5, 1.0, 2.0, 20.0, 20.0, 40.0, 100.0, 100.0, 1000.0)
"""Speeds at which a world is served again."""
PACED_GRID_NS = MICROSECOND_NS
"""Times at which something is done are whole multiples of it, so that they are instants of any of the speeds."""


@dataclass(frozen=True)
class Event:
    """Something happens to the machine at a time, whatever the host does."""

    at_ns: int
    doing: Doing


@dataclass(frozen=True)
class World:
    """One run of the hunt."""

    seed: int
    options: Mapping[str, Any]
    """Of `isel_twin.Twin`, but flash and scenario."""
    settings: Mapping[str, int | bool]
    """What the machine file says of the controller."""
    earlier: tuple[str, ...]
    """Lines that an earlier life of the controller was told, which its flash may have kept; none: a new device."""
    damage: float | None
    """Where a bit of that flash has flipped, as a share of its length; None: nowhere."""
    scripted: tuple[Event, ...]
    """Events of the scenario file."""
    by_hand: tuple[Event, ...]
    """Events carried out by `Twin.set_input` and `Twin.apply_force`."""
    habits: tuple[str, ...]
    """What the host does, from host.HABITS, some more often than others."""
    end_ns: int
    """The host falls silent and the faults have ended."""
    speed: float | None
    """Speed at which the world is served the second time; None: time is cut otherwise instead."""

    @property
    def controller(self) -> str:
        """Name of the controller."""
        return str(self.options["controller"])

    @property
    def physics(self) -> bool:
        """Whether the plant is MuJoCo's."""
        return bool(self.options["plant"] == "mujoco")

    @property
    def strict(self) -> bool:
        """Nothing disturbs and the host keeps to the rules, so that everything it asks for must be done."""
        return set(self.habits) == {"legal"} and not (self.scripted or self.by_hand or self.earlier or self.settings)

    @property
    def loses_bytes(self) -> bool:
        """What the host reads is not byte by byte what the controller has sent."""
        return any(event.doing[0] == "fault" and event.doing[1] in LINE_KEYS for event in self.scripted)

    @property
    def grid_ns(self) -> int:
        """Everything is done at whole multiples of this time."""
        return PACED_GRID_NS if self.speed is not None else 1

    def draw(self, part: str) -> Draw:
        """Random numbers of a part of the world."""
        return np.random.default_rng([self.seed, *part.encode()])

    def scenario(self) -> str:
        """Text of the scenario file."""
        return "\n".join(
            f"[[event]]\nat = {event.at_ns / SECOND_NS!r}\n{_toml(event.doing)}" for event in self.scripted
        )

    def machine_file(self) -> str:
        """Text of a machine.toml with the settings of the controller."""
        rows = (f"{key} = {_setting(value)}" for key, value in self.settings.items())
        return "\n".join((f'based_on = "{self.options["machine"]}"', "", "[controller]", *rows, ""))

    def __str__(self) -> str:
        lines = [f"Twin({', '.join(f'{key}={value!r}' for key, value in self.options.items())})"]
        lines += [f"[controller] of its machine: {dict(self.settings)}"] if self.settings else []
        if self.earlier:
            damage = "" if self.damage is None else f", a bit flipped at {self.damage:.3f} of it"
            lines.append(f"flash of an earlier life that was told {' '.join(self.earlier)}{damage}")
        lines += [f"{event.at_ns:>15}  scenario  {event.doing}" for event in self.scripted]
        lines.append(f"host: {', '.join(self.habits)}, until {self.end_ns} ns; again {_again(self.speed)}")
        return "\n".join(lines)


def draw_world(seed: int) -> World:
    """The world of a seed."""
    draw: Draw = np.random.default_rng([seed, 0])
    controller = pick(draw, CONTROLLERS)
    physics = chance(draw, 0.12)
    quiet = chance(draw, 0.2)
    paced = chance(draw, 0.4)
    grid_ns = PACED_GRID_NS if paced else 1
    end_ns = _on_grid(draw.uniform(1.0, 5.0 if physics else 25.0) * SECOND_NS, grid_ns)
    options = _options(draw, seed, controller, physics, calm=quiet)
    settings: dict[str, int | bool] = {}
    earlier: tuple[str, ...] = ()
    if controller != "ismif" and not quiet and chance(draw, 0.15):
        settings = pick(draw, SETTINGS)
    if controller != "ismif" and not quiet and chance(draw, 0.2):
        earlier = (*(fill(draw, pick(draw, IMC_SETTINGS), IMC_FIELDS) for _ in range(8)), "@0IW")
    events = [] if quiet else list(_events(draw, options["machine"], physics, end_ns, grid_ns))
    if not quiet:
        events += _faults(np.random.default_rng([seed, 1]), physics, end_ns, grid_ns)
    by_scenario = chance(draw, 0.5)
    return World(
        seed=seed,
        options=options,
        settings=settings,
        earlier=earlier,
        damage=round(float(draw.random()), 6) if earlier and chance(draw, 0.3) else None,
        scripted=tuple(event for event in events if _scripted(event, by_scenario)),
        by_hand=tuple(event for event in events if not _scripted(event, by_scenario)),
        habits=("legal",) if quiet and chance(draw, 0.5) else _habits(draw),
        end_ns=end_ns,
        speed=pick(draw, PACED) if paced else None,
    )


def calm_doings(twin: Twin) -> list[Doing]:
    """What an operator puts right once the faults have ended: contacts, elements, hands off, and the power last."""
    contacts = [("set", contact.name, "ok") for contact in twin.machine.contacts]
    elements = [("set", name, states[0]) for name, states in ELEMENTS.items() if name != "power"]
    hands = [("force", axis, 0.0) for axis in range(len(CARRIAGES))]
    return [*contacts, *elements, *hands, ("set", "power", "on")]


def _options(draw: Draw, seed: int, controller: str, physics: bool, *, calm: bool) -> dict[str, Any]:
    options: dict[str, Any] = {"machine": pick(draw, MACHINES), "controller": controller, "seed": seed}
    options["plant"] = "mujoco" if physics else "kinematic"
    if chance(draw, 0.3):
        options["line_speed"] = True
    if physics or chance(draw, 0.8):
        options["start_mm"] = tuple(round(float(x), 3) for x in draw.uniform(*POWER_ON_MM, 3))
    overrides = pick(draw, OVERRIDES[2:4] if calm else OVERRIDES + MORE_OVERRIDES)
    if controller == "ismif":  # its search is so many half steps long, not so many fine ones
        overrides = {key: value for key, value in overrides.items() if key != "axes.all.steps_per_rev" or value < 800}
    if overrides:
        options["overrides"] = overrides
    return options


def _habits(draw: Draw) -> tuple[str, ...]:
    """A host has one habit, or a few that it changes between."""
    return tuple(pick(draw, HABITS) for _ in range(int(draw.integers(1, 5))))


def _events(draw: Draw, machine: str, physics: bool, end_ns: int, grid_ns: int) -> Iterator[Event]:
    """Faults and people's doings, and at the end what undoes those that only a scenario can bring about."""
    contacts = [contact.name for contact in load_machine(machine).contacts]
    noise, forces, phases = chance(draw, 0.15), physics and chance(draw, 0.4), physics and chance(draw, 0.3)
    at_s, end_s = 0.0, end_ns / SECOND_NS
    mean_s = pick(draw, (0.1, 0.5, 1.0, 3.0, 10.0))
    found: list[tuple[float, Doing]] = []
    elements = [name for name in ELEMENTS if name not in ("power", "estop") or chance(draw, 0.7)]
    while (at_s := at_s + _later_s(draw, mean_s)) < end_s and len(found) < 60:
        kind = int(draw.integers(10))
        if kind == 0 and noise:
            doing: Doing = ("noise", pick(draw, (0.001, 0.02, 0.2, 0.0)))
        elif kind == 1 and forces:
            doing = ("force", int(draw.integers(3)), pick(draw, (0.0, 40.0, -40.0, 300.0, -300.0, 800.0, -800.0)))
        elif kind == 2 and phases:
            doing = ("phase", int(draw.integers(3)), pick(draw, ("a", "b", "ab", "")))
        elif kind < 5:
            name = pick(draw, SWITCHES if chance(draw, 0.5) else contacts)
            doing = ("set", name, pick(draw, (*FAULTS, "ok", "ok")))
        else:
            name = pick(draw, elements)
            doing = ("set", name, pick(draw, STATES.get(name, ELEMENTS[name])))
        found.append((at_s, doing))
    for second, doing in found:
        yield Event(_on_grid(second * SECOND_NS, grid_ns), doing)
    if noise:
        yield Event(end_ns, ("noise", 0.0))
    for axis in range(len(CARRIAGES)):
        if forces:
            yield Event(end_ns, ("force", axis, 0.0))
        if phases:
            yield Event(end_ns, ("phase", axis, ""))


def _faults(draw: Draw, physics: bool, end_ns: int, grid_ns: int) -> Iterator[Event]:
    """Faults that end by themselves, in a quarter of the worlds, drawn apart from all else.

    Not those that would need the invariants to know more: loads and obstacles give energy, a controller that starts
    anew is another one to compare with.
    """
    if not chance(draw, 0.25):
        return
    keys = (*LINE_KEYS, "swapped", *(PHYSICAL_KEYS if physics else ()))
    for _ in range(int(draw.integers(1, 8))):
        at_ns = _on_grid(float(draw.uniform(0.0, 0.8)) * end_ns, grid_ns)
        seconds = round(float(draw.uniform(0.0, 0.2)) * end_ns / SECOND_NS, 3)
        key = pick(draw, keys)
        match key:
            case "swapped":
                one, other = draw.choice(SWITCHES, 2, replace=False).tolist()
                value: Any = {one: other}
            case "friction_n":
                value = {pick(draw, CARRIAGES): pick(draw, (5.0, 100.0, 3000.0))}
            case "undervoltage":
                value = pick(draw, (0.2, 0.6, 0.95))
            case "line_cut":
                value = True
            case _:
                value = pick(draw, (0.001, 0.02, 0.2))
        yield Event(at_ns, ("fault", key, value, seconds))


def _later_s(draw: Draw, mean_s: float) -> float:
    """Time to the next event, now and then none: several at one instant, also at power-on."""
    return 0.0 if chance(draw, 0.1) else float(draw.exponential(mean_s))


def _scripted(event: Event, by_scenario: bool) -> bool:
    return by_scenario or event.doing[0] in ("phase", "noise", "fault")


def _setting(value: int | bool) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'{{ value = {value}, unit = "1", grade = "setting", source = "drawn" }}'


def _toml(doing: Doing) -> str:
    match doing:
        case "set", name, state:
            return f"set = {{ {name} = {json.dumps(state)} }}\n"
        case "force", axis, newton:
            return f"force_n = {{ {CARRIAGES[axis]} = {newton} }}\n"
        case "phase", axis, phases:
            return f"phase_lost = {{ {CARRIAGES[axis]} = {json.dumps(phases)} }}\n"
        case "noise", probability:
            return f"noise = {probability}\n"
        case "fault", key, dict(by_axis), seconds:
            return f"for = {seconds}\n[event.{key}]\n" + "".join(f"{n} = {json.dumps(v)}\n" for n, v in by_axis.items())
        case "fault", key, value, seconds:
            return f"for = {seconds}\n{key} = {json.dumps(value)}\n"
    raise ValueError(f"unknown doing {doing!r}")


def _again(speed: float | None) -> str:
    return "with time cut otherwise" if speed is None else f"served at speed {speed:g}"


def _on_grid(t_ns: float, grid_ns: int) -> int:
    return round(t_ns) // grid_ns * grid_ns
