"""An experiment carried out on a twin in place of a real machine. The result has the same form: a recording of bytes
and times as from `tap`, and the filled-in file, with the errors of a gauge and a clock. For testing an experiment
before going to the machine, and for judging a block.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Place
from isel_twin.base.units import SECOND_NS
from isel_twin.core.journal import Received
from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed
from isel_twin.machine import Machine
from isel_twin.many.identification.experiment import Experiment, Step, series_hz
from isel_twin.many.identification.hands import SETTLE_S, Pulls, let_go, shown_mm
from isel_twin.many.identification.measured import Measured, Reading, Ring, Stall
from isel_twin.many.identification.session import converse, stalls, with_supply
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.reading import Entry, Recorded
from isel_twin.wiring import ScenarioError, event_now

THINK_S = 0.05  # from a reply to the next command
PLACE = 2.0  # the zero of a gauge is drawn from 0 to this, mm


def carry_out(
    experiment: Experiment, machine: Machine, controller: str, *, seed: int, noise_mm: float, time_noise_s: float
) -> tuple[Recorded, Measured]:
    """The recording and the measurements. noise_mm, time_noise_s: standard deviations of gauge and clock."""
    draw = np.random.default_rng([seed, 5])
    twin = Twin(machine, controller, "mujoco", seed, line_speed=True, keep_motions=1)
    entries: list[Entry] = []

    def note(time_ns: int, kind: str, what: Any) -> None:
        if kind == "sent":
            entries.append(Entry("/host/sent", time_ns, _content(what, 0)))
        elif kind == "received":
            received: Received = what
            time_ns = received.arrival_ns + round(abs(draw.normal(0.0, time_noise_s)) * SECOND_NS)
            entries.append(Entry("/host/received", time_ns, _content(received.data, received.byte_ns)))

    twin.listen(note)
    template = experiment.template()
    zeros: dict[str, float] = {}
    found: list[Reading] = []
    rings: list[Ring] = []
    for command, step in enumerate(experiment.steps, 1):
        twin.run(THINK_S)
        began_ns = twin.time_ns
        twin.write(step.data)
        _act(twin, step, began_ns)
        twin.run_until_idle()
        twin.read()
        wanted, pulls = [reading for reading in template.readings if reading.command == command], Pulls(twin)
        for reading in wanted:
            axis = CARRIAGES.index(reading.axis)
            pulls.pull(reading)
            twin.run(SETTLE_S)
            zero = zeros.setdefault(reading.gauge, float(draw.uniform(0.0, PLACE)))
            mm = shown_mm(twin, reading) - zero + float(draw.normal(0.0, 1.0)) * noise_mm
            counter = None if reading.counter_mm is None else float(twin.counts[axis] * twin.step_mm[axis])
            found.append(replace(reading, mm=mm, counter_mm=counter))
        pulls.end()
        for ring in (ring for ring in template.rings if ring.command == command):
            hz, damping = let_go(twin, ring)
            rings.append(replace(ring, frequency_hz=hz, damping=damping))
    done = tuple(
        replace(_stalled(stall, machine, controller, seed), recording=experiment.name) for stall in experiment.stalls
    )
    path, metadata = Path(f"{experiment.name}.mcap"), {"kind": "tap", "controller": controller}
    recorded = Recorded(path, metadata, {}, tuple(entries), np.zeros(0, dtype=np.int64), b"", True)
    return recorded, Measured(tuple(found), template.acts, done, rings=tuple(rings))


def _act(twin: Twin, step: Step, began_ns: int) -> None:
    place = Place("experiment", ScenarioError)
    for act in step.acts:
        twin.run_until(began_ns + round(act.after_s * SECOND_NS))
        twin.carry_out(event_now(dict(act.content), place, twin.settable, twin.keys))


def _stalled(stall: Stall, machine: Machine, controller: str, seed: int) -> Stall:
    """The result of a stall series on another twin of this machine."""
    twin = Twin(with_supply(machine, stall.supply_v), controller, "mujoco", seed, keep_motions=1)
    language = needed(create_language(controller), controller)
    for command in language.reference():
        converse(twin, command)
    held = 0.0
    for speed in series_hz(stall, language):
        if stalls(twin, stall, speed):
            return replace(stall, held_hz=held, lost_hz=float(speed))
        held = float(speed)
    return replace(stall, held_hz=held, lost_hz=math.inf)


def _content(data: bytes, byte_ns: int) -> dict[str, Any]:
    return {"hex": data.hex(), "byte_ns": byte_ns}


def write_recording(path: Path, recorded: Recorded) -> None:
    """Write the recording, in the order of time. Raises OSError."""
    language = create_language(recorded.controller)
    with RecordingWriter(path, dict(recorded.metadata), language=language) as writer:
        for entry in sorted(recorded.entries, key=lambda each: each.time_ns):
            data, byte_ns = bytes.fromhex(entry.content["hex"]), int(entry.content["byte_ns"])
            if entry.channel == "/host/sent":
                writer.sent(entry.time_ns, data)
            else:
                writer.received(entry.time_ns, data, byte_ns)
