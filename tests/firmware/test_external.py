"""The place of another control: what docs/connections.md says of its lines, in lockstep and ahead."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.capture.load import load
from isel_twin.capture.player import Player
from isel_twin.capture.ticks import Ticks
from isel_twin.controller import create_controller
from isel_twin.firmware.external import External
from isel_twin.language import MoveSettings, create_language
from isel_twin.machine import load_machine
from isel_twin.motion import Listed
from isel_twin.motion.spreading import spread
from isel_twin.recordings.npz import write_npz

MS_NS = 1_000_000
START_MM = (100.0, 100.0, 50.0)
ON_NS = 1000  # what `out` takes
ON = "out power_request=1 stages=1 brake=1"


def switched_on(plant: str = "kinematic", **how: Any) -> Twin:
    twin = Twin(**{"controller": "external", "plant": plant, "start_mm": START_MM, **how})
    assert twin.query(ON).split()[:2] == ["ok", str(ON_NS)]
    return twin


def bits(twin: Twin, answer: str) -> Mapping[str, int]:
    """Levels of an answer by name, as a client reads them."""
    _, _, *names = twin.query("names").split()
    levels = int(answer.split()[2], 16)
    return {name: levels >> bit & 1 for bit, name in enumerate(names)}


def seen(twin: Twin) -> tuple[Any, ...]:
    """All that a refused line must not change."""
    return twin.counts.tolist(), len(twin.steps), dict(twin.outputs), dict(twin.levels), twin.time_ns, twin.fault


# ---- rows ------------------------------------------------------------------------------------------------------------


def test_a_row_is_made_and_answered_at_its_end() -> None:
    twin = switched_on()
    assert twin.query(f"row {2 * MS_NS} 4 -2 0").split()[:2] == ["ok", str(ON_NS + 2 * MS_NS)]
    assert twin.counts.tolist() == [4, -2, 0]
    steps = twin.steps
    assert (steps.t_ns - ON_NS).tolist() == [250_000, 500_000, 750_000, 1_250_000, 1_500_000, 1_750_000]
    assert steps.delta.tolist() == [[1, 0, 0], [0, -1, 0], [1, 0, 0], [1, 0, 0], [0, -1, 0], [1, 0, 0]]


def test_counters_of_a_row_are_absolute_and_a_row_without_change_lets_time_pass() -> None:
    twin = switched_on()
    twin.query(f"row {MS_NS} 5 0 0")
    assert twin.query(f"row {MS_NS} 5 0 0").split()[1] == str(ON_NS + 2 * MS_NS)
    assert twin.query(f"row {MS_NS} 3 0 0").split()[1] == str(ON_NS + 3 * MS_NS)
    assert (twin.counts.tolist(), len(twin.steps)) == ([3, 0, 0], 7)


@pytest.mark.parametrize("seed", range(4))
def test_steps_of_a_row_lie_in_the_middle_of_equal_parts(seed: int) -> None:
    """Against the formula in exact fractions, axis by axis."""
    draw = np.random.default_rng(seed)
    for _ in range(50):
        changes, ns = draw.integers(-60, 61, 5), int(draw.integers(1_000, 3 * MS_NS))
        start = int(draw.integers(0, 10**12))
        t_ns, delta = spread(changes, start, ns)
        assert np.all(np.diff(t_ns) > 0)
        for axis, change in enumerate(changes.tolist()):
            n = abs(change)
            wanted = [start + int(Fraction(ns * (2 * k - 1), 2 * n)) for k in range(1, n + 1)]
            made = delta[:, axis] != 0
            assert t_ns[made].tolist() == wanted
            assert set(delta[made, axis].tolist()) <= {1 if change > 0 else -1}


def test_equal_rows_make_an_even_frequency() -> None:
    twin = switched_on()
    for row in range(1, 6):
        twin.query(f"row {MS_NS} {8 * row} 0 0")
    assert set(np.diff(twin.steps.t_ns).tolist()) == {125_000}


def test_rows_sent_ahead_follow_each_other_without_a_gap() -> None:
    one, ahead = switched_on(), switched_on()
    rows = [f"row {MS_NS} {7 * row} {-row} 0\n" for row in range(1, 200)]
    answers = [one.query(row.strip()) for row in rows]
    ahead.write("".join(rows).encode())
    assert ahead.run_until_idle(1.0)
    assert ahead.read().decode().splitlines() == answers
    assert np.array_equal(one.steps.t_ns, ahead.steps.t_ns)


def test_a_wide_queue_makes_the_host_wait() -> None:
    control = External()
    control.power_on(0, {})
    assert control.clear_to_send
    control.receive(0, b"row 1000000 1 0 0\n" * 65)
    assert not control.clear_to_send
    control.advance(MS_NS)
    assert control.clear_to_send == (len(control._queue) < 64)


def test_a_led_row_moves_evenly() -> None:
    """Half a row, half its change: a servo drive's command, and no step."""
    twin = switched_on(machine="4030-servo", overrides={"imperfections": "ideal"})
    twin.query("form led")
    step_mm = twin.step_mm[0]
    twin.write(f"row {4 * MS_NS} 4000 0 0\n".encode())
    places = []
    for _ in range(4):
        twin.run_until(twin.time_ns + MS_NS)
        places.append(round(float(twin.machine_position_mm[0] - START_MM[0]) / step_mm, 6))
    assert places == [1000.0, 2000.0, 3000.0, 4000.0]
    assert len(twin.steps) == 1


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_rows_are_what_drive_makes_of_their_steps(plant: str, tmp_path: Path) -> None:
    """A live session is a file: the same stream, the same places, to the bit."""
    draw = np.random.default_rng(7)
    twin = switched_on(plant)
    at = np.zeros(3, np.int64)
    for _ in range(1000 if plant == "kinematic" else 150):
        at += draw.integers(-9, 10, 3)
        ns = int(draw.integers(200_000, 2 * MS_NS))
        assert twin.query(f"row {ns} {' '.join(map(str, at))}").startswith("ok ")
    write_npz(tmp_path / "live.npz", twin.steps)
    ticks = load(tmp_path / "live.npz")
    # what the control did with its stages is not in an .npz
    told = tuple((0, name, 1) for name in ("power_request", "stages", "brake"))
    contacts = tuple(contact.name for contact in load_machine("4030").contacts)
    player = Player(Ticks(ticks.t_ns, ticks.delta, ticks.end_ns, told), contacts)
    again = Twin(controller=player, plant=plant, start_mm=START_MM)
    again.run_until(twin.time_ns)
    assert np.array_equal(again.steps.delta, twin.steps.delta)
    assert again.machine_position_mm.tobytes() == twin.machine_position_mm.tobytes()
    assert again.lost_steps.tobytes() == twin.lost_steps.tobytes()


# ---- refusals --------------------------------------------------------------------------------------------------------

REFUSED = {
    "": "an empty line",
    "jump 1 2 3": "'jump': unknown",
    "row 1000000 1 2": "2 counters; allowed: 3",
    "row 1000000 1 2 3 4": "4 counters; allowed: 3",
    "row 999 0 0 0": "'999'; allowed: a whole number from 1000 to 60000000000 ns",
    "row 1000000 1.5 0 0": "'1.5'; allowed: a whole number",
    "row 1000000 0x10 0 0": "'0x10'; allowed: a whole number",
    "row 1000000 1_0 0 0": "'1_0'; allowed: a whole number",
    "row 1000000 5004 0 0": "row: 5001 steps in 1000000 ns",
    "row 1000000 1 0 0 stages=on": "'on'; allowed: a whole number",
    "row 1000000 1 0 0 laser=1": "'laser=1'; allowed: NAME=VALUE",
    "row 1000000 1 0 0 stages=0 stages=1": "stages: stands twice",
    "row": "row: needs NS and the counters",
    "row 1000000": "row: needs NS and the counters",
    "row 1000000 stages=1": "row: needs NS and the counters",
    "go 0 1 2 3": "'0'; allowed: a whole number from 1",
    "go 1 1000 0 0": "go: takes 997000000000 ns",
    "out": "out: needs NAME=VALUE",
    "out stages": "'stages'; allowed: NAME=VALUE",
    "set 1 2": "2 counters; allowed: 3",
    "form both": "'both'; allowed: steps or led",
    "tell all": "'all'; allowed: encoder or index",
    "state now": "state: takes nothing",
    "row " + "9" * 1100: "a line of more than 1024 bytes",
    "\x00\xff": "'??': unknown",
    "\x7f~": "'?~': unknown",
}


@pytest.mark.parametrize("line", REFUSED, ids=lambda line: line[:20] or "empty")
def test_a_refused_line_says_why_and_changes_nothing(line: str) -> None:
    twin = switched_on()
    twin.query(f"row {MS_NS} 3 0 0")
    before = seen(twin)
    answer = twin.query(line)
    assert answer.startswith(f"error {REFUSED[line]}"), answer
    assert "\n" not in answer
    assert seen(twin) == before
    assert twin.query("state").startswith("ok ")


def test_a_line_without_end_is_dropped_up_to_its_end() -> None:
    twin = switched_on()
    for _ in range(3):
        twin.write(b"x" * 2000)
    twin.write(b"x\nstate\n")
    assert [line.split()[0] for line in twin.read().decode().splitlines()] == ["error", "ok"]


@pytest.mark.parametrize(
    ("settings", "words"), [({"axes": 9}, "1 to 8"), ({"set_points": "x"}, "steps, led"), ({"watchdog_ms": -1}, "0 to")]
)
def test_a_wrong_setting_is_named(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=rf"^external: {next(iter(settings))} is .*allowed: .*{words}"):
        create_controller("external", settings=settings)


def test_as_many_axes_as_the_other_control_has() -> None:
    twin = switched_on(overrides={"controller.axes": 5, "controller.set_points": "led"})
    twin.query(f"row {MS_NS} 1 2 3 4 5")
    assert twin.counts.tolist() == [1, 2, 3, 4, 5]
    assert len(twin.steps) == 1


def test_one_axis_is_enough() -> None:
    twin = switched_on(overrides={"controller.axes": 1})
    assert twin.query(f"row {MS_NS} 1").startswith("ok ")
    assert twin.counts[0] == 1


def test_counters_go_with_a_row_and_a_motion_ends_a_while_behind_the_last_one() -> None:
    """A tenth of a second without a step."""
    twin = switched_on()
    twin.write(f"row {1000 * MS_NS} 1000 0 0\n".encode())
    twin.run(0.5)
    assert twin.counts.tolist() == [500, 0, 0]
    control = External()
    control.power_on(0, {})
    control.receive(0, f"row {MS_NS} 8 0 0\n".encode())
    assert control.next_ns == MS_NS
    control.advance(MS_NS)
    assert control.next_ns == 101 * MS_NS
    control.advance(101 * MS_NS)
    assert (control.run, control.next_ns, control.counts) == (None, None, (8, 0, 0))


# ---- what comes back -------------------------------------------------------------------------------------------------


def test_an_end_switch_is_seen_in_the_row_in_which_it_is_struck() -> None:
    """Trip point 0, opener: low when struck. 10 mm/s towards it from 0.1 mm."""
    twin = switched_on(start_mm=(0.1, 100.0, 50.0), overrides={"imperfections": "ideal"})
    assert bits(twin, twin.query("state"))["limit_x1"] == 1
    struck = []
    for row in range(1, 16):
        struck.append(bits(twin, twin.query(f"row {MS_NS} {-3 * row} 0 0"))["limit_x1"])
    steps = 0.1 / twin.step_mm[0]
    assert struck.index(0) == int(steps // 3)


@pytest.mark.parametrize(("element", "state"), [("hood", "open"), ("estop", "pressed")])
def test_hood_and_emergency_stop_in_motion_drop_the_relay(element: str, state: str) -> None:
    """The control goes on commanding, and the carriage does not follow; `power_request` closes the relay again."""
    twin = switched_on("mujoco")
    position = 0
    for _ in range(50):
        position += 10
        answer = twin.query(f"row {MS_NS} {position} 0 0")
    assert bits(twin, answer)["power_ok"] == 1
    twin.set_input(element, state)
    for _ in range(50):
        position += 10
        answer = twin.query(f"row {MS_NS} {position} 0 0")
    assert bits(twin, answer)["power_ok"] == 0
    assert abs(float(twin.lost_steps[0])) > 200
    assert int(twin.unpowered_steps[0]) == 500
    twin.set_input(element, "closed" if element == "hood" else "released")
    assert bits(twin, twin.query("out power_request=0"))["power_ok"] == 0
    assert bits(twin, twin.query("out power_request=1"))["power_ok"] == 1


def test_encoder_and_index_stand_at_the_end_of_an_answer() -> None:
    """4030-servo, at rest: the encoder is the counter; from one zero pulse to the next is one revolution."""
    twin = switched_on("mujoco", machine="4030-servo")
    twin.query("tell encoder index")
    twin.query("go 20000 7000 0 0")
    twin.run(0.3)
    answer = twin.query("state").split()
    encoder, index = [int(word) for word in answer[4:7]], [int(word) for word in answer[7:10]]
    assert encoder == pytest.approx([7000, 0, 0], abs=2)
    turn = round(twin.machine.axes[0].steps_per_rev)
    machine = round(START_MM[0] / twin.step_mm[0])  # plant/18: pulses stand where the screw has made whole turns
    assert (encoder[0] + machine - index[0] + turn // 2) % turn == pytest.approx(turn // 2, abs=1)
    assert all(0 <= one < turn for one in index)
    assert len(twin.query("tell").split()) == 4


def test_a_drive_fault_is_a_bit() -> None:
    """A servo drive whose shaft is held faults by its following error; bit 0 is X. `drive_reset` clears it."""
    twin = switched_on("mujoco", machine="4030-servo", start_mm=(0.0, 100.0, 50.0))
    twin.query("form led")
    answer = ""
    for row in range(1, 400):
        answer = twin.query(f"row {MS_NS} {-60 * row} 0 0")
        if answer.split()[3] != "0":
            break
    assert answer.split()[3] == "1"
    assert twin.drive_faults[0][0]


# ---- the watchdog ----------------------------------------------------------------------------------------------------


def test_silence_switches_off_and_the_next_line_is_told() -> None:
    twin = switched_on()
    twin.query(f"row {MS_NS} 5 0 0")
    twin.run(0.999)
    assert (twin.outputs["stages"], twin.fault) == (1, False)
    twin.run(0.0011)
    assert [twin.outputs[name] for name in ("stages", "brake", "power_request")] == [0, 0, 0]
    assert twin.fault
    assert "nothing was sent for 1000 ms" in twin.remarks[-1][1]
    answer = twin.query(f"row {MS_NS} 9 0 0")
    assert answer.startswith("error the watchdog has switched the outputs off")
    assert (twin.counts.tolist(), twin.fault) == ([5, 0, 0], True)
    assert "nothing was sent for 1000 ms" in twin.fault_cause
    assert twin.query(ON).startswith("ok ")
    assert not twin.fault


def test_the_watchdog_waits_for_the_end_of_a_row_and_can_be_left_out() -> None:
    twin = switched_on()
    assert twin.query(f"row {5000 * MS_NS} 5 0 0").startswith("ok ")
    never = switched_on(overrides={"controller.watchdog_ms": 0})
    never.run(100.0)
    assert never.outputs["stages"] == 1


# ---- the twin's side -------------------------------------------------------------------------------------------------


def test_a_handed_in_control_says_that_it_has_something_new() -> None:
    """`Twin.settle`: without it nobody knows what was told to the controller by a call of its own."""
    control = External()
    twin = Twin(controller=control, plant="kinematic", start_mm=START_MM)
    twin.run(0.5)
    control.receive(twin.time_ns, f"{ON}\nrow {MS_NS} 8 0 0\n".encode())
    twin.settle()
    twin.run_until(twin.time_ns + ON_NS + MS_NS)
    assert twin.counts.tolist() == [8, 0, 0]
    assert twin.outputs["stages"] == 1
    assert int(twin.steps.t_ns[0]) == 500_062_500 + ON_NS


def test_set_points_in_the_past_raise() -> None:
    control = External()
    twin = Twin(controller=control, plant="kinematic", start_mm=START_MM)
    twin.run(0.5)
    control._rest_ns = 10**12
    control.run = Listed(np.array([400_000_000, 600_000_000]), np.ones((2, 3), np.int8), 400_000_000)
    with pytest.raises(ValueError, match="lays 1 of its ticks in the past, before 500000000 ns"):
        twin.settle()


def test_it_is_saved_and_restored_in_the_middle_of_a_row() -> None:
    twin = switched_on("mujoco")
    rows = "".join(f"row {MS_NS} {6 * row} 0 0\n" for row in range(1, 60)).encode()
    twin.write(rows + b"out stages=0\n")
    twin.run(0.0105)
    state = pickle.loads(pickle.dumps(twin.save()))
    other = twin.another(seed=0)
    other.restore(state)
    for one in (twin, other):
        one.run(0.1)
    assert twin.read() == other.read()
    assert twin.machine_position_mm.tobytes() == other.machine_position_mm.tobytes()
    assert twin.counts.tolist() == other.counts.tolist() == [354, 0, 0]


def test_a_reset_begins_anew() -> None:
    twin = switched_on()
    twin.query(f"row {MS_NS} 9 0 0")
    from isel_twin.base.parameters import Place
    from isel_twin.wiring import event_now

    twin.carry_out(event_now({"reset": True}, Place("test"), twin.settable, twin.keys))
    assert (twin.counts.tolist(), twin.outputs["stages"]) == ([0, 0, 0], 0)
    assert twin.query(ON).startswith("ok ")


def explained(lines: Sequence[bytes], sent: bool) -> list[str]:
    language = create_language("external")
    assert language is not None
    return [message.explanation for line in lines for message in language.messages(line, sent)]


def test_a_switch_at_the_far_end_is_seen() -> None:
    twin = switched_on(start_mm=(394.9, 100.0, 50.0))
    struck = [bits(twin, twin.query(f"row {100 * MS_NS} {by} 0 0")) for by in (0, 64)]
    assert [(one["limit_x2"], one["limit_x1"]) for one in struck] == [(1, 1), (0, 1)]


def test_what_its_language_says_is_taken() -> None:
    """Each line has an answer: one too few, or one error among them, and it is not accepted."""
    language = create_language("external")
    assert language is not None
    twin = Twin(controller="external", plant="kinematic", start_mm=START_MM)
    sent = b"".join([*language.reference(), *language.move((800, 0, 0), MoveSettings(speed_hz=4000))])
    twin.write(sent)
    twin.run_until_idle()
    reply = twin.read()
    assert twin.counts.tolist() == [800, 0, 0]
    assert language.accepted(sent, reply)
    assert not language.accepted(sent, reply.partition(b"\n")[2])
    assert not language.accepted(sent, reply.replace(b"ok", b"error", 1))
    assert not language.accepted(sent + b"state\n", reply)


def test_the_log_has_words_for_it() -> None:
    assert explained([b"row 1000000 1 2 3 stages=1\n", b"hello\n"], True) == [
        "to 1 2 3 in 1 ms; outputs: stages 1",
        "refused: 'hello': unknown; allowed: row, go, out, set, form, tell, state, names",
    ]
    answers = [b"ok 1500000 1cbff 0\n", b"error no\n", b"ok x y z\n", b"\n", b"names axes=3 a b\n"]
    assert explained(answers, False) == [
        "done at 0.0015 s; levels 1cbff, drive faults 0",
        "refused: no",
        "no answer of the twin",
        "no answer of the twin",
        "terminals, from bit 0: a b",
    ]
