"""The environment of set points: pulses, what is seen of the machine, how an episode ends, and that it repeats."""

from __future__ import annotations

import contextlib
import copy
import hashlib
import math
import multiprocessing
import pickle
import sys
import types
from dataclasses import replace
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from isel_twin.envs import tracking
from isel_twin.envs.paths import lay_path, sampled
from isel_twin.envs.track import TrackPath
from isel_twin.envs.variations import VARIATIONS, varied
from isel_twin.native import core
from isel_twin.plant.memory import MEMORY
from isel_twin.plant.mujoco import MujocoPlant

ID = "isel_twin.envs:isel_twin/TrackPath-v0"
STEPS_PER_MM = 320
SLANTING = [(0.0, 0.0), (20.0, 12.0)]
PLAY_MM = 0.01 + 4 / STEPS_PER_MM
"""How far a tool lags behind its counter at ease: half of the backlash, and half a full step of load angle."""


def make(**options: Any) -> TrackPath:
    env = gymnasium.make(ID, **options).unwrapped
    assert isinstance(env, TrackPath)
    return env


def at_speed(mm_s: float, way: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> NDArray[np.float32]:
    """The action that leads along a direction at a speed."""
    return np.array(way, dtype=np.float32) * np.float32(mm_s * STEPS_PER_MM / 16_000)


def led(env: TrackPath, mm_s: float, mm_s2: float = 1e9) -> list[tuple[Any, ...]]:
    """An episode along its path by the counter, from standstill and back to it."""
    results = []
    path, step_s = env.path_mm, env.step_s
    at_mm, speed = 0.0, 0.0
    while True:
        speed = min(mm_s, speed + mm_s2 * step_s, math.sqrt(2.0 * mm_s2 * max(0.0, path[-1, 3] - at_mm)))
        at_mm = min(path[-1, 3], at_mm + speed * step_s)
        target = np.array([np.interp(at_mm, path[:, 3], path[:, i]) for i in range(3)])
        results.append(env.step((target - env.counter_mm) / step_s * STEPS_PER_MM / 16_000))
        if results[-1][2] or results[-1][3]:
            return results


@pytest.mark.filterwarnings("error", "default::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("options", [{}, {"path": "random", "machine": "4030-portal", "step_s": 0.005}])
def test_gymnasium_finds_nothing_wrong(options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """On a computer without a screen, pictures included if there is OpenGL."""
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    shown = make(**options, render_mode="rgb_array")
    shown.reset()
    try:
        shown.render()
    except RuntimeError:  # no OpenGL
        check_env(make(**options), skip_render_check=True)
    else:
        check_env(shown)


def test_pulses_are_evenly_spaced_whatever_the_steps() -> None:
    """At f Hz pulse k falls (k + 1/2) / f after the start."""
    lanes = np.zeros(3, tracking.LANE)
    lanes["rate_hz"] = 3700.0, -1234.5, 0.0
    t_ns, delta = np.zeros(1000, np.int64), np.zeros((1000, 3), np.int32)
    seen: list[tuple[NDArray[np.int64], NDArray[np.int32]]] = []
    for step in range(100):
        n = core.lay_pulses(lanes, step * 2_000_000, 2_000_000, t_ns, delta)
        seen.append((t_ns[:n].copy(), delta[:n].copy()))
    times, changes = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    assert (np.diff(times) >= 0).all()
    for axis, rate_hz in ((0, 3700.0), (1, -1234.5)):
        mine = times[changes[:, axis] != 0]
        expected = 1e9 * (np.arange(len(mine)) + 0.5) / abs(rate_hz)
        np.testing.assert_allclose(mine, expected, atol=1.0)
        assert len(mine) == round(0.2 * abs(rate_hz))
        assert changes[:, axis].sum() == lanes["counter"][axis] == math.copysign(len(mine), rate_hz)
    assert not changes[:, 2].any()


def test_a_step_is_what_the_plant_makes_of_its_pulses() -> None:
    """Drives and machine handed the pulses of closed form, in one stretch: the same place to the bit."""
    env = make(reference_mm=0.0, path=[(0, 0), (0, 100)])
    env.reset(seed=0)
    for _ in range(100):
        env.step(np.array([0.0, 0.2, 0.0]))  # 3200 Hz
    start_ns, until_ns = 100_000_000, 300_000_000
    plant = MujocoPlant(env.machine, (), np.array([197.5, 150.0, 70.0]), 3)
    plant.set_power(stages=True, brake_released=True, lowering=False)
    plant.advance(start_ns, np.empty(0, np.int64), np.empty((0, 3), np.int32))
    t_ns = start_ns + 312_500 * np.arange(640, dtype=np.int64) + 156_250
    before_mm = plant.position_mm
    plant.advance(until_ns, t_ns, np.tile([0, 1, 0], (len(t_ns), 1)))
    assert plant.commanded.tolist() == [0, len(t_ns), 0]
    np.testing.assert_array_equal(env.tool_mm, plant.position_mm - before_mm)


@pytest.mark.parametrize("supply", [1.0, 0.73, 1.5])
def test_the_edge_is_the_limit_over_the_speed_and_each_step_has_its_own(supply: float) -> None:
    """Screws of 5 mm: at 50 mm/s the motor turns with 20 pi rad/s."""
    env = make(path=[(0, 0), (0, 100)], reference_mm=0.0, tolerance_mm=10.0)
    _, info = env.reset(seed=0, options={"supply": supply})
    assert info["edge"] == math.inf
    y = env.machine.axes[1]
    limit = replace(y, stage=replace(y.stage, supply_v=supply * y.stage.supply_v)).swing_limit_rad_s
    for share in [*np.linspace(0.02, 1.0, 50), *[1.0] * 50]:
        *_, info = env.step(np.array([0.0, share, 0.0]))
    assert info["edge"] == pytest.approx(limit / (20.0 * math.pi), rel=0.01)
    for share in [*np.linspace(1.0, 0.5, 25), *[0.5] * 50]:
        *_, info = env.step(np.array([0.0, share, 0.0]))
    assert info["edge"] == pytest.approx(limit / (10.0 * math.pi), rel=0.01)
    for share in [*np.linspace(0.5, 0.0, 25), *[0.0] * 50]:
        *_, info = env.step(np.array([0.0, share, 0.0]))
    assert info["edge"] == math.inf


def test_there_and_back_ends_where_it_began() -> None:
    lanes = np.zeros(3, tracking.LANE)
    t_ns, delta = np.zeros(1000, np.int64), np.zeros((1000, 3), np.int32)
    for rate_hz in (777.0, 16_000.0, -16_000.0, -777.0):
        lanes["rate_hz"] = rate_hz
        core.lay_pulses(lanes, 0, 2_000_000, t_ns, delta)
    assert (lanes["counter"] == 0).all()


def test_a_slow_round_is_done_and_keeps_within_play_and_load_angle() -> None:
    env = make(reference_mm=0.0)
    start, _ = env.reset(seed=0)
    np.testing.assert_allclose(start[:15], 0.0, atol=1e-3)
    np.testing.assert_allclose(start[18:33].reshape(5, 3), [[1, 0, 0]] * 5)
    np.testing.assert_array_equal(start[33:], 1.0)
    results = led(env, 20.0, 300.0)
    *_, terminated, truncated, info = results[-1]
    assert (terminated, truncated, info["ended"]) == (True, False, "done")
    assert info["way_mm"] == pytest.approx(70.0, abs=0.1)
    assert info["time_s"] == pytest.approx(70.0 / 20.0 + 20.0 / 300.0, abs=0.05)
    deviations = np.array([info["deviation_mm"] for *_, info in results])
    assert deviations.max() < 1.5 * math.sqrt(2.0) * PLAY_MM
    total = sum(reward for _, reward, *_ in results)
    squares = (np.minimum(deviations / 0.1, 1.0) ** 2).sum()
    assert total == pytest.approx(info["way_mm"] - info["time_s"] * 10.0 - 20.0 * 0.002 * squares)


def test_what_is_seen_on_the_way() -> None:
    env = make(path=[(0, 0), (10, 0), (10, 5)], reference_mm=0.0)
    env.reset(seed=0)
    for _ in range(250):
        observation, *_, info = env.step(at_speed(10.0))
    assert env.counter_mm[0] == pytest.approx(5.0, abs=0.002)
    np.testing.assert_allclose(observation[3:6], [0.2, 0.0, 0.0], atol=0.02)
    np.testing.assert_allclose(observation[6:9], [0.2, 0.0, 0.0], atol=1e-6)
    assert 0.0 < observation[9] < 0.5, "the rotor pulls"
    assert 0.0 < observation[12] * 0.2 < PLAY_MM, "the counter is ahead of the tool"
    assert info["way_mm"] + observation[12] * 0.2 == pytest.approx(env.counter_mm[0], abs=1e-6)
    np.testing.assert_allclose(env.tool_mm, [info["way_mm"], 0.0, 0.0], atol=1e-6)
    left_mm = 10.0 - info["way_mm"]
    np.testing.assert_allclose(observation[27:30], [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(observation[30:33], [left_mm / 8.0, (8.0 - left_mm) / 8.0, 0.0], atol=1e-9)
    assert observation[33] == pytest.approx(1.0 - info["way_mm"] / 15.0)
    assert observation[34] == pytest.approx(1.0 - 0.5 / 5.0)


@pytest.mark.parametrize(
    ("action", "ended"), [((0.0, 0.2, 0.0), "outside"), ((0.0, 0.0, 0.0), "time"), ((1.0, 0.0, 0.0), "lost steps")]
)
def test_how_else_an_episode_ends(action: tuple[float, float, float], ended: str) -> None:
    env = make(path="corner", highest_hz=40_000, time_limit_s=0.1)
    env.reset(seed=0)
    total, steps, over = 0.0, 0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(np.array(action, np.float32))
        total, steps, over = total + reward, steps + 1, terminated or truncated
    assert info["ended"] == ended
    assert (terminated, truncated) == ((False, True) if ended == "time" else (True, False))
    assert (steps == 50) == (ended == "time")
    assert info["reward_abort"] == (0.0 if ended == "time" else -100.0)
    if ended == "lost steps":
        assert abs(observation[9]) == 1.0, "two full steps"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3, np.float32))


def test_what_is_further_than_the_tolerance_is_outside() -> None:
    env = make(path="corner", reference_mm=0.0)
    env.reset(seed=0)
    least = math.inf
    while True:
        *_, terminated, _, info = env.step(at_speed(5.0, (0.0, 1.0, 0.0)))
        if terminated:
            break
        least = info["deviation_mm"]
    assert least < 0.1 < info["deviation_mm"] < 0.1 + 2 * 0.002 * 5.0


@pytest.mark.parametrize("action", [(0.0, 0.0), (0.0, 0.0, math.nan), (math.inf, 0.0, 0.0)])
def test_an_action_that_is_none_is_refused(action: tuple[float, ...]) -> None:
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action is .* three finite numbers"):
        env.step(np.array(action))


VARIED = {"payload_kg": 6.0, "friction": 1.5, "stiffness": 0.5, "supply": 0.75, "backlash": 2.0}
SAME = {
    "payload.mass": 6.0,
    "axes.all.guide_friction": 30.0 * 1.5,
    "axes.all.shaft_coulomb": 0.09 * 1.5,
    "axes.all.stiffness": 30.0 * 0.5,
    "structure.flex_x.stiffness": 2.5,
    "structure.nod_y.stiffness": 2.5,
    "structure.flex_y.stiffness": 4.0,
    "axes.all.stage.supply": 36.0,
    "axes.all.backlash": 0.04,
}
"""The same machine by its file's parameters."""


def digest(env: Any, seed: int | None = 3, options: dict[str, Any] | None = None, steps: int = 200) -> str:
    """Everything that an episode of some hundred steps shows, to the bit."""
    observation, _ = env.reset(seed=seed, options=options)
    seen = [observation.tobytes()]
    for k in range(steps):
        action = 0.3 * math.sin(0.05 * k) ** 2 * observation[18:21]
        observation, reward, terminated, *_ = env.step(action)
        seen.append(observation.tobytes() + np.float64(reward).tobytes())
        if terminated:
            break
    assert len(seen) > 50
    return hashlib.sha256(b"".join(seen)).hexdigest()


def test_options_are_the_machine_with_other_parameters_for_one_episode() -> None:
    env, other = make(path=SLANTING), make(path=SLANTING, overrides=SAME)
    plain = digest(env)
    assert digest(env, options=VARIED) == digest(other)
    assert digest(env) == plain, "the next episode is on the machine as it is"
    for name in VARIED:
        assert digest(env, options={name: VARIED[name]}, steps=120) != digest(env, steps=120), f"{name} has no effect"


DRAWN = {
    "payload_kg": (0.0, 8.0),
    "friction": (0.3, 1.5),
    "stiffness": (0.5, 1.0),
    "supply": (0.8, 1.3),
    "backlash": (0.0, 3.0),
}


def test_a_reset_in_place_is_to_the_bit_the_machine_built_anew() -> None:
    """Any options after any others: only what they change is computed."""
    env, draw = make(path=SLANTING), np.random.default_rng(27)
    for number in range(24):
        names = [name for name in DRAWN if draw.random() < (0.5 if number % 3 else 0.2)]
        options = {name: draw.uniform(*DRAWN[name]) for name in names}
        anew = make(path=SLANTING, machine=varied(env.machine, options))
        assert digest(env, number, options, 100) == digest(anew, number, None, 100), options
        assert env._plant is not None
        assert anew._plant is not None
        for name in ("axes", "drives", "screws", "states", "joints_law", "springs", "available", "qpos", "qvel"):
            assert getattr(env._plant.parts, name).tobytes() == getattr(anew._plant.parts, name).tobytes(), (
                name,
                options,
            )


def test_same_seed_same_bits_whatever_came_before() -> None:
    env = make(path="random")
    first = digest(env)
    for options in ({"payload_kg": 3.0}, {"path": "circle", "friction": 0.8}, {}):
        env.reset(options=options)
        env.step(np.ones(3, np.float32))
    assert digest(env) == first == digest(make(path="random"))
    assert len({first, digest(env, None), digest(env, 4)}) == 3


def test_same_seed_same_bits_in_another_process() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(digest, (make(),)) == digest(make())


def test_a_copy_goes_on_in_mid_episode_to_the_bit() -> None:
    env = make()
    env.reset(seed=0, options={"payload_kg": 2.0})
    for _ in range(40):
        env.step(at_speed(15.0))
    others = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
    expected = [env.step(at_speed(15.0))[0].tobytes() for _ in range(40)]
    for other in others:
        assert [other.step(at_speed(15.0))[0].tobytes() for _ in range(40)] == expected
        assert digest(other) == digest(env)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mass": 1.0}, "unknown options ['mass']; there are: payload_kg, friction, stiffness, supply, backlash, path"),
        ({"friction": 11}, "option friction is 11; allowed: 0.1 to 10"),
        ({"supply": "48 V"}, "option supply is '48 V'; allowed: 0.5 to 1.5"),
        ({"payload_kg": math.nan}, "option payload_kg is nan; allowed: 0 to 20"),
        ({"path": "triangle"}, "path is 'triangle'; there are: corner, square, circle, random, or points"),
        ({"path": [(0, 0), (500, 0)]}, "path is 500 mm wide along x; allowed: up to 393"),
        ({"path": [(0, 0), (0, 0)]}, "path is 0 mm long"),
        ({"path": [(0, 0), (1, math.inf)]}, "path is no list of at least two points"),
    ],
)
def test_a_wrong_option_is_one_clear_line(options: dict[str, Any], message: str) -> None:
    env = make()
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the line is compared below)
        env.reset(options=options)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
    env.reset(seed=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"step_s": 0.0007}, "step_s is 0.0007; allowed: multiples of 0.0005 s up to 0.1 s"),
        ({"tolerance_mm": 0.0}, "tolerance_mm is 0.0; allowed: 0.001 to 10"),
        ({"reference_mm": 0.1}, "reference_mm is 0.1; allowed: 0 to 0.0519615"),
        ({"overrides": {"axes.x.backlsh": 0.0}}, "did you mean 'axes.x.backlash'"),
        ({"machine": "4030-servo"}, "axes.x has a servo drive; TrackPath-v0 is for stepper motors"),
        ({"render_mode": "ansi"}, "unknown render_mode 'ansi'"),
    ],
)
def test_a_wrong_argument_is_one_clear_line(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the line is compared below)
        TrackPath(**arguments)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_numbers_that_the_machine_cannot_have_are_one_clear_line() -> None:
    env = make(overrides={"axes.x.backlash": 0.9})
    with pytest.raises(ValueError, match=r"^the machine does not take these options: screw: backlash_mm must lie in"):
        env.reset(options={"backlash": 5.0})


def test_a_sampled_path_keeps_its_corners() -> None:
    path = sampled(lay_path([(1.0, 1.0), (2.03, 1.0), (2.03, 4.0)], np.random.default_rng(0)))
    np.testing.assert_allclose(np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1), np.diff(path[:, 3]))
    assert np.diff(path[:, 3]).max() <= 0.1 + 1e-12
    assert np.abs(path[:, :3] - (1.03, 0.0, 0.0)).sum(axis=1).min() < 1e-12, "the corner"
    np.testing.assert_allclose(path[[0, -1]], [(0.0, 0.0, 0.0, 0.0), (1.03, 3.0, 0.0, 4.03)])


def test_the_nearest_point_of_a_path_that_crosses_itself_is_on_the_branch_that_one_is_on() -> None:
    path = sampled(np.array([(0, 0, 0), (10, 0, 0), (10, 5, 0), (5, 5, 0), (5, -5, 0.0)]))
    track = np.zeros(1, tracking.TRACK)
    lanes, unused = np.zeros(3, tracking.LANE), (np.zeros(0, np.int64), np.zeros((0, 3), np.int32))
    where = tracking.place_of((np.zeros(1, MEMORY), track, lanes, np.zeros((3, 0)), path, *unused))
    for way_mm, place in ((4.98, (4.99, 0.01, 0.0)), (5.02, (5.03, 0.01, 0.0))):
        track["way_mm"], track["piece"] = way_mm, round(way_mm * 10)
        track["tool_mm"] = place[0] - 0.02, 0.01, 0.0
        assert core.follow_tool(where, np.array(place)) == pytest.approx(place[0] - way_mm, abs=1e-9)
        assert track["way_mm"][0] == pytest.approx(place[0], abs=1e-9), "as far along the way as along X"
        assert track["deviation_mm"][0] == pytest.approx(0.01)


def test_a_picture_shows_path_and_machine_or_one_line_says_what_is_missing() -> None:
    env = make(path="circle", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        image = env.render()
    except RuntimeError as error:
        said = str(error)
    else:
        said = ""
    env.close()
    if said:
        assert said.startswith("no picture without OpenGL")
        return
    assert image is not None
    assert image.shape == (480, 640, 3)
    red = (image[..., 0] > 150) & (image[..., 1] < 60) & (image[..., 2] < 60)
    assert 100 < red.sum() < 0.2 * red.size, "the path"


class Viewer:
    """Stands for MuJoCo's window."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, **_: object) -> None:
        self.data, self.shown, self.closed = data, [], False
        self.user_scn = mujoco.MjvScene(model, 1000)

    def lock(self) -> contextlib.AbstractContextManager[None]:
        """Nobody else looks."""
        return contextlib.nullcontext()

    def sync(self) -> None:
        """Keep what is shown: pieces of the path, place of X."""
        self.shown.append((self.user_scn.ngeom, float(self.data.joint("x").qpos[0])))

    def close(self) -> None:
        """The end."""
        self.closed = True


def test_a_window_shows_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    windows: list[Viewer] = []
    stand_in = types.ModuleType("mujoco.viewer")
    stand_in.launch_passive = lambda *a, **k: windows.append(Viewer(*a, **k)) or windows[-1]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "mujoco.viewer", stand_in)
    monkeypatch.setattr(mujoco, "viewer", stand_in, raising=False)
    env = make(render_mode="human", path=[(0, 0), (2, 0)])
    env.reset(seed=0)
    for _ in range(20):
        env.step(at_speed(20.0))
    env.close()
    (window,) = windows
    pieces, places = zip(*window.shown, strict=True)
    assert set(pieces) == {20}, "2 mm in pieces of 0.1 mm"
    assert places[-1] - places[0] == pytest.approx(19 * 0.002 * 0.02, rel=0.1)
    assert window.closed


def test_a_random_path_does_not_move_the_machine() -> None:
    """So nothing has to be settled anew for it; one that has no room in the middle does."""
    env = make(path="random")
    env.reset(seed=0)
    stands = env._stands
    env.reset(seed=1)
    assert env._stands == stands
    env.reset(options={"path": [(0, 0), (300, 0)]})
    assert env._stands != stands


def test_a_window_needs_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    env = make(render_mode="human")
    env.reset(seed=0)
    with pytest.raises(RuntimeError, match=r"^no window without a screen: DISPLAY is not set"):
        env.step(np.zeros(3, np.float32))
    assert VARIATIONS.keys() == VARIED.keys()
