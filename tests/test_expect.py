"""Jobs that expect: what can be written, what is refused and where, and what it is worth to the verdict."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.jobs.expect import Expected, ExpectError, excerpt, parse_condition, parse_expected
from isel_twin.jobs.job import JobError, Line, check_conditions, parse_job
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import play
from isel_twin.jobs.verdict import Verdict, judge
from isel_twin.language import create_language
from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=4)

FAR = "@07\n@0R7\n@0M160000,8000,8000,8000,0,30,0,30"
"""Ends at the switch at the far end of X."""


def parsed(text: str) -> list[Line]:
    return parse_job(text, create_language("imc-s8"), "imc-s8")


def played(
    text: str, plant: str = "kinematic", timeout_s: float = 3600.0, **options: Any
) -> tuple[list[Result], Verdict]:
    twin = Twin(plant=plant, **options)
    lines = parse_job(text, twin.language, "imc-s8")
    check_conditions(lines, twin)
    results = list(play(twin, lines, timeout_s))
    return results, judge(twin, results, len(lines) - len(results))


# ---- replies ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reply", "fits"),
    [
        ("2", b"2", True), ("2", b"0", False), ("2", b"", False), ("2", b"22", False), ("2", b"2\r", True),
        ("*", b"", True), ("*", b"\xff\r\n", True), ("none", b"", True), ("none", b"0", False), ("none", b"\r", False),
        ("0*", b"0003E8", True), ("0*", b"1", False), ("*E8", b"0003E8\r", True), ("*isel*", b"iMC-S8 isel V1", True),
        ("a*b*c", b"a1b2c", True), ("a*b*c", b"ac", False), ("ab*ba", b"aba", False), ("*b*b*", b"b", False),
        ("<48>", b"0", True), ("<13><2><13>", b"\r\x02\r", True), ("<13><2>", b"\r\x02\r", True), ("<42>", b"*", True),
        ("<42>", b"x", False), ("a b", b"a b", True), ("none.", b"none.", True), ("\xe4", b"\xe4", True),
        (".", b"x", False), ("0\t", b"0", True),
    ],
)  # fmt: skip
def test_replies(text: str, reply: bytes, fits: bool) -> None:
    assert (parse_expected(f" {text} ").why_not(reply, complete=True, took_ns=0) == "") is fits


def test_stars_are_found_in_a_line_of_the_reply() -> None:
    """No regular expression: this would take one for ever."""
    assert parse_expected("*a" * 40 + "b").why_not(b"a" * 5000, complete=True, took_ns=0)


@pytest.mark.parametrize(
    ("text", "ns"), [("5 s", 5 * 10**9), ("200ms", 2 * 10**8), (".5  s", 5 * 10**8), ("2 min", 12 * 10**10)]
)
def test_times(text: str, ns: int) -> None:
    expected = parse_expected(f"0 within {text} ")
    assert expected == Expected(f"0 within {text}", (b"0",), ns)
    assert expected.why_not(b"0", complete=True, took_ns=ns) == ""
    assert "over after" in expected.why_not(b"0", complete=True, took_ns=ns + 10**6)
    assert expected.wait_ns is None
    assert parse_expected(f"none within {text}").wait_ns == ns


@given(st.binary(max_size=20), st.integers(0, 20), st.integers(0, 20))
def test_any_reply_can_be_written_in_numbers(reply: bytes, a: int, b: int) -> None:
    whole = "".join(f"<{byte}>" for byte in reply)
    if reply:
        assert parse_expected(whole).why_not(reply, complete=True, took_ns=0) == ""
        assert parse_expected(whole + "x").why_not(reply, complete=True, took_ns=0) != ""
    a, b = sorted((min(a, len(reply)), min(b, len(reply))))
    cut = "".join(f"<{byte}>" for byte in reply[:a]) + "*" + "".join(f"<{byte}>" for byte in reply[b:])
    assert parse_expected(cut).why_not(reply, complete=True, took_ns=0) == ""


# ---- lines -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "sent", "expected"),
    [
        ("@07 => 0", b"@07\r", "0"),
        ("@07 =>\t0  # => 1", b"@07\r", "0"),
        ("@07=> 0", b"@07\r", "0"),
        ("<253> => none", b"\xfd", "none"),
        ("<253>=> none", b"\xfd", "none"),
        ("@07 # what is => 0", b"@07\r", None),
        ("@07 =>0", b"@07 =>0\r", None),
        ("a=>b", b"a=>b\r", None),
        ("<61>> 1", b"=> 1\r", None),
        ("!x == 1", b"!x == 1\r", None),
        ("<33> x", b"!x\r", None),  # blanks around <...> count for nothing
    ],
)
def test_what_a_line_sends_and_expects(text: str, sent: bytes, expected: str | None) -> None:
    (line,) = parsed(text)
    assert line.sent == sent
    assert (line.expected.text if line.expected else None) == expected
    assert line.condition is None


def test_a_condition_sends_nothing() -> None:
    line = parsed("@07\n  ! lost == 0 # none")[1]
    assert (line.number, line.command, line.actions, line.sent) == (2, "! lost == 0", (), b"")
    assert line.condition is not None


@pytest.mark.parametrize(
    ("line", "column", "said"),
    [
        ("@07 =>", 7, "say what is expected"),
        ("@07 => # 0", 7, "say what is expected"),
        ("=> 0", 1, "a reply is expected of a command, which is missing"),
        ("! x < 1 mm => 0", 12, "a reply is expected of a command"),
        ("@07 => within 5 s", 8, "say what is expected"),
        ("@07 => 0 within", 16, "within needs a time"),
        ("@07 => 0 within 5", 17, "within needs a time"),
        ("@07 => 0 within 5 h", 17, "within needs a time"),
        ("@07 => 0 within -5 s", 17, "within needs a time"),
        ("@07 => 0 within 5 s or so", 17, "within needs a time"),
        ("@07 => 0 within 9999999999 s", 17, "a time of more than 1000000000 s"),
        ("@07 => <256>", 8, "<256> is no byte"),
        ("@07 => 0<0.5s>", 9, "<0.5s> is no byte"),
        ("@07 => 0€", 9, "'€'"),
        ("!", 2, "say what must be so"),
        ("! ", 2, "say what must be so"),
        ("! == 0", 3, "say what must be so"),
        ("! lost", 7, "lost must be followed by one of =="),
        ("! lost = 0", 8, "lost must be followed by one of =="),
        ("! lost ==", 10, "a number or a word must follow"),
        ("! lost == few", 11, "lost is a number"),
        ("! lost == 0 mm", 13, "unit mm does not fit; allowed: steps"),
        ("! lost.q == 0", 3, "unknown name lost.q; there is lost.x, y, z"),
        ("! x.y == 0", 3, "unknown name x.y; there is x alone"),
        ("! hood.x == 0", 3, "unknown name hood.x; with a dot there are"),
        ("! count == 0", 3, "count needs an axis: count.x"),
        ("! output == 0", 3, "output needs a name behind it"),
        ("! x == 50 mm", 5, "x is measured"),
        ("! x != 50", 5, "x is measured"),
        ("! x == 50 +- mm", 14, "a tolerance must follow"),
        ("! x == 50 +- -1 mm", 14, "a tolerance must follow"),
        ("! x < 50 +- 1 mm", 10, "a tolerance goes with == only"),
        ("! x == 50 +- 0.03 mm or so", 22, "this cannot follow"),
        ("! x == 1e999 +- 1", 8, "the number is too large"),
        ("! hood < open", 8, "a state is == or !="),
        ("! hood == open now", 16, "nothing may follow a state"),
        ("! margin > 30 W", 15, "unit W does not fit; allowed: %"),
        ("! spindle == 1 V", 16, "unit V does not fit; allowed: none"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood_is_told_with_its_place(line: str, column: int, said: str) -> None:
    with pytest.raises(JobError) as caught:
        parsed(f"@07\n{line}\n")
    assert str(caught.value).startswith(f"line 2, column {column}: ")
    assert said in str(caught.value)
    shown, caret = caught.value.excerpt.split("\n")
    assert shown == line
    assert caret == " " * (column - 1) + "^"


def test_a_condition_before_the_first_command_is_refused() -> None:
    with pytest.raises(JobError, match="line 2, column 1: a condition stands after a command"):
        parsed("# nothing\n! lost == 0\n@07")


@pytest.mark.parametrize(
    ("line", "column", "said"),
    [
        ("! hod == open", 3, "unknown input hod; there are hood, estop"),
        ("! hood == opened", 11, "hood can be closed, forced, open"),
        ("! limit_x1 == hit", 15, "limit_x1 can be bounce, broken, free, ok, struck"),
        ("! spindl == 1", 3, "unknown name spindl; there are lost"),
        ("! level.p9.9 == 1", 3, "unknown level p9.9; there are"),
        ("! count.v == 1", 3, "count.v: the controller has the axes x, y, z, a"),
    ],
)
def test_names_that_the_machine_does_not_know(line: str, column: int, said: str) -> None:
    twin = Twin(plant="kinematic")
    with pytest.raises(JobError) as caught:
        check_conditions(parsed(f"@07\n{line}"), twin)
    assert str(caught.value).startswith(f"line 2, column {column}: ")
    assert said in str(caught.value)


def test_a_long_line_is_shown_around_the_mistake() -> None:
    shown, caret = excerpt("a" * 300 + "\tX\x07" + "b" * 300, 301).split("\n")
    assert len(shown) == 100
    assert shown[caret.index("^")] == "X"
    assert shown[caret.index("^") - 1 : caret.index("^") + 2] == " X?"


@given(st.text())
def test_any_text_is_expected_or_refused_within_itself(text: str) -> None:
    for parse in (parse_expected, parse_condition):
        try:
            parse(text)
        except ExpectError as error:
            place = error.at
        else:
            continue
        assert 0 <= place <= len(text)


@given(
    st.sampled_from(["x", "y", "z", "error.x"]),
    st.floats(-1e6, 1e6),
    st.floats(0, 1e3),
    st.sampled_from([("", 1.0), (" mm", 1.0), ("um", 1e-3), (" µm ", 1e-3)]),
    st.sampled_from(["+-", " +/- ", " ±"]),
)
def test_a_written_condition_is_what_it_says(
    name: str, value: float, tolerance: float, unit: tuple[str, float], sign: str
) -> None:
    condition = parse_condition(f"{name}=={value!r}{sign}{tolerance!r}{unit[0]}")
    assert (condition.name, condition.comparison) == (name, "==")
    assert condition.value == value * unit[1]
    assert condition.tolerance == tolerance * unit[1]


@pytest.mark.parametrize(
    ("text", "value", "tolerance"),
    [
        ("x == 50 mm +- 30 um", 50.0, 0.03),
        ("x == 50 +- 30 um", 0.05, 0.03),
        ("x == 50 mm +- 0.03", 50.0, 0.03),
        ("time < 200 ms", 0.2, 0.0),
        ("margin >= 30%", 0.3, 0.0),
        ("clock<2min", 120.0, 0.0),
        ("count.x == -16000", -16000.0, 0.0),
    ],
)  # fmt: skip
def test_units(text: str, value: float, tolerance: float) -> None:
    condition = parse_condition(text)
    assert (condition.value, condition.tolerance) == pytest.approx((value, tolerance))


# ---- what it is worth ------------------------------------------------------------------------------------------------


def test_a_job_that_must_stop_at_a_switch_is_green() -> None:
    _, verdict = played(f"{FAR}\n")
    assert (verdict.ok, verdict.refused, verdict.expectations) == (False, 1, 0)
    results, verdict = played(f"{FAR} => 2\n! limit_x2 == struck\n! limit_x1 == free\n! x > 390 mm\n! count.y == 0\n")
    assert (verdict.ok, verdict.refused, verdict.expectations, verdict.commands) == (False, 0, 5, 3)
    assert verdict.unmet == (7,)
    assert (results[-1].why, results[-1].condition) == (f"is {results[-1].counts[1]} steps", True)
    _, verdict = played(f"{FAR} => 2\n! limit_x2 == struck\n! fault == 1\n! lost == 0\n! steps > 1000\n")
    assert verdict.ok


def test_an_answer_that_is_not_the_expected_one_is_not_well_though_accepted() -> None:
    results, verdict = played("@07 => 1\n@0R7 => none\n@0P => 0*\n")
    assert [r.ok for r in results] == [False, False, True]
    assert [r.why for r in results] == ["answered 0", "answered 0", ""]
    assert results[0].shown_reply == "0 (not 1: answered 0)"
    assert (verdict.refused, verdict.unmet) == (0, (1, 2))


def test_a_stop_by_a_byte_is_green() -> None:
    move = "@0A8000,5000,0,30,0,30,0,30<13> <0.6s> <253>"
    _, verdict = played(f"@07\n@0R7\n{move} => F within 1 s\n! x < 20 mm\n! x > 1 mm\n@0S => 0\n! x == 25 +- 0.01 mm\n")
    assert verdict.ok


def test_too_late_is_not_met_and_the_job_goes_on() -> None:
    results, verdict = played("@07\n@0R7 => 0 within 1 s\n! time > 1 s\n@0P => *\n")
    assert [r.ok for r in results] == [True, False, True, True]
    assert results[1].why.startswith("over after ")
    assert verdict.unsent == 0


def test_silence_for_a_time_lets_the_motion_go_on() -> None:
    text = "@07\n@0R7\n@0A8000,1000,0,30,0,30,0,30 => none within 500 ms\n! time == 500 +- 0.001 ms\n"
    results, verdict = played(f"{text}<253> => F\n@0S => 0\n")
    assert verdict.ok
    assert results[2].end_ns - results[2].time_ns == 500_000_000
    assert [r.ok for r in played("@07 => none within 1 s\n@0P\n")[0]] == [False, True]


def test_what_never_comes_ends_the_job() -> None:
    """The controller waits for the start key, which nobody presses."""
    waits = "@07\n@0R7\n@0A160000,30,0,30,0,30,0,30 => 0\n! lost == 0\n@0P\n"
    results, verdict = played(waits, timeout_s=100.0)
    assert [r.number for r in results] == [1, 2, 3]
    assert results[-1].why == "not answered, not over after 100 s"
    assert (verdict.ok, verdict.unmet, verdict.unsent) == (False, (3,), 2)


def test_an_opened_hood_is_green_when_its_losses_are_expected(tmp_path: Path) -> None:
    """In automatic the hood cuts the power of the stages, and the motors run on without it: steps are lost, by whole
    slips of 32 (1600 steps a revolution)."""
    (tmp_path / "hood.toml").write_text(
        '[[event]]\nat = 36.5\nset = { hood = "forced" }\n[[event]]\nat = 38.5\nset = { hood = "closed" }\n'
    )
    begin = "@07\n@0R7\n@0M64000,8000,8000,8000,0,30,0,30 => 9\n! hood == open\n! power == 0\n"
    end = "<3s>\n! hood == closed\n@07\n@0R7\n"
    lost = "! lost < 200\n! lost > 0\n! lost.z == 0\n"
    _, without = played(begin + end, "mujoco", scenario=tmp_path / "hood.toml")
    assert (without.ok, without.unmet) == (False, ())
    assert any(without.lost)
    _, expected = played(begin + end + lost, "mujoco", scenario=tmp_path / "hood.toml")
    assert expected.unmet == ()
    assert expected.forgotten_steps == without.forgotten_steps
    assert (expected.ok, any(expected.lost)) == (True, False)
    _, too_early = played(
        "@07\n@0R7\n! lost == 0\n" + (begin + end).removeprefix("@07\n@0R7\n"),
        "mujoco",
        scenario=tmp_path / "hood.toml",
    )
    assert not too_early.ok


def test_what_is_lost_after_the_condition_counts() -> None:
    base = played("@07\n@0R7\n")[1]

    def lost(steps: float, forgotten: float, known: float) -> bool:
        changed = dataclasses.replace(
            base,
            lost_steps=(steps, 0, 0, 0),
            forgotten_steps=(forgotten, 0, 0, 0),
            slip_steps=(32,) * 4,
            lost_known=(known, 0, 0, 0),
        )
        assert changed.lost[1:] == (False, False, False)
        assert changed.ok is not changed.lost[0]
        return changed.lost[0]

    assert [lost(0.2, 64, 64), lost(32.4, 32, 64), lost(0, 64, 32), lost(32, 64, 64), lost(0, 64, 0)] == [
        False, False, True, True, True,
    ]  # fmt: skip
    assert lost(float("nan"), 64, 64)


def test_a_fault_of_the_controller_can_be_expected() -> None:
    twin = Twin(controller="ismif", plant="kinematic")
    lines = parse_job("xyz => *\n! fault == 1\n", twin.language, "ismif")
    results = list(play(twin, lines, 10.0))
    verdict = judge(twin, results)
    assert verdict.controller_fault
    assert verdict.ok
    assert not judge(twin, results[:1]).ok


def test_margins_are_those_of_the_last_command() -> None:
    text = "@07\n@0R7\n@0M16000,8000,0,30,0,30,0,30\n! margin < 95 %\n! margin.x > 10 %\n! error.x == 0 +- 50 um\n"
    _, verdict = played(text, "mujoco")
    assert verdict.ok
    results, verdict = played(text)  # without physics there is none
    assert [r.reply for r in results[3:5]] == ["has no value here"] * 2
    assert verdict.unmet == (4, 5)


def test_conditions_look_at_every_kind_of_name() -> None:
    met = ["output.stages == 1", "input.power == on", "level.p1.0 == 1", "clock < 1 s", "x > -1 mm", "hood != open"]
    met += ["estop_1 == ok", "limit_x1 != struck", "limit_x1 == ok", "limit_x1 == free", "spindle != broken"]
    unmet = ["output.nothing == 0", "stages != 1", "x < -1e9", "level.p1.0 == 0", "hood == open"]
    results, verdict = played("\n! ".join(["@07", *met, *unmet]))
    assert [r.command for r in results if not r.ok] == [f"! {text}" for text in unmet]
    assert verdict.unmet == tuple(range(len(met) + 2, len(met) + len(unmet) + 2))


def test_the_example_of_the_page_is_green() -> None:
    page = (Path(__file__).parents[1] / "docs" / "hosts.md").read_text()
    block = page.partition("### What a job expects")[2].partition("    @0A")[2].partition("\n\n")[0]
    job = "@07\n@0R7\n@0A" + block.replace("\n    ", "\n")
    assert job.count("=>") == 3
    for plant in "kinematic", "mujoco":
        results, verdict = played(job, plant)
        assert verdict.ok, [(r.number, r.why) for r in results]


def test_faults_of_contacts_are_states_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "faults.toml").write_text(
        '[[event]]\nat = 0.0\nset = { limit_x2 = "broken", estop_2 = "stuck_closed" }\n'
    )
    conditions = ["limit_x2 == broken", "limit_x2 != ok", "estop_2 == stuck_closed", "estop_1 == ok"]
    text = "\n! ".join(["@07 => *", *conditions, "limit_x2 != struck"])
    assert played(text, scenario=tmp_path / "faults.toml")[1].unmet == ()


# ---- the command -----------------------------------------------------------------------------------------------------


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """call(job, words...) -> exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(job: str, *words: str, plant: str = "kinematic") -> tuple[int, str, str]:
        (tmp_path / "job.txt").write_text(job)
        with pytest.raises(SystemExit) as caught:
            main(["run", "job.txt", "--plant", plant, *words])
        assert isinstance(caught.value.code, int)
        return caught.value.code, *capsys.readouterr()

    return run


def test_the_exit_code_is_that_of_the_expectations(call: Any) -> None:
    assert call(f"{FAR} => 2\n! lost == 0\n")[0] == 0
    code, out, _ = call(f"{FAR} => 0\n! lost == 0\n")
    assert code == 1
    assert "2 (not 0: answered 2)" in out
    assert "3 commands, 2 expectations, 1 of 2 expectations not met: line 3" in out


def test_json_names_what_was_expected(call: Any) -> None:
    _, out, _ = call("@07\n@0R7 => 0 within 1 s\n! x == 9 +- 1 mm\n", "--json")
    first, second, third, summary = map(json.loads, out.splitlines())
    assert not first.keys() & {"expected", "why", "condition"}
    assert (second["expected"], second["ok"], second["condition"]) == ("0 within 1 s", False, False)
    assert second["why"].startswith("over after")
    assert (third["command"], third["expected"], third["ok"], third["reply"], third["condition"]) == (
        "! x == 9 +- 1 mm", "x == 9 +- 1 mm", False, "0 mm", True,
    )  # fmt: skip
    assert (summary["expectations"], summary["unmet"], summary["ok"]) == (2, [2, 3], False)


@pytest.mark.parametrize("job", ["@07\n@0R7 => 0 within 5\n", "@07\n! hod == 1\n"])
def test_a_mistake_is_shown_with_a_caret(call: Any, job: str) -> None:
    code, out, err = call(job)
    assert (code, out) == (2, "")
    said, shown, caret = err.splitlines()
    assert said.startswith("isel-twin: job.txt: line 2, column ")
    column = int(said.split("column ")[1].split(":")[0])
    assert shown == "    " + job.splitlines()[1]
    assert caret == " " * (3 + column) + "^"


def test_a_job_from_standard_input_may_expect() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "isel_twin", "run", "-", "--plant", "kinematic"],
        input="@07 => 0\n! hood == closed\n! lost == 0", capture_output=True, text=True, check=False,
        timeout=PATIENCE_S,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 expectations" in done.stdout


def test_a_report_and_traces_of_a_job_that_expects(call: Any, tmp_path: Path) -> None:
    code, _, err = call("@07 => 1\n! lost == 0\n", "--report", "r.html", "--vcd", "v.vcd", "--interval", "0.1")
    assert (code, err) == (1, "")
    assert "0 (not 1: answered 0)" in (tmp_path / "r.html").read_text()


def test_repetitions_expect_the_same(call: Any) -> None:
    code, out, _ = call(f"{FAR} => 2\n! lost == 0\n! x > 390 mm\n", "--robust", "2", plant="mujoco")
    assert code == 0, out
    assert "robust: 0 of 2 machines" in out
    code, out, _ = call("@07\n@0R7\n! clock == 33.757 +- 0.01 s\n", "--robust", "2", "--workers", "2", plant="mujoco")
    assert code == 1  # it stands elsewhere at power-on, so a reference run takes another time
    assert "fragile: 2 of 2 machines" in out


def test_a_golden_run_has_commands_and_the_verdict(
    call: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "job.txt").write_text(f"{FAR} => 2\n! x > 390 mm\n! lost == 0\n")
    for words, code in ((["record"], 0), (["compare"], 0)):
        with pytest.raises(SystemExit) as caught:
            main(["golden", *words, "job.txt", *(["--plant", "kinematic"] if words == ["record"] else [])])
        assert caught.value.code == code, capsys.readouterr()
    written = (tmp_path / "job.golden").read_text()
    assert "390" not in written
    assert "ok = true" in written
    (tmp_path / "job.txt").write_text(f"{FAR} => 2\n! y\n")
    with pytest.raises(SystemExit) as caught:
        main(["golden", "compare", "job.txt"])
    assert caught.value.code == 2
    assert "line 4, column 4: y must be followed by one of" in capsys.readouterr().err


def test_binary_replies_are_expected_as_their_language_reads_them() -> None:
    twin = Twin(controller="gmi99", machine="4030-servo", plant="kinematic")
    text = "T1;0 => V488\n#1 => #40\n#1 => <16><224><64><32><22>\nT0;0 => @*\n#1 => #00\n"
    results = list(play(twin, parse_job(text, twin.language, "gmi99"), 10.0))
    assert [result.ok for result in results] == [True, True, True, True, False]
    assert results[-1].why == "answered #40"
