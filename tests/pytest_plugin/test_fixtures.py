"""The plugin as a project meets it: fixtures, marker, ini keys, and what a failing test leaves."""

from __future__ import annotations

import faulthandler
import os
import re
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest
from pytest_plugin.projects import ALONE, INI, PLUGIN, drawing_project, project, run, warm

from isel_twin.cli import main
from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=9)

__all__ = ["drawing_project", "project", "warm"]
pytest_plugins = ["pytester"]


def test_the_plugin_comes_with_the_package() -> None:
    entries = (entry for found in distributions() for entry in found.entry_points if entry.group == "pytest11")
    plugins = {entry.value for entry in entries if entry.name == "isel_twin"}
    assert plugins == {"isel_twin.bridge.pytest.plugin"}, "installed before there was a plugin: install it again"


def test_a_project_without_twins_pays_for_nothing(project: pytest.Pytester) -> None:
    """No test uses a twin: neither numpy nor the twin nor anything behind it is imported."""
    project.makepyfile(
        """
        import sys

        def test_nothing_heavy():
            heavy = {"numpy", "mujoco", "mcap", "matplotlib", "cyclopts"}
            heavy |= {"isel_twin.core.twin", "isel_twin.core.spec"}
            assert "isel_twin.bridge.pytest.plugin" in sys.modules
            assert not heavy & set(sys.modules)
        """
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:hypothesispytest", "-p", "no:timeout"]
    done = subprocess.run(command, cwd=project.path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout


def test_a_crash_of_a_later_test_is_reported_where_it_was(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """pytest switches faulthandler off, or to another file, at the end of a session in a process that goes on."""
    switched: list[str] = []
    for name in ("enable", "disable"):
        monkeypatch.setattr(faulthandler, name, lambda *_, name=name, **__: switched.append(name))
    project.makepyfile("def test_anything():\n    pass\n")
    run(project).assert_outcomes(passed=1)
    assert not switched


# ---- fixtures ------------------------------------------------------------------------------------------------------


def test_every_fixture_in_a_test_that_passes(project: pytest.Pytester) -> None:
    (project.path / "host.py").write_text(HOST)
    project.makepyfile(
        """
        import serial

        def test_twin(twin):
            assert twin.query("@07") == "0" and not twin.physics

        def test_port(twin_serial, twin):
            assert twin_serial.is_open and twin_serial.twin is twin
            twin_serial.write(b"@07\\r")
            assert twin_serial.read() == b"0"
            twin_serial.close()
            twin_serial.open()
            assert twin_serial.twin is twin

        def test_server(twin_server):
            twin_server.ask({"set": {"hood": "open"}})
            assert twin_server.ask({"state": True})["inputs"]["hood"] == "open"
            with serial.serial_for_url(twin_server.url, timeout=900) as port:
                port.write(b"@07\\r")
                assert port.read() == b"0"
            assert twin_server.stop().inputs["hood"] == "open"

        def test_host(virtual_host, twin):
            run = virtual_host("host.py", port="COM4")
            assert run.ok and run.ended_ns > 600_000_000_000 and twin.time_ns >= run.ended_ns

        def test_watched(watched, twin):
            assert watched.twin is twin
        """
    )
    result = run(project)
    result.assert_outcomes(passed=5)
    assert "isel-twin" not in result.stdout.str()


HOST = """
import serial, time

with serial.Serial("COM4", 19200, timeout=1) as port:
    port.write(b"@07\\r")
    print(port.read())
time.sleep(600)
"""


def test_every_fixture_in_a_test_that_fails(project: pytest.Pytester) -> None:
    (project.path / "host.py").write_text(HOST.replace("600", "60") + "raise SystemExit('no tool')\n")
    project.makepyfile(
        """
        import pytest

        def test_twin(twin):
            assert twin.query("@0X") == "0"

        def test_port(twin_serial):
            twin_serial.timeout = 2.0
            assert twin_serial.read() == b"0", "silence"

        def test_server(twin_server):
            with pytest.raises(TimeoutError, match="not so in time"):
                twin_server.ask({"wait": {"output": "spindle", "is": 1, "wall_s": 0.05}})
            twin_server.ask({"set": {"hood": "ajar"}})

        def test_host(virtual_host):
            assert virtual_host(["host.py"]).ok
        """
    )
    result = run(project)
    result.assert_outcomes(failed=4)
    result.stdout.fnmatch_lines(
        [
            "E*assert '5' == '0'*",
            "twin: machine=4030 controller=imc-s8 plant=kinematic seed=0, 0.000000 s of virtual time",
            "  recording: */twin.mcap",
            "  once more: isel-twin replay */twin.mcap",
            "  picture:   */twin.png",
            "the test again: python* -m pytest *::test_twin",
            "E*AssertionError: silence*",
            "*, 2.000000 s of virtual time",
            "E*ValueError: request: set: input 'hood' cannot be 'ajar'*",
            "E*AssertionError: assert False*",
            "no tool*",
            "*seed=0, 60.* s of virtual time",
        ]
    )


@pytest.mark.parametrize(("endpoint", "begins"), [("tcp", "socket://"), ("rfc2217", "rfc2217://"), ("pty", "/dev/")])
def test_a_server_on_every_kind_of_port(project: pytest.Pytester, endpoint: str, begins: str) -> None:
    project.makepyfile(
        f"""
        import pytest, serial

        @pytest.mark.twin(endpoint="{endpoint}")
        def test_server(twin_server):
            assert twin_server.url.startswith("{begins}")
            with serial.serial_for_url(twin_server.url, 19200, timeout=900) as port:
                port.write(b"@07\\r")
                assert port.read() == b"0"
        """
    )
    run(project).assert_outcomes(passed=1)


# ---- marker and ini keys -------------------------------------------------------------------------------------------


def test_marker_over_ini_keys_and_the_nearest_marker_first(project: pytest.Pytester) -> None:
    project.makeini(INI + "    isel_twin_seed = 7\n    isel_twin_controller = imc-m\n")
    (project.path / "hood.toml").write_text('[[event]]\nat = 1.0\nset = { hood = "open" }\n')
    project.makepyfile(
        """
        import pytest

        pytestmark = pytest.mark.twin(machine="4030-portal", overrides={"payload.mass": 2.0})

        def test_ini(twin):
            assert (twin.origin.seed, twin.controller_name, twin.machine.name) == (7, "imc-m", "4030-portal")

        @pytest.mark.twin(machine="4030", seed=1, overrides={"axes.x.lead": 10.0}, scenario="hood.toml")
        def test_marker(twin):
            assert (twin.origin.seed, twin.controller_name, twin.machine.name) == (1, "imc-m", "4030")
            assert twin.machine.payload_kg == 2.0 and twin.machine.axes[0].screw.lead_mm == 10.0
            twin.run(2.0)
            assert twin.inputs["hood"] == "open"

        @pytest.mark.twin(start_mm=(10.0, 20.0, 30.0))
        def test_start(twin):
            assert twin.machine_position_mm.tolist() == [10.0, 20.0, 30.0]
        """
    )
    run(project).assert_outcomes(passed=3)


def test_lists_and_parameters_make_a_test_of_each(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.mark.twin(machine=["4030", "4030-portal"], seed=[1, 2])
        def test_lists(twin):
            assert twin.origin.seed in (1, 2)

        @pytest.mark.parametrize("twin", [{"seed": 3}, {"machine": "traverse"}], indirect=True)
        def test_twin(twin):
            assert twin.origin.seed == 3 or twin.machine.name == "traverse"

        @pytest.mark.parametrize("twin_call", [{"seed": 4}], indirect=True)
        def test_call(twin_serial):
            assert twin_serial.twin.origin.seed == 4

        @pytest.mark.twin(seed=[1, 2])
        class TestOne:
            @pytest.mark.twin(seed=5)
            def test_nearer(self, twin):
                assert twin.origin.seed == 5
        """
    )
    result = run(project, "-vv")
    result.assert_outcomes(passed=8)
    result.stdout.fnmatch_lines(["*test_lists?4030-seed1? PASSED*", "*test_lists?4030-portal-seed2? PASSED*"])


@pytest.mark.parametrize(
    ("marker", "line"),
    [
        ("machin='4030'", "pytest.mark.twin: unknown key 'machin'; there are: machine, controller, plant, *"),
        ("machine='9999'", "twin: unknown machine '9999': *"),
        ("plant='wood'", "twin: unknown plant 'wood'; there are: mujoco, kinematic"),
        ("controller='imc-x'", "twin: unknown controller 'imc-x'*"),
        ("scenario='none.toml'", "twin: *none.toml: there is no such file"),
        ("seed=-1", "pytest.mark.twin: seed=-1; must be a whole number from 0"),
        ("seed=[1, 'a']", "pytest.mark.twin: seed='a'; must be a whole number from 0"),
        ("seed=[]", "pytest.mark.twin: seed=?? is empty; name one or more"),
        ("overrides={'axes.x.leed': 1}", "twin: *leed*"),
        ("overrides=3", "pytest.mark.twin: overrides=3; must be a table*"),
        ("start_mm=(1, 2)", "twin: start_mm has 2 values; give one for each of X, Y and Z"),
        ("'4030'", "pytest.mark.twin('4030'): takes keys only, such as machine='4030'"),
    ],
)
def test_what_is_wrong_with_a_marker_is_one_line(project: pytest.Pytester, marker: str, line: str) -> None:
    project.makepyfile(f"import pytest\n\n@pytest.mark.twin({marker})\ndef test_it(twin):\n    pass\n")
    result = run(project)
    assert result.parseoutcomes()["errors"] >= 1
    begin = next(k for k, text in enumerate(result.outlines) if "ERROR at setup of test_it" in text)
    result.stdout.fnmatch_lines([line])
    between = [text for text in result.outlines[begin + 1 :] if text]
    assert between[1].startswith(("===", "___")), "one line, and no traceback"


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("seed = x", "ERROR: isel_twin_seed = x: must be a whole number from 0"),
        ("plant = wood", "ERROR: isel_twin_plant = wood: must be mujoco or kinematic"),
    ],
)
def test_what_is_wrong_with_an_ini_key_is_told_before_any_test(project: pytest.Pytester, key: str, line: str) -> None:
    project.makeini(f"[pytest]\nisel_twin_{key}\n")
    project.makepyfile("def test_it():\n    pass\n")
    result = run(project)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([line])


@pytest.mark.parametrize(
    ("fixture", "marker", "line"),
    [
        ("twin_server", "twin(endpoint='serial')", "pytest.mark.twin: endpoint='serial'; there are: tcp, rfc2217, pty"),
        ("twin_server", "twin(speed='fast')", "pytest.mark.twin: speed 'fast' is neither a positive number *"),
        ("twin", "parametrize('twin', [3], indirect=True)", "twin: the parameter 3 is no table; give one such as *"),
        ("twin", "parametrize('twin_call', [3], indirect=True)", "twin_call: the parameter 3 is no table; *"),
        ("twin", "parametrize('twin', [{'sed': 3}], indirect=True)", "twin: unknown key 'sed'; there are: *"),
    ],
)
def test_what_is_wrong_with_a_server_or_a_parameter_is_one_line(
    project: pytest.Pytester, fixture: str, marker: str, line: str
) -> None:
    project.makepyfile(f"import pytest\n\n@pytest.mark.{marker}\ndef test_it({fixture}):\n    pass\n")
    result = run(project)
    result.assert_outcomes(errors=1)
    begin = next(k for k, text in enumerate(result.outlines) if "ERROR at setup of test_it" in text)
    pytest.LineMatcher(result.outlines[begin + 1 : begin + 2]).fnmatch_lines([line])
    assert result.outlines[begin + 2].startswith("==="), "one line, and no traceback"


@pytest.mark.parametrize(
    ("job", "lines"),
    [
        (None, ["E*FileNotFoundError: * No such file or directory: 'job.txt'"]),
        ("", ["E*JobError: job.txt: there is no command in it"]),
        ("@07 =>\n", ["E*JobError: job.txt: line 1, column 7: say what is expected: *", "E *@07 =>", "E * ^"]),
        ("@07\n! weight == 1\n", ["E*JobError: job.txt: line 2, column 3: *weight*", "E*! weight == 1", "E * ^*"]),
    ],
)
def test_a_job_that_cannot_be_played_is_told_with_file_line_and_column(
    project: pytest.Pytester, job: str | None, lines: list[str]
) -> None:
    if job is not None:
        (project.path / "job.txt").write_text(job)
    project.makepyfile("def test_it(watched):\n    watched.play('job.txt')\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(lines)
    assert "watched.py" not in result.stdout.str()


def test_the_marker_is_registered_and_described(project: pytest.Pytester) -> None:
    run(project, "--markers").stdout.fnmatch_lines(["@pytest.mark.twin(machine=..., controller=...*"])
    run(project, "--fixtures").stdout.fnmatch_lines(["twin_server*", "*served on a free port*"])


def test_it_can_be_left_out(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\n")
    project.makepyfile("def test_it(twin):\n    pass\n")
    result = run(project, "-p", "no:isel_twin")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*fixture 'twin' not found*"])


# ---- what a failing test leaves ------------------------------------------------------------------------------------


def recordings(text: str) -> list[Path]:
    return [Path(found) for found in re.findall(r"recording: (.*\.mcap)", text)]


def test_a_recording_plays_again_and_there_is_a_picture(
    drawing_project: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    drawing_project.makepyfile(
        """
        def test_it(twin, tmp_path):
            twin.query("@07")
            twin.line_speed = True
            twin.watch_margin()
            twin.set_input("hood", "open")
            twin.run(1.0)
            twin.write(b"@0R")
            twin.run(0.5)
            twin.write(b"7\\r")
            twin.run(0.25)
            assert (tmp_path, False)[1]
        """
    )
    result = run(drawing_project)
    result.assert_outcomes(failed=1)
    (path,) = recordings(result.stdout.str())
    assert path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert path.parent.name == "isel-twin", "in the folder of the test"
    assert "ends elsewhere" not in result.stdout.str(), "the hood was opened there, too"
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(path)])
    assert ended.value.code == 0
    assert "no difference in replies, times, stream and positions, 1.750000 s" in capsys.readouterr().out.replace(
        "1.750 s", "1.750000 s"
    )


def test_two_twins_of_a_test_leave_two_recordings(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        def test_it(twin, request, twin_factory):
            other = twin_factory(request, seed=9)
            other.query("@07")
            assert twin is other
        """
    )
    result = run(project)
    result.stdout.fnmatch_lines(["twin: *seed=0*", "  recording: */twin.mcap", "twin-2: *seed=9*", "*/twin-2.mcap"])
    assert all(path.is_file() for path in recordings(result.stdout.str()))


def test_a_twin_of_a_class_is_told_of_in_each_test_that_fails(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.fixture(scope="class")
        def gantry(request, twin_factory):
            return twin_factory(request)

        @pytest.mark.twin(seed=4)
        class TestGantry:
            def test_first(self, gantry):
                assert gantry.query("@07") == "1"

            def test_second(self, gantry):
                gantry.run(1.0)
                assert gantry.query("@0R7") == "0"

            def test_third(self, gantry):
                assert gantry.time_ns == 0

        def test_without():
            assert not "a twin"
        """
    )
    result = run(project)
    result.assert_outcomes(failed=3, passed=1)
    result.stdout.fnmatch_lines(["twin: *seed=4, 0.000000 s*", "twin: *seed=4, ??.?????? s*", "*FAILED*"])
    paths = recordings(result.stdout.str())
    assert len(paths) == len(set(paths)) == 2, "the test without a twin has none"


def test_what_is_done_past_the_twin_is_not_in_its_recording_and_is_told(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        def test_it(twin):
            for command in (b"@07\\r", b"@0R7\\r"):
                twin._line.from_host(twin.time_ns, command, 0)
                twin._settle()
            twin.run(1.0)
            assert twin.time_ns == 0
        """
    )
    run(project).stdout.fnmatch_lines(["  recording: *", "  the recording ends elsewhere than the test: *"])


def test_a_second_run_writes_over_the_first_and_junit_has_the_path(project: pytest.Pytester) -> None:
    project.makeini(INI + "    isel_twin_artifacts = left\n")
    project.makepyfile("def test_it(twin):\n    assert twin.query('@07') == '1'\n")
    for _ in range(2):
        result = run(project, "--junit-xml=report.xml", "-o", "junit_family=xunit1")
        (path,) = recordings(result.stdout.str())
        assert path.is_file()
    assert sorted(path.name for path in (project.path / "left").rglob("*.*") if path.is_file()) == [
        "twin.mcap",
        "twin.png",
    ]
    assert f'name="isel_twin_recording" value="{path}"' in (project.path / "report.xml").read_text()


def test_paths_are_seen_from_the_file_that_has_them(project: pytest.Pytester) -> None:
    """The ini file stands above, the tests in a folder, and pytest is called from another one."""
    hood = '[[event]]\nat = 1.0\nset = { hood = "open" }\n'
    for name in ("deep", "elsewhere"):
        project.mkdir(name)
    (project.path / "above.toml").write_text(hood)
    (project.path / "deep" / "own.toml").write_text(hood.replace("hood", "estop").replace("open", "pressed"))
    project.makeini(INI + "    isel_twin_scenario = above.toml\n")
    (project.path / "deep" / "test_it.py").write_text(
        "import pytest\n\n"
        "def test_above(twin):\n    twin.run(2.0)\n    assert twin.inputs['hood'] == 'open'\n\n"
        "@pytest.mark.twin(scenario='own.toml')\n"
        "def test_own(twin):\n    twin.run(2.0)\n    assert twin.inputs['estop'] == 'pressed'\n"
    )
    os.chdir(project.path / "elsewhere")  # which pytester undoes
    run(project, "../deep", "-c", "../tox.ini", "--rootdir", "..").assert_outcomes(passed=2)


def test_a_list_for_a_twin_of_a_class_is_a_line(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.fixture(scope="class")
        def gantry(request, twin_factory):
            return twin_factory(request)

        @pytest.mark.twin(seed=[1, 2])
        class TestGantry:
            def test_it(self, gantry):
                pass
        """
    )
    result = run(project)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["twin_factory: seed=?1, 2?: a list makes tests, and here is one twin; *"])


def test_a_skipped_test_and_an_expected_failure_leave_nothing(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        def test_skipped(twin):
            pytest.skip("not today")

        @pytest.mark.xfail
        def test_expected(twin):
            assert twin.time_ns == 1
        """
    )
    result = run(project, "-ra")
    result.assert_outcomes(skipped=1, xfailed=1)
    assert "recording" not in result.stdout.str()


def test_without_linuxcnc_its_fixture_skips(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it is installed it is tried out by tests/bridge/test_linuxcnc.py."""
    monkeypatch.setenv("PATH", str(project.path))
    project.makepyfile(
        """
        def test_our_pocket(linuxcnc):
            assert linuxcnc("ours.ini").code == 0
        """
    )
    result = run(project, "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["SKIPPED*linuxcnc is not installed: apt-get install linuxcnc-uspace"])


def test_folders_of_tests_with_odd_names_do_not_clash(project: pytest.Pytester) -> None:
    project.makeini(INI + "    isel_twin_artifacts = left\n")
    project.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("name", ["a/b", "a_b", "../../c", "Fräse", "F_r", "x" * 300, "a b'\\"$(c)", ""])
        def test_it(twin, name):
            assert twin is name
        """
    )
    result = run(project)
    result.assert_outcomes(failed=8)
    paths = recordings(result.stdout.str())
    assert len({path.parent for path in paths}) == 8
    assert {path.parent.parent for path in paths} == {project.path / "left"}


NO_PICTURES = """
    from isel_twin.bridge.pytest import kept

    def touch(twin, recorder, picture, zero_ns):
        picture.touch()
        return f"picture:   {picture}"

    kept._draw = touch
"""


def test_workers_share_a_folder(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two real workers, each with failing tests of the same names in another file; what they say gets through."""
    for name, value in {**ALONE, "PYTEST_PLUGINS": f"{PLUGIN},xdist.plugin"}.items():
        monkeypatch.setenv(name, value)
    project.makeini(INI + "    isel_twin_artifacts = left\n")
    source = """
        import pytest
        from isel_twin.jobs.checks.asserts import assert_replies

        def test_told(watched):
            watched.begin()
            watched.twin.query("@07")
            assert_replies(watched, ["1"])

        @pytest.mark.twin(seed=[1, 2])
        def test_it(twin_serial):
            twin_serial.write(b"@07\\r")
            assert twin_serial.read() == b"0" and twin_serial.twin.origin.seed == 1

        @pytest.mark.twin(machine="9999")
        def test_wrong(twin):
            pass
    """
    project.makepyfile(test_one=source, test_two=source)
    project.makeconftest(NO_PICTURES)
    result = project.runpytest_subprocess("-q", "-n", "2")
    result.assert_outcomes(passed=2, failed=4, errors=2)
    result.stdout.fnmatch_lines(["E *another reply", "E *expected: '1'", "E *was:      '0'", "E *command:  @07"])
    result.stdout.fnmatch_lines(["twin: unknown machine '9999': *"])
    paths = recordings(result.stdout.str())
    assert len(set(paths)) == 4
    assert all(path.is_file() and path.with_suffix(".png").is_file() for path in paths)


def test_a_folder_that_cannot_be_made_is_a_line(project: pytest.Pytester) -> None:
    project.makeini(INI + "    isel_twin_artifacts = left\n")
    (project.path / "left").write_text("a file")
    project.makepyfile("def test_it(twin):\n    assert twin.query('@07') == '1'\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["E*assert '0' == '1'*", "no recording: */left*: *", "twin: *", "the test again: *"])


def test_a_full_disk_is_a_line(project: pytest.Pytester) -> None:
    """/dev/full takes nothing; the test fails with what it is about all the same."""
    project.makeconftest(
        """
        import isel_twin.bridge.pytest.kept as kept
        from pathlib import Path

        class Full(type(Path())):
            pass

        def leave(one, folder, name, real=kept._leave):
            (folder / f"{name}.mcap").symlink_to("/dev/full")
            return real(one, folder, name)

        import pytest

        @pytest.fixture(autouse=True)
        def full(monkeypatch):
            kept._leave, real = leave, kept._leave
            yield
            kept._leave = real
        """
    )
    project.makepyfile("def test_it(twin):\n    assert twin.query('@07') == '1'\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["E*assert '0' == '1'*", "  no recording: *twin.mcap: *"])


def test_without_matplotlib_there_is_a_recording(
    drawing_project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "isel_twin.report.sketch")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    drawing_project.makepyfile("def test_it(twin):\n    assert twin.query('@07') == '1'\n")
    result = run(drawing_project)
    result.stdout.fnmatch_lines(
        ["  recording: */twin.mcap", "  no picture: it needs matplotlib: pip install 'isel-twin?report?'"]
    )
