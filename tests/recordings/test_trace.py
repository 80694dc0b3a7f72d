"""Traces against closed forms: a constant-speed stream whose every edge is known, and a real move."""

from __future__ import annotations

import itertools
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from motion.plans import table
from vcd.reader import TokenKind, tokenize

from isel_twin.motion import SetPointRun, StepRun, Steps, constant, line
from isel_twin.recordings.npz import write_npz
from isel_twin.recordings.parquet import write_parquet
from isel_twin.recordings.recorder import BUFFER, Recorder, sample_dtype
from isel_twin.recordings.vcd import PULSE_NS, SETUP_NS, write_vcd

MS = 1_000_000


class Bench:
    """A machine for the recorder to look at: X moves 1 mm/s, 1600 steps/mm; a switch is struck when told."""

    def __init__(self, axes: int = 4) -> None:
        self.axes = axes
        self.time_ns = 0
        self.levels = {"p3.0": True}
        self.inputs = {"limit_x1": "free"}
        self.outputs: dict[str, int] = {}
        self.step_mm = np.full(3, 1 / 1600)
        self._look = None

    @property
    def position_mm(self):
        return np.array([self.time_ns * 1e-9, 0.0, 0.0])

    @property
    def counts(self):
        return np.array([self.time_ns * 1600 // 1_000_000_000, *range(1, self.axes)])

    @property
    def lost_steps(self):
        return np.array([0.25] + [0.0] * (self.axes - 1))

    @property
    def position_error_mm(self):
        return np.zeros(3)

    def sample(self, take, interval_ns):
        """It is looked at: no plant takes samples."""

    def observe(self, callback, interval_ns):
        self._look = callback
        callback(self)

    def listen(self, note):
        """Nothing happens to it."""

    def at(self, time_ns: int, **change) -> None:
        self.time_ns = time_ns
        for name, value in change.items():
            setattr(self, name, value)
        self._look(self)


def stream(*moves: tuple[tuple[int, ...], int, int]) -> Steps:
    """Moves (steps, Hz, start in ns) one after the other at constant speed."""
    steps = Steps(len(moves[0][0]))
    for path, speed_hz, start_ns in moves:
        path_line = line(path)
        steps.append(StepRun(path_line, constant(path_line.ticks, speed_hz), start_ns))
    return steps


class Ticks:
    """A motion of steps at any times: what a trace asks of isel_twin.motion.Motion."""

    lead_ns = start_ns = first = 0

    def __init__(self, times: list[int], delta: list[list[int]]) -> None:
        self.times, self.delta = times, delta
        self.axes, self.last, self.end_ns = len(delta[0]), len(times), times[-1]

    def window(self, k0: int, k1: int):
        return np.array(self.times[k0:k1], dtype=np.int64), np.array(self.delta[k0:k1], dtype=np.int8)


def waveforms(path: Path) -> tuple[dict[str, list[tuple[int, object]]], int]:
    """Changes (time in ns, value) of each signal of a VCD, initial values left out; and the last time in the file."""
    names, changes, now, started = {}, {}, 0, False
    with path.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.VAR:
                names[token.var.id_code] = token.var.reference
                changes[token.var.reference] = []
            elif token.kind is TokenKind.TIMESCALE:
                assert (int(token.timescale.magnitude), token.timescale.unit.value) == (1, "ns")
            elif token.kind is TokenKind.DUMPVARS:
                started = False
            elif token.kind is TokenKind.END:
                started = True
            elif token.kind is TokenKind.CHANGE_TIME:
                assert token.time_change >= now
                now = token.time_change
            elif started and token.kind in (
                TokenKind.CHANGE_SCALAR,
                TokenKind.CHANGE_VECTOR,
                TokenKind.CHANGE_REAL,
                TokenKind.CHANGE_STRING,
            ):
                change = token.data
                changes[names[change.id_code]].append((now, change.value))
    return changes, now


@pytest.fixture
def bench():
    return Bench()


def test_npz_holds_the_stream_exactly(tmp_path):
    write_npz(tmp_path / "s.npz", stream(((3, -3, 0, 0), 1000, 5), ((-2, 0, 0, 0), 500, 10 * MS)))
    with np.load(tmp_path / "s.npz") as loaded:
        assert loaded["t_ns"].dtype == np.int64
        assert loaded["delta"].dtype == np.int8
        assert loaded["t_ns"].tolist() == [MS + 5, 2 * MS + 5, 3 * MS + 5, 12 * MS, 14 * MS]
        assert loaded["delta"].tolist() == [[1, -1, 0, 0]] * 3 + [[-1, 0, 0, 0]] * 2


@pytest.mark.parametrize("axes", [1, 4, 8])
def test_npz_of_nothing(tmp_path, axes):
    write_npz(tmp_path / "s.npz", Steps(axes))
    with np.load(tmp_path / "s.npz") as loaded:
        assert loaded["t_ns"].shape == (0,)
        assert loaded["delta"].shape == (0, axes)
        assert loaded["delta"].dtype == np.int8


def both_kinds() -> Steps:
    """Six axes: two steps of Y, C back with the second, then three set points 4 ms apart, then a step of X."""
    steps = stream(((0, 2, 0, 0, 0, -1), 1000, 0))
    plan = table((300, 0, 0, 0, 0, -70_000), (0, 0, 0, 0, 0, 1), (-500, 0, 0, 0, 0, 0))
    steps.append(SetPointRun(plan, 4 * MS, 2 * MS))
    steps.append(StepRun(line((1, 0, 0, 0, 0, 0)), constant(1, 1000), 14 * MS))
    return steps


def test_npz_of_set_points_is_wide_enough(tmp_path):
    write_npz(tmp_path / "s.npz", both_kinds())
    with np.load(tmp_path / "s.npz") as loaded:
        assert loaded["t_ns"].tolist() == [n * MS for n in (1, 2, 6, 10, 14, 15)]
        assert loaded["delta"].dtype == np.int32
        assert loaded["delta"][:, 5].tolist() == [-1, 0, -70_000, 1, 0, 0]
        assert loaded["delta"][:, 0].tolist() == [0, 0, 300, 0, -500, 1]
        assert loaded["delta"].shape == (6, 6)


def test_npz_of_ten_million_steps_needs_little_memory(tmp_path):
    steps = stream(((10_000_000, 5, 0, 0), 40_000, 0))
    tracemalloc.start()
    write_npz(tmp_path / "s.npz", steps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40_000_000  # the whole stream has 120 MB
    with np.load(tmp_path / "s.npz") as loaded:
        assert loaded["t_ns"][-1] == 250 * 1_000_000_000
        assert loaded["delta"].sum(axis=0, dtype=np.int64).tolist() == [10_000_000, 5, 0, 0]


def test_vcd_pulses_rise_at_their_ticks_with_direction_around_them(tmp_path, bench):
    steps = stream(((2, 0, 0, 0), 1000, 0), ((-2, -1, 0, 0), 1000, 2 * MS))
    with Recorder(bench, MS) as recorder:
        write_vcd(tmp_path / "s.vcd", steps, recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    rises = [MS, 2 * MS, 3 * MS, 4 * MS]
    assert changes["step_x"] == [edge for rise in rises for edge in ((rise, "1"), (rise + PULSE_NS, "0"))]
    assert changes["dir_x"] == [(3 * MS - SETUP_NS, "1")]
    assert [time for time, value in changes["step_y"] if value == "1"] in ([3 * MS], [4 * MS])
    assert changes["step_z"] == changes["dir_z"] == []


def test_vcd_pulses_of_the_fastest_stream_stay_apart(tmp_path, bench):
    """At 10^6 Hz (faster than any controller) a pulse is high for half a period, direction turns in the other half."""
    steps = stream(((3, 0, 0, 0), 1_000_000, 0), ((-3, 0, 0, 0), 1_000_000, 3000))
    with Recorder(bench, MS) as recorder:
        write_vcd(tmp_path / "s.vcd", steps, recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    assert [time for time, value in changes["step_x"] if value == "1"] == [1000, 2000, 3000, 4000, 5000, 6000]
    assert [time for time, value in changes["step_x"] if value == "0"][:5] == [1500, 2500, 3500, 4500, 5500]
    ((turned, _),) = changes["dir_x"]
    assert 3500 <= turned < 4000


def edges(changes: list[tuple[int, object]]) -> list[tuple[int, str]]:
    """Edges of a signal; each is one: there is no change to the value it has, and none twice at a time."""
    assert [value for _, value in changes] == ["1", "0"] * (len(changes) // 2)
    assert all(before < after for (before, _), (after, _) in itertools.pairwise(changes))
    return changes


@pytest.mark.parametrize("gap_ns", [2, 3, 100])
def test_vcd_shows_every_tick_as_a_pulse_of_its_own(tmp_path, bench, gap_ns):
    """An edge counter has to see all of them, also where the direction turns between two close ones."""
    times = [t for start in (MS, 2 * MS, 3 * MS) for t in (start, start + gap_ns)]
    delta = [[1, 0, 0, 0], [1, 1, 0, 0], [-1, 0, 0, 0], [-1, 0, 0, 0], [1, 0, 0, 0], [-1, 0, 0, 0]]
    with Recorder(bench, MS) as recorder:
        write_vcd(tmp_path / "s.vcd", Steps(4, [Ticks(times, delta)]), recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    pulses = edges(changes["step_x"])
    assert [time for time, value in pulses if value == "1"] == times
    falls = [time for time, value in pulses if value == "0"]
    minus = [("1", falls[1], times[2]), ("0", falls[3], times[4]), ("1", falls[4], times[5])]
    for (turned, value), (expected, after, before) in zip(changes["dir_x"], minus, strict=True):
        assert value == expected
        assert after <= turned < before


@pytest.mark.parametrize("gap_ns", [0, 1])
def test_vcd_makes_one_pulse_of_ticks_too_close_for_two(tmp_path, bench, gap_ns):
    """X steps with both, turned with the second; Y with the first, Z with the second alone."""
    times = [t for start in (MS, 2 * MS) for t in (start, start + gap_ns)]
    delta = [[1, 1, 0, 0], [-1, 0, 1, 0]] * 2
    with Recorder(bench, MS) as recorder:
        write_vcd(tmp_path / "s.vcd", Steps(4, [Ticks(times, delta)]), recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    rises = {axis: [t for t, value in edges(changes[f"step_{axis}"]) if value == "1"] for axis in "xyz"}
    assert rises == {"x": times[::2], "y": times[::2], "z": times[1::2]}
    assert changes["dir_x"] == [(times[1], "1"), (times[2] - SETUP_NS, "0"), (times[3], "1")]
    assert changes["dir_y"] == changes["dir_z"] == []
    assert {name for name in changes if name.startswith("command")} == set()


def test_vcd_shows_a_full_step_of_two_half_steps_as_one_pulse(tmp_path, bench):
    with Recorder(bench, MS) as recorder:
        write_vcd(tmp_path / "s.vcd", Steps(4, [Ticks([MS, 2 * MS], [[2, 0, -2, 0], [-2, 0, 0, 0]])]), recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    assert changes["step_x"] == [(MS, "1"), (MS + PULSE_NS, "0"), (2 * MS, "1"), (2 * MS + PULSE_NS, "0")]
    assert changes["step_z"] == [(MS, "1"), (MS + PULSE_NS, "0")]
    assert changes["dir_x"] == [(2 * MS - SETUP_NS, "1")]
    assert changes["dir_z"] == [(MS - SETUP_NS, "1")]


@pytest.mark.parametrize("axes", [1, 2, 8])
def test_vcd_names_as_many_axes_as_there_are(tmp_path, axes):
    with Recorder(Bench(axes), MS) as recorder:
        write_vcd(tmp_path / "s.vcd", stream(((1,) * axes, 1000, 0)), recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    names = "xyzabcuv"[:axes]
    for pattern in ("step_{}", "dir_{}", "count_{}", "lost_{}_steps"):
        assert {pattern.format(name) for name in names} <= set(changes)
    assert {name for name in changes if name.startswith(("step", "count"))} == {
        f"{kind}_{name}" for kind in ("step", "count") for name in names
    }
    assert [changes[f"step_{name}"][0] for name in names] == [(MS, "1")] * axes
    assert {name for name in changes if name.startswith("position")} == {f"position_{name}_mm" for name in "xyz"}


def test_vcd_shows_set_points_as_commands(tmp_path):
    steps = Steps(2, [SetPointRun(table((5, 0), (0, 0), (-12, 70_000)), 4 * MS, 100)])
    with Recorder(Bench(2), MS) as recorder:
        write_vcd(tmp_path / "s.vcd", steps, recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    assert changes["command_x"] == [(4 * MS + 100, 5), (12 * MS + 100, -7)]
    assert changes["command_y"] == [(12 * MS + 100, 70_000)]
    assert not {"step_x", "dir_x", "step_y", "dir_y"} & set(changes)


def test_vcd_of_steps_and_set_points_has_pulses_and_the_sum_of_both(tmp_path):
    with Recorder(Bench(6), MS) as recorder:
        write_vcd(tmp_path / "s.vcd", both_kinds(), recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    assert [time for time, value in changes["step_y"] if value == "1"] == [MS, 2 * MS]
    assert [time for time, value in changes["step_x"] if value == "1"] == [15 * MS]
    assert changes["command_y"] == [(MS, 1), (2 * MS, 2)]
    assert changes["command_c"] == [(MS, -1), (6 * MS, -70_001), (10 * MS, -70_000)]
    assert changes["command_x"] == [(6 * MS, 300), (14 * MS, -200), (15 * MS, -199)]


def test_vcd_shows_samples_and_changes(tmp_path, bench):
    with Recorder(bench, MS) as recorder:
        bench.at(1 * MS)
        bench.at(1_500_000, inputs={"limit_x1": "struck"}, levels={"p3.0": False}, outputs={"lamp_stop": 1})
        bench.at(2 * MS)
        write_vcd(tmp_path / "s.vcd", Steps(4), recorder)
    changes, end = waveforms(tmp_path / "s.vcd")
    assert end == 2 * MS
    assert [time for time, _ in changes["position_x_mm"]] == [1 * MS, 1_500_000, 2 * MS]
    assert [value for _, value in changes["position_x_mm"]] == pytest.approx([0.001, 0.0015, 0.002])
    assert changes["p3_0"][-1] == (1_500_000, "0")
    assert changes["limit_x1"][-1] == (1_500_000, "struck")
    assert changes["limit_x1_changed"][-1] == (1_500_000, "1")
    assert changes["lamp_stop"][-1] == (1_500_000, "1")


def test_parquet_has_a_row_a_sample_and_holds_values(tmp_path, bench):
    with Recorder(bench, MS) as recorder:
        bench.at(1 * MS)
        bench.at(1_500_000, inputs={"limit_x1": "struck"}, levels={"p3.0": False}, outputs={"lamp_stop": 1})
        bench.at(2 * MS)
        write_parquet(tmp_path / "s.parquet", recorder)
    units = {field.name: (field.metadata or {}).get(b"unit") for field in pq.read_schema(tmp_path / "s.parquet")}
    assert (units["time_ns"], units["count_x"], units["position_z_mm"]) == (b"ns", b"steps", b"mm")
    assert (units["lost_a_steps"], units["level_p3.0"], units["input_limit_x1"]) == (b"steps", b"1", None)
    assert all(field.metadata[b"description"] for field in pq.read_schema(tmp_path / "s.parquet"))
    table = pq.read_table(tmp_path / "s.parquet").to_pydict()
    assert table["time_ns"] == [0, 1 * MS, 1_500_000, 2 * MS]
    assert table["position_x_mm"] == pytest.approx([0.0, 0.001, 0.0015, 0.002])
    assert table["count_x"] == [0, 1, 2, 3]
    assert table["lost_x_steps"] == [0.25] * 4
    assert table["level_p3.0"] == [1, 1, 0, 0]
    assert table["input_limit_x1"] == ["free", "free", "struck", "struck"]
    assert table["output_lamp_stop"] == [None, None, 1, 1]


@pytest.mark.parametrize("axes", [1, 6, 8])
def test_samples_have_as_many_counters_as_the_controller(tmp_path, axes):
    with Recorder(bench := Bench(axes), MS) as recorder:
        bench.at(2 * MS)
        (samples,) = recorder.samples()
        assert samples.dtype == sample_dtype(axes)
        assert samples["counts"].tolist() == [[n, *range(1, axes)] for n in (0, 3)]
        assert samples["position_mm"].shape == (2, 3)
        write_parquet(tmp_path / "s.parquet", recorder)
    table = pq.read_table(tmp_path / "s.parquet").to_pydict()
    assert [name for name in table if name.startswith("count_")] == [f"count_{name}" for name in "xyzabcuv"[:axes]]
    assert table["lost_x_steps"] == [0.25, 0.25]
    assert table[f"count_{'xyzabcuv'[axes - 1]}"][1] == (axes - 1 if axes > 1 else 3)


def test_of_several_looks_at_one_instant_the_last_counts(bench):
    with Recorder(bench, MS) as recorder:
        bench.at(1 * MS)
        bench.at(1 * MS, outputs={"stages": 0})
        bench.at(1 * MS, outputs={"stages": 1})
        (samples,) = recorder.samples()
        assert samples["time_ns"].tolist() == [0, 1 * MS]
        assert [change.value for change in recorder.changes if change.name == "stages"] == [0, 1]


def test_a_long_recording_goes_to_disk_and_comes_back(tmp_path, bench):
    count = 2 * BUFFER + 100
    with Recorder(bench, MS) as recorder:
        for number in range(1, count):
            bench.at(number * MS)
        assert len(recorder) == count
        pieces = list(recorder.samples(1000))
        assert max(len(piece) for piece in pieces) <= 1000
        times = np.concatenate([piece["time_ns"] for piece in pieces])
        assert np.array_equal(times, np.arange(count) * MS)
        bench.at(count * MS)  # and it goes on
        assert sum(len(piece) for piece in recorder.samples()) == count + 1
        write_parquet(tmp_path / "s.parquet", recorder)
    assert pq.read_metadata(tmp_path / "s.parquet").num_rows == count + 1


def test_a_failed_trace_leaves_the_old_file(tmp_path, bench):
    target = tmp_path / "s.vcd"
    target.write_text("old")
    broken = Ticks([MS], [[1, 0, 0, 0]])
    broken.window = lambda k0, k1: 1 / 0
    with Recorder(bench, MS) as recorder, pytest.raises(ZeroDivisionError):
        write_vcd(target, Steps(4, [broken]), recorder)
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["s.vcd"]


def test_a_real_move_is_seen_alike_by_stream_samples_and_waveform(tmp_path):
    from isel_twin.core.twin import Twin

    twin = Twin(plant="kinematic")
    with Recorder(twin, 10 * MS) as recorder:
        assert twin.query("@07") == "0"
        assert twin.query("@0R7") == "0"
        referenced_ns = twin.time_ns
        assert twin.query("@0A 3200,5000,-0,30,0,30,0,30") == "0"
        write_vcd(tmp_path / "s.vcd", twin.steps, recorder)
        write_parquet(tmp_path / "s.parquet", recorder)
    changes, _ = waveforms(tmp_path / "s.vcd")
    rises = [time for time, value in changes["step_x"] if value == "1" and time > referenced_ns]
    stream_ns = twin.steps.t_ns
    assert rises == stream_ns[stream_ns > referenced_ns].tolist()
    assert len(rises) == 3200
    table = pq.read_table(tmp_path / "s.parquet")
    times = table["time_ns"].to_numpy()
    assert np.all(np.diff(times) > 0)
    made = np.searchsorted(stream_ns[stream_ns > referenced_ns], times[times > referenced_ns], side="right")
    assert np.array_equal(table["count_x"].to_numpy()[times > referenced_ns], made)
    assert {"limit_x1", "limit_x2"} <= {name.removeprefix("input_") for name in table.column_names}
    assert "struck" in table["input_limit_x1"].to_pylist()
