"""What can be set in a job, and what the job reads like with other settings."""

from __future__ import annotations

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.language import MoveSettings
from isel_twin.many.tuning import Problem

from .small import SAFE, TEXT, problem


def test_the_whole_job_has_three_parameters_within_what_the_controller_takes() -> None:
    """Speeds also within what a motor does without swinging itself out of step: 855 rev/min, of 1600 steps each."""
    found = {each.name: (each.low, each.high) for each in problem().parameters}
    assert found == {
        "speed_hz": (4500, pytest.approx(22_800, abs=300)),  # half of what the job has; the iMC takes 40000 Hz (imc/7)
        "acceleration_hz_per_ms": (50, 4000),  # 2.2.16: 1 .. 4000, default 100
        "start_stop_hz": (150, 4000),  # 2.2.15: 20 .. 4000, default 300
    }
    assert problem().nearest() == {"speed_hz": 9000, "acceleration_hz_per_ms": 100, "start_stop_hz": 300}


def test_each_move_has_its_own_and_a_feed_has_no_speed() -> None:
    names = [each.name for each in problem(each_move=True).parameters]
    ramps = ["acceleration_hz_per_ms", "start_stop_hz"]
    assert names == [
        "speed_hz.5", *(f"{name}.5" for name in ramps), *(f"{name}.6" for name in ramps),
        "speed_hz.8", *(f"{name}.8" for name in ramps),
    ]  # fmt: skip


def test_equal_lines_share_their_settings() -> None:
    text = "@07\n@0A100,9000,0,30,0,30,0,30\n@0A-100,9000,0,30,0,30,0,30\n@0A100,9000,0,30,0,30,0,30 # again\n"
    one, other = Problem(text, each_move=True).groups
    assert ([move.line for move in one.moves], [move.line for move in other.moves]) == ([1, 3], [2])


def test_a_tuned_job_keeps_comments_expectations_and_feeds() -> None:
    candidate = problem().candidate(SAFE)
    assert candidate.text == (
        "# a small job\n@07\n@0d5000,5000,5000\n@0R7   => 0 within 60 s\n"
        "@0j200\n@0J60\n@0M9600,6000,0,30,0,30,0,30    # a rapid way\n"
        "@0A320,1000,0,30,0,30,0,30\n! lost == 0\n@0M0,6000,0,30,0,30,0,30 => 0\n"
    )
    assert (candidate.first, candidate.moves) == (5, (7, 8, 10))
    assert [line.command for line in candidate.lines][3:5] == ["@0j200", "@0J60"]


def test_line_ends_stay() -> None:
    made = problem().candidate(SAFE).text
    assert Problem(TEXT.replace("\n", "\r\n")).candidate(SAFE).text == made.replace("\n", "\r\n")


def test_the_defaults_of_the_controller_keep_the_speeds_of_the_job() -> None:
    text = TEXT.replace("@0M9600", "@0J900\n@0M9600", 1)
    assert "@0J100\n@0j300\n@0M9600,9000," in Problem(text).defaults().text


def test_ranges_can_be_narrower_and_a_single_number() -> None:
    narrow = problem(ranges={"speed_hz": (9000, 12_000), "start_stop_hz": (400, 400)})
    assert [(each.name, each.low, each.high) for each in narrow.parameters] == [
        ("speed_hz", 9000, 12_000),
        ("acceleration_hz_per_ms", 50, 4000),
    ]
    settings = narrow.settings({"speed_hz": 10_000, "acceleration_hz_per_ms": 70})
    assert set(settings.values()) == {MoveSettings(10_000, 70, 400)}


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ({"text": "@07\n@0R7\n"}, "there is no move in the job that settings could be brought to"),
        ({"ranges": {"speed_hz": (20, 9000)}}, "speed_hz 20:9000: imc-s8 takes 30 to 40000"),
        ({"ranges": {"speed_hz": (9000, 5000)}}, "speed_hz 9000:5000: imc-s8 takes 30 to 40000"),
        ({"call": TwinSpec(plant="kinematic")}, "the kinematic plant loses no step whatever one sets; take mujoco"),
        (
            {"text": "81h 9", "call": TwinSpec("4030-servo", "gmi99"), "ranges": {"start_stop_hz": (90, 900)}},
            "start_stop_hz: gmi99 has none",
        ),
        (
            {"ranges": {"speed_hz": (9, 9), "acceleration_hz_per_ms": (9, 9), "start_stop_hz": (90, 90)}},
            "speed_hz 9:9: imc-s8 takes 30 to 40000",
        ),
        (
            {"ranges": {"speed_hz": (90, 90), "acceleration_hz_per_ms": (9, 9), "start_stop_hz": (90, 90)}},
            "nothing is left to be tried: every range is a single number",
        ),
    ],
)
def test_what_cannot_be_tuned_is_told_in_a_line(words: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]*$") as caught:
        Problem(**{"text": TEXT, **words})
    assert str(caught.value) == line


def test_a_study_knows_what_its_results_depend_on() -> None:
    one = problem().about()
    assert one == problem().about()
    for words, key in (
        ({"call": TwinSpec(seed=1)}, "seed"),
        ({"call": TwinSpec(machine="4030-portal")}, "machine"),
        ({"call": TwinSpec(overrides={"payload.mass": 8.0})}, "machine"),
        ({"call": TwinSpec(controller="imc-m")}, "controller"),
        ({"repetitions": 2}, "number of repetitions"),
        ({"each_move": True}, "choice of parameters"),
        ({"flash": b"x"}, "flash memory"),
    ):
        other = problem(**words).about()
        assert [name for name in one if one[name] != other[name]] == [key]


def test_speeds_beyond_that_of_the_swing_are_tried_as_far_as_an_edge_below_1_is_asked_for() -> None:
    """A swing grows from 855 rev/min on, 1600 steps each (docs/fidelity.md): an edge of 0.8 is 1.25 times that."""

    def highest(**words: object) -> int:
        return next(one.high for one in problem(**words).parameters if one.setting == "speed_hz")

    assert highest() == highest(edge=1.5) == pytest.approx(22_800, rel=0.015)
    assert highest(edge=0.8) == pytest.approx(1.25 * highest(), abs=1.0)
    assert highest(edge=0.8, ranges={"speed_hz": (5000, 22_000)}) == 22_000


CARD = "Q7;1\nM40000\nB100\nf30000\n83h 9000 0 # there\nf5000 | 84h 900\n"
PROGRAM = "; a part\nP1\nN10 G90 G53\nN20 G0 X60 {away}\nN30 G1 X70 F600\nN40 M30\n#\n"


@pytest.mark.parametrize(("text", "controller"), [(CARD, "gmi99"), (PROGRAM, "bwo900")])
def test_ramps_from_standstill_are_two_numbers(text: str, controller: str) -> None:
    """A servo drive that lags by speed / 40 1/s switches itself off from 4000 * 40 = 160 000 increments/s on; rapids of
    the BWO 900 end at P12004, 6000 mm/min as delivered."""
    servo = Problem(text, TwinSpec("4030-servo", controller))
    assert servo.fails_from_hz == Problem(text, servo.call, edge=0.8).fails_from_hz == 160_000
    assert {each.name: each.high for each in servo.parameters} == {
        "speed_hz": 160_000 if controller == "gmi99" else 100_000,
        "acceleration_hz_per_ms": 4000,
    }


def test_a_program_is_tuned_as_a_whole() -> None:
    """The time is that of the step which starts it, behind its transfer and the reference run."""
    servo = Problem(PROGRAM, TwinSpec("4030-servo", "bwo900"), each_move=True)
    made = servo.candidate({"speed_hz.3": 60_000, "acceleration_hz_per_ms.3": 500})
    assert made.text == PROGRAM.replace("N10", "N9 P8816:3600.000 P12008:200.000 P12208:200.000 P12408:200.000\nN10")
    assert [line.command for line in made.lines] == ["P1, 5 blocks", "reference", "start P1"]
    assert (made.first, made.moves) == (3, (3,))
    assert servo.as_it_stands().moves == (3,)
