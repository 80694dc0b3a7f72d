"""Playing a world: a first life with a host that looks and acts, then another with the same actions.

live      the host is asked what it wants; people and forces interfere at their times; whatever is done is written
          down with its time; a look at everything in between (invariants.Watch)
again     what was written down is done at the same times, and the time between passes in other pieces:
            Cut       random ones, down to a nanosecond, with an observer that looks at everything
            Paced     those of a server at a finite speed, by the bridge's Pacer and a wall clock turned by hand;
                      where the host waited for the end of something, those of a server at speed max
"""

from __future__ import annotations

import math
import signal
import tempfile
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any
from unittest import mock

from golden.random_sessions import Draw, pick

from hunt.host import Heard, Host, Listen, NotDone, Pass, Seat, Send, dialect_of, habitual, recovery
from hunt.invariants import Border, Broken, Life, Watch, check_counters, check_read, difference
from hunt.world import PACED_GRID_NS, World, calm_doings, draw_world
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.bridge.serve.pacing import TICK_NS, Pacer
from isel_twin.controller import Controller, controller_factory
from isel_twin.core import assembly
from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed

MOST_HABITS, STRICT_HABITS = 40, 2
"""So many things a host does, and then it is silent: commands that are refused at once take no time."""
MOST_ROUNDS = 20_000
"""Rounds of the clock at one instant, after which time stands still."""
LONGEST_CPU_S = 60.0
"""Computing time of a world, after which it has no end."""
IDLE = ("idle",)
"""Written down where the host has waited until the controller was idle."""

Action = tuple[Any, ...]
"""("write", bytes), ("set", name, state), ("force", axis, newton), IDLE."""
Passing = Callable[["Stage", int, bool], None]
"""Lets time pass on a stage to a time; if asked, only until the twin is idle."""


class Endless(Exception):
    """A world needs too much computing."""


@dataclass(frozen=True)
class Failure:
    """What a world has shown to be wrong."""

    seed: int
    kind: str
    """safety: something wrong was done; liveness: something that had to be done was not."""
    what: str
    time_ns: int
    actions: tuple[tuple[int, Action], ...] = field(repr=False)
    """What was done until then, and when."""

    @property
    def command(self) -> str:
        """What repeats it."""
        return f"python -m tests.hunt --seed {self.seed}"

    def __str__(self) -> str:
        return f"seed {self.seed}: {self.kind} at {self.time_ns / SECOND_NS:.9f} s: {self.what}\n    {self.command}"


class Stage:
    """A twin with everything that is done to it and everything it says, both with times."""

    def __init__(self, world: World, folder: Path) -> None:
        self.world = world
        self.actions: list[tuple[int, Action]] = []
        self.heard = bytearray()
        """What has arrived since the host last sent something."""
        self.acted = True
        """Something was done since this was last set to False."""
        self.pushes = [0.0, 0.0, 0.0]
        self._talk: dict[bool, bytearray] = {True: bytearray(), False: bytearray()}
        self._decoded: dict[bool, bytearray] = {True: bytearray(), False: bytearray()}
        self._seen_ns, self._rounds = -1, 0
        borders: list[Border] = []

        def bordered(name: str) -> Callable[[bytes | None, Mapping[str, Any]], Controller]:
            factory = controller_factory(name)

            def build(flash: bytes | None, settings: Mapping[str, Any]) -> Controller:
                if borders:  # after a reset
                    return factory(flash, settings)
                borders.append(Border(factory(flash, settings), line_speed=world.options.get("line_speed", False)))
                return borders[0]

            return build

        flash, scenario = _flash(world), _scenario(world, folder)
        with mock.patch.object(assembly, "controller_factory", bordered):
            self.twin = Twin(**(dict(world.options) | _machine(world, folder)), flash=flash, scenario=scenario)
        self.border = borders[0]
        self._decoder = needed(create_language(world.controller), world.controller)
        self.read()

    @property
    def time_ns(self) -> int:
        """Virtual time."""
        return self.twin.time_ns

    def do(self, action: Action) -> None:
        """Do something, and write it down."""
        self.actions.append((self.time_ns, action))
        self.acted = True
        match action:
            case "write", data:
                self._decode(data, sent=True)
                self.twin.write(data)
            case "set", name, state:
                self.twin.set_input(name, state)
            case "force", axis, newton:
                self.pushes[axis] = newton
                self.twin.apply_force(axis, newton)
        self.read()

    def read(self, late_ns: int | None = None) -> None:
        """Take what has arrived at the host by now; late_ns: how long after that a server may look."""
        data = self.twin.read()
        if not self.world.loses_bytes:
            check_read(self.border, len(self._talk[False]), len(data), self.time_ns, late_ns)
        if data:
            self.heard += data
            self._decode(data, sent=False)

    def run_until(self, until_ns: int, until_idle: bool = False) -> None:
        """Let time pass in one piece, but for replies, which are read when they arrive."""
        twin = self.twin

        def stop() -> bool:
            self.count_round()
            return twin.reply_waiting or (until_idle and twin.idle)

        while True:
            twin.run_until(until_ns, stop)
            self.read()
            if twin.time_ns >= until_ns or (until_idle and twin.idle):
                break
        if twin.time_ns != until_ns and not until_idle:
            raise Broken(f"time was to pass to {until_ns} ns and has passed to {twin.time_ns} ns")

    def count_round(self) -> None:
        """The clock has gone round once more: does time go on?"""
        if self.time_ns != self._seen_ns:
            self._seen_ns, self._rounds = self.time_ns, 0
        self._rounds += 1
        if self._rounds > MOST_ROUNDS:
            raise Broken(f"time stands still; next_ns of the controller: {self.border.next_ns}")

    def life(self) -> Life:
        """Everything that has happened. Raises Broken if counters, stream or words do not add up."""
        twin = self.twin
        check_counters(twin, self.border)
        for sent, talk in self._talk.items():
            if bytes(self._decoded[sent] + self._decoder.rest(sent)) != bytes(talk):
                raise Broken(f"the language has lost some of what was {'sent' if sent else 'received'}")
        steps = twin.steps
        return Life(
            said=bytes(self._talk[False]),
            happened=tuple(self.border.happened),
            t_ns=steps.t_ns,
            delta=steps.delta,
            counts=twin.counts,
            position_mm=twin.position_mm,
            machine_position_mm=twin.machine_position_mm,
            lost_steps=twin.lost_steps,
            inputs=dict(twin.inputs),
            outputs=dict(twin.outputs),
            levels=dict(twin.levels),
            flash=twin.flash,
        )

    def _decode(self, data: bytes, *, sent: bool) -> None:
        self._talk[sent] += data
        for message in self._decoder.messages(data, sent):
            self._decoded[sent] += message.data


def _flash(world: World) -> bytes | None:
    """What an earlier life of the controller has left, damaged or not."""
    if not world.earlier:
        return None
    twin = Twin(controller=world.controller, plant="kinematic")
    twin.write("".join(f"{line}\r" for line in world.earlier).encode("latin-1"))
    twin.run(1.0)
    image = bytearray(twin.flash or b"")
    if world.damage is not None and image:
        image[int(world.damage * len(image))] ^= 1 << int(world.damage * 8)
    return bytes(image)


def _machine(world: World, folder: Path) -> dict[str, Any]:
    """A machine of a user's own, if something is said of its controller."""
    if not world.settings:
        return {}
    own = folder / "own"
    own.mkdir(exist_ok=True)
    (own / "machine.toml").write_text(world.machine_file(), encoding="utf-8")
    return {"machine": own}


def _scenario(world: World, folder: Path) -> Path | None:
    if not world.scripted:
        return None
    path = folder / "scenario.toml"
    path.write_text(world.scenario(), encoding="utf-8")
    return path


# ---- the first life --------------------------------------------------------------------------------------------------


class _Director:
    """The first life of a world: the host, and what happens beside it, in the order of time."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._grid_ns = stage.world.grid_ns
        self._beside = deque(stage.world.by_hand)
        self._watch = Watch(stage.twin, stage.border)
        self._slices = stage.world.draw("slices")
        self._slice_ns = int(pick(self._slices, (20, 50, 200, 1000))) * MILLISECOND_NS
        self._look()

    def play(self, host: Host, end_ns: int | None) -> None:
        """Do what the host wants, until it ends or the time has come."""
        stage = self._stage
        try:
            wish = next(host)
            while end_ns is None or stage.time_ns < end_ns:
                wish = host.send(self._fulfil(wish, end_ns))
        except StopIteration:
            return
        finally:
            host.close()

    def do(self, action: Action) -> None:
        """Do something now, which needs to be at a time of the grid."""
        self.pass_to(self._next_on_grid())
        self._stage.do(action)
        self._look()

    def pass_to(self, until_ns: int, until_idle: bool = False) -> None:
        """Let time pass, with what happens beside the host, and with looks."""
        stage = self._stage
        while True:
            while self._beside and self._beside[0].at_ns <= stage.time_ns:
                stage.do(self._beside.popleft().doing)
                self._look()
            if stage.time_ns >= until_ns or (until_idle and stage.twin.idle):
                return
            next_ns = self._beside[0].at_ns if self._beside else until_ns
            stage.run_until(min(until_ns, next_ns, stage.time_ns + self._slice_ns), until_idle)
            self._look()

    def _fulfil(self, wish: Send | Pass | Listen, end_ns: int | None) -> Heard:
        stage = self._stage
        match wish:
            case Send(data):
                self.pass_to(self._next_on_grid())
                stage.heard.clear()
                self.do(("write", data))
            case Pass(seconds):
                self.pass_to(self._limit(seconds, end_ns))
            case Listen(seconds):
                self.pass_to(self._limit(seconds, end_ns), until_idle=True)
                if stage.twin.idle:
                    stage.actions.append((stage.time_ns, IDLE))
        return Heard(bytes(stage.heard), stage.twin.idle)

    def _next_on_grid(self) -> int:
        return -(-self._stage.time_ns // self._grid_ns) * self._grid_ns

    def _limit(self, seconds: float, end_ns: int | None) -> int:
        until_ns = self._stage.time_ns + round(seconds * SECOND_NS)
        return until_ns if end_ns is None else min(until_ns, end_ns)

    def _look(self) -> None:
        stage = self._stage
        pushed = any(stage.pushes) or any(event.doing[0] == "force" for event in stage.world.scripted)
        self._watch.look(acted=stage.acted, pushed=pushed)
        stage.acted = False


def live(stage: Stage) -> None:
    """The first life. Raises Broken or NotDone."""
    world = stage.world
    director = _Director(stage)

    def seat(part: str) -> Seat:
        language = needed(create_language(world.controller), world.controller)
        draw = world.draw(part)
        return Seat(draw, dialect_of(world.controller), language, stage.twin, world.strict, world.physics)

    if world.strict:
        director.play(habitual(seat("host"), world.habits, STRICT_HABITS), None)
    else:
        director.play(habitual(seat("host"), world.habits, MOST_HABITS), world.end_ns)
        director.pass_to(world.end_ns)
    for doing in calm_doings(stage.twin):
        director.do(doing)
    director.play(recovery(seat("recovery")), None)
    director.pass_to(stage.time_ns + SECOND_NS)


# ---- the second life -------------------------------------------------------------------------------------------------


def again(stage: Stage, actions: list[tuple[int, Action]], passing: Passing) -> None:
    """The same actions at the same times, with time passing in another way. Raises Broken."""
    for at_ns, action in actions:
        until_idle = action == IDLE
        passing(stage, at_ns, until_idle)
        if stage.time_ns != at_ns:
            raise Broken(f"with time passing otherwise, {action} comes at {stage.time_ns} ns instead of {at_ns} ns")
        if not until_idle:
            stage.do(action)


class Cut:
    """Time in random pieces, down to a nanosecond, with somebody who looks at everything now and then."""

    def __init__(self, stage: Stage, draw: Draw, end_ns: int) -> None:
        """end_ns: when the life will be over."""
        self._draw = draw
        stage.twin.observe(_look_at_everything, int(end_ns * 10.0 ** draw.uniform(-2.5, 0.0)) + 1)

    def __call__(self, stage: Stage, until_ns: int, until_idle: bool) -> None:
        start_ns = stage.time_ns
        for _ in range(int(self._draw.integers(0, 6))):
            piece_ns = int(10.0 ** self._draw.uniform(0.0, 9.0))
            kind = int(self._draw.integers(3))
            at_ns = (start_ns + piece_ns, until_ns - piece_ns, int(self._draw.integers(start_ns, until_ns + 1)))[kind]
            stage.run_until(min(max(at_ns, stage.time_ns), until_ns))
        stage.run_until(until_ns)


_SIGHTS = (
    *("fault", "reply_waiting", "serial_format", "idle", "next_event_ns", "inputs", "outputs", "levels"),
    *("counts", "position_mm", "position_error_mm", "machine_position_mm", "step_mm", "lost_steps", "slip_steps"),
)


def _look_at_everything(twin: Twin) -> None:
    """Looking changes nothing."""
    for name in _SIGHTS:
        getattr(twin, name)
    len(twin.steps)


class Paced:
    """Time as a server lets it pass."""

    def __init__(self, speed: float) -> None:
        self._wall_ns = 0
        self._speed = speed
        self._late_ns = math.ceil(TICK_NS * speed) + PACED_GRID_NS
        self._pacer = Pacer(speed, clock=lambda: self._wall_ns)
        self._fast = Pacer(None, clock=lambda: self._wall_ns)

    def __call__(self, stage: Stage, until_ns: int, until_idle: bool) -> None:
        if until_idle:
            self._as_fast_as_possible(stage)
            grid_ns = stage.world.grid_ns
            self._pacer = Pacer(self._speed, stage.time_ns // grid_ns * grid_ns, lambda: self._wall_ns)
            return
        twin, pacer = stage.twin, self._pacer
        wall_until_ns = self._wall_at(until_ns)
        while twin.time_ns < until_ns:
            pacer.advance(_Counted(stage))
            stage.read(self._late_ns)
            wait_s = pacer.wait_s(twin)
            assert wait_s is not None
            self._wall_ns = min(wall_until_ns, self._wall_ns + max(round(wait_s * SECOND_NS), 1000))
        if pacer.behind:
            raise Broken("the pacer has fallen behind, with a computer that takes no time")

    def _wall_at(self, time_ns: int) -> int:
        """Wall time at which virtual time is time_ns."""
        present_ns = self._pacer.present_ns()
        assert present_ns is not None
        wall_ns = self._wall_ns + round((time_ns - present_ns) / self._speed)
        return wall_ns

    def _as_fast_as_possible(self, stage: Stage) -> None:
        twin = stage.twin
        while not twin.idle:
            if self._fast.wait_s(twin) is None:
                raise Broken("a server at speed max would wait for its host for ever")
            self._fast.advance(_Counted(stage))
            stage.read()


class _Counted:
    """A twin whose clock is watched."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stage.twin, name)

    def run_until(self, time_ns: int, stop: Callable[[], bool] | None = None) -> None:
        def counted() -> bool:
            self._stage.count_round()
            return stop is not None and stop()

        self._stage.twin.run_until(time_ns, counted)


# ---- both ------------------------------------------------------------------------------------------------------------


def hunt(seed: int) -> Failure | None:
    """Draw the world of a seed and play it."""
    return play(draw_world(seed))


def play(world: World) -> Failure | None:
    """Play a world twice; what is wrong with it, None if nothing is."""
    stages: list[Stage] = []
    with tempfile.TemporaryDirectory() as folder, _limited(LONGEST_CPU_S), warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            stages.append(Stage(world, Path(folder)))
            live(stages[0])
            first = stages[0].life()
            stages.append(Stage(world, Path(folder)))
            draw = world.draw("again")
            again(stages[1], stages[0].actions, _passing(stages[1], draw, stages[0].time_ns))
            stages[1].run_until(stages[0].time_ns)
            found = difference(first, stages[1].life())
            if found is not None:
                raise Broken(f"not the same bits {_way(world)}: {found}")
        except NotDone as error:
            return _failure(world, stages, "liveness", str(error))
        except Broken as error:
            return _failure(world, stages, "safety", str(error))
        except Endless as error:
            return _failure(world, stages, "liveness", f"no end after {LONGEST_CPU_S:g} s of computing, {error}")
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(last.filename).name}:{last.lineno}"
            return _failure(world, stages, "safety", f"{where} raised {type(error).__name__}: {error}")
    return None


def _passing(stage: Stage, draw: Draw, end_ns: int) -> Passing:
    speed = stage.world.speed
    return Cut(stage, draw, end_ns) if speed is None else Paced(speed)


def _way(world: World) -> str:
    return "with time cut otherwise" if world.speed is None else f"when served at speed {world.speed:g}"


def _failure(world: World, stages: list[Stage], kind: str, what: str) -> Failure:
    if not stages:
        return Failure(world.seed, kind, what, 0, ())
    return Failure(world.seed, kind, what, stages[-1].time_ns, tuple(stages[-1].actions))


@contextmanager
def _limited(cpu_s: float) -> Iterator[None]:
    """Raise Endless in whatever runs once it has taken so much computing time."""

    def end(number: int, frame: FrameType | None) -> None:
        where = "" if frame is None else f"in {Path(frame.f_code.co_filename).name}:{frame.f_lineno}"
        raise Endless(where)

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
