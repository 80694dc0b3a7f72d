"""`pytest --isel-port`: the same tests at a controller of which only its port is known.
Here a served twin is behind it."""

from __future__ import annotations

import os
import tty
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
from pytest_plugin.projects import drawing_project, project, run, warm

from tests.bridge.conftest import Served

pytestmark = pytest.mark.long(seconds=4)

__all__ = ["drawing_project", "project", "warm"]
pytest_plugins = ["pytester"]

ASSERTS = "from isel_twin.jobs.checks.asserts import *\n"
SQUARE = """\
@07
@0R7 => 0
@0M1600,5000,800,5000,0,5000,0,30
! lost == 0
@0P => 0000640000320000000
! count.x == 1600
"""
TESTS = """
    import pytest
    from isel_twin.jobs.checks.asserts import *

    def test_square(watched):
        watched.play("square.txt")
        assert_accepted(watched)
        assert_replies(watched, ["0", "0", "0", "0000640000320000000"])
        assert_cycle_time(watched, most_s=100.0)
        assert_no_step_lost(watched)
        assert_ends_at(watched, (5.0, 2.5, 0.0))
        assert_outputs(watched, spindle=0)
"""


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    served = Served(("--plant", "kinematic", "--speed", "max"))
    yield served.info["pty"]
    served.end()


@pytest.fixture
def square(project: pytest.Pytester) -> pytest.Pytester:
    (project.path / "square.txt").write_text(SQUARE)
    project.makepyfile(TESTS)
    return project


def test_the_same_tests_pass_at_both_and_say_what_was_not_looked_at(square: pytest.Pytester, port: str) -> None:
    run(square).assert_outcomes(passed=1)
    result = run(square, f"--isel-port={port}", "--junitxml", "out.xml")
    result.assert_outcomes(passed=1)
    told = "assert_no_step_lost, assert_ends_at, assert_outputs"
    result.stdout.fnmatch_lines([
        f"*isel-twin at {port}: not looked at*",
        f"test_the_same_tests*.py::test_square: line 4 (! lost == 0), {told}",
    ])  # fmt: skip
    (noted,) = ElementTree.parse(square.path / "out.xml").iter("property")
    assert (noted.get("name"), noted.get("value")) == ("isel_twin_not_looked_at", f"line 4 (! lost == 0), {told}")


@pytest.mark.parametrize(
    ("job", "assertion", "told"),
    [
        ("@07\n@0Q9\n@0P\n", "assert_accepted(watched)", ["*a line of the job went wrong", "*line 2: @0Q9"]),
        ("@07\n@0P => 1*\n@07\n", "assert_accepted(watched)", ["*expected: 1[*]"]),
        ("@07\n", 'assert_replies(watched, ["5"])', ["*was: *'0'"]),
        ("@07\n", 'assert_replies(watched, ["0", "0"])', ["*another number of commands"]),
        ("@07\n@0P\n", "assert_cycle_time(watched, most_s=1e-9)", ["*too slow"]),
        ("@07\n! count.x == 3\n@0P\n! count.x == 77777\n", "assert_accepted(watched)", ["*line 4: ! count.x == 77777"]),
    ],
)
def test_what_goes_wrong_fails_as_with_the_twin(
    project: pytest.Pytester, port: str, job: str, assertion: str, told: list[str]
) -> None:
    (project.path / "job.txt").write_text(job)
    project.makepyfile(f'{ASSERTS}\ndef test_job(watched):\n    watched.play("job.txt")\n    {assertion}\n')
    result = run(project, f"--isel-port={port}")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(told)
    assert "recording" not in result.stdout.str()


def test_begin_forgets_and_a_second_job_goes_on_from_where_the_first_has_ended(
    project: pytest.Pytester, port: str
) -> None:
    (project.path / "job.txt").write_text("@07\n@0R7\n@0A800,5000,0,30,0,30,0,30\n")
    (project.path / "more.txt").write_text("@0A800,5000,0,30,0,30,0,30\n@0P\n! count.x == 1600\n")
    project.makepyfile(
        f"""
        {ASSERTS}
        def test_job(watched):
            assert watched.play("job.txt").ok
            watched.begin()
            assert watched.commands == [] and watched.job is None
            assert watched.play("more.txt").ok
            assert_replies(watched, ["0", "0000640000000000000"])
        """
    )
    run(project, f"--isel-port={port}").assert_outcomes(passed=1)


def test_whoever_needs_the_twin_is_skipped_before_anything_moves(project: pytest.Pytester, port: str) -> None:
    (project.path / "hood.toml").write_text("[[event]]\nat = 1.0\nset = { hood = 'open' }\n")
    project.makepyfile(
        """
        import pytest

        def test_twin(twin):
            twin.query("@07")

        def test_inside(watched):
            watched.twin.set_input("hood", "open")

        def test_path(watched):
            watched.samples()

        def test_port(twin_serial): ...
        def test_server(twin_server): ...
        def test_another(twin_factory, request):
            twin_factory(request)

        def test_host(virtual_host):
            virtual_host(["host.py"])

        @pytest.mark.twin(scenario="hood.toml")
        def test_scenario(watched): ...

        def test_without_any():
            pass
        """
    )
    result = run(project, f"--isel-port={port}", "-rs")
    result.assert_outcomes(skipped=8, passed=1)
    for what in ("twin.query", "twin.set_input", "watched.samples", "twin_server", "twin_factory", "its scenario"):
        result.stdout.fnmatch_lines(f"SKIPPED*{what}: needs the twin, and with --isel-port the machine is a real one")


def test_a_list_makes_one_test_at_the_one_machine(square: pytest.Pytester, port: str) -> None:
    path = next(square.path.glob("test_*.py"))
    path.write_text(path.read_text().replace("def test_square", "@pytest.mark.twin(seed=[1, 2, 3])\ndef test_square"))
    run(square).assert_outcomes(passed=3)
    run(square, f"--isel-port={port}").assert_outcomes(passed=1)


def test_no_port_nobody_there_and_a_controller_that_says_nothing(project: pytest.Pytester, port: str) -> None:
    (project.path / "job.txt").write_text("@07\n")
    (project.path / "job.nc").write_text("P1\nN10 G0 X1\nN20 M30\n")
    project.makepyfile(
        """
        import pytest

        def test_job(watched):
            watched.play("job.txt", timeout_s=0.3)

        @pytest.mark.twin(controller="bwo900", machine="4030-servo")
        def test_program(watched):
            watched.play("job.nc")
        """
    )
    result = run(project, f"--isel-port={project.path}/nowhere", "-k", "job")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines("--isel-port: *nowhere: *serial ports here*")
    result = run(project, f"--isel-port={port}", "-k", "program")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines("E*bwo900 acknowledges nothing on its line*")
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        result = run(project, f"--isel-port={os.ttyname(slave)}", "-k", "job")
    finally:
        os.close(master)
        os.close(slave)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines("E*no reply to @07 within 0.3 s*")


def test_one_machine_and_several_workers_are_refused(project: pytest.Pytester, tmp_path: Path) -> None:
    project.makepyfile("def test_nothing(): ...")
    result = run(project, f"--isel-port={tmp_path}/port", "-n", "2")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines("*--isel-port: there is one machine; leave -n (--numprocesses) out")


def test_a_blank_before_the_port_is_refused(project: pytest.Pytester, port: str) -> None:
    """pytest reads its arguments before it knows the option, and would take the port's folder for the project's: the
    keys of its ini file, such as the controller, would be lost without a word."""
    project.makepyfile("def test_nothing(): ...")
    result = run(project, "--isel-port", port)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines("*--isel-port: write --isel-port=PORT; *")
