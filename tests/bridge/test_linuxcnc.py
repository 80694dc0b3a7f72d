"""LinuxCNC itself, unmodified and without a screen, moves the twin.

Where it is installed with its headers (linuxcnc-uspace, linuxcnc-uspace-dev, gcc) and these tests run as root: the
component is put into LinuxCNC's folder of modules as these tests see it only (a mount of their own). ISEL_TWIN_LINUXCNC
names another folder for the headers. What LinuxCNC is not needed for is tested everywhere.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from isel_twin.bridge.linuxcnc import session as kit
from isel_twin.bridge.linuxcnc.session import INI, KIT, LinuxCncError, Session, changed, scale_of
from isel_twin.bridge.pytest.kept import ServedTwin
from isel_twin.bridge.pytest.linuxcnc import LinuxCnc
from isel_twin.core.twin import Twin
from tests.in_process import isel_twin
from tests.near import near_switches

LIMIT_S = 300.0
SQUARE = "G1 F1200 X20 Y10\nG1 X30\nG1 Y20\nG1 X20\nG1 Y10"
FAST = {
    "MAX_LINEAR_VELOCITY = 30": "MAX_LINEAR_VELOCITY = 150",
    "MAX_VELOCITY = 25": "MAX_VELOCITY = 150",
    "MAX_ACCELERATION = 200": "MAX_ACCELERATION = 3000",
}


def lacks() -> str:
    for program in ("linuxcnc", "gcc", "unshare"):
        if shutil.which(program) is None:
            return f"{program} is not installed"
    if not (kit.HEADERS / "hal.h").is_file():
        return f"LinuxCNC's headers are not in {kit.HEADERS}: linuxcnc-uspace-dev, or ISEL_TWIN_LINUXCNC"
    tried = subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False)
    return "" if os.geteuid() == 0 and tried.returncode == 0 else "needs root, for a mount of its own"


with_linuxcnc = pytest.mark.skipif(bool(lacks()), reason=lacks())


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """LinuxCNC's modules and the component, compiled; open to the realtime part, which runs as nobody."""
    folder = Path("/tmp") / f"isel-twin-modules-{os.getpid()}"
    shutil.copytree(kit.MODULES, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kit, "MODULES", folder)
        assert kit.install().is_file()
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def linuxcnc(tmp_path: Path, modules: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LinuxCnc]:
    """As the fixture of the plugin, on a machine whose switches are near, with the component seen by it only."""
    mounted = f'mount --bind {modules} {kit.MODULES} && exec linuxcnc "$@"'
    monkeypatch.setattr(Session, "command", ("unshare", "-m", "sh", "-c", mounted, "sh"))
    monkeypatch.setattr(kit, "lockstep", lambda: True)
    machine = str(near_switches(tmp_path, 8.0))
    twin = Twin(machine=machine, controller="external", seed=5, overrides={"controller.watchdog_ms": 0})
    served = ServedTwin(twin)
    yield LinuxCnc(served, tmp_path)
    served.stop()


@with_linuxcnc
def test_it_homes_runs_a_square_and_the_hood_stops_it(linuxcnc: LinuxCnc) -> None:
    """Home is where the switches are, so what it believes is machine coordinates within trip point, hysteresis and
    backlash of the switch (0.5 mm); it loses nothing. Then the hood is forced open in motion."""
    ask = linuxcnc.served.ask
    with linuxcnc.begin(mdi=f"{SQUARE}\nG1 X100", timeout_s=LIMIT_S) as session:
        while (seen := ask({"state": True}))["machine_position_mm"][0] < 40.0:
            assert session.running, session.wait().log
        assert max(map(abs, seen["lost_steps"])) < 16.0, "half a slip"
        ask({"set": {"hood": "forced"}})
        done = session.wait()
    assert done.code == 3, done.log
    assert done.said[0] == "homed"
    believed = [[float(mm) for mm in line.rpartition(": ")[2].split()] for line in done.said[1:6]]
    corners = [[20, 10, 2], [30, 10, 2], [30, 20, 2], [20, 20, 2], [20, 10, 2]]
    assert believed == [pytest.approx(corner, abs=0.01) for corner in corners]
    assert done.said[6] == "G1 X100: emergency stop"
    seen = ask({"state": True})
    assert seen["outputs"]["power"] == 0
    assert abs(seen["machine_position_mm"][1] - 10.0) < 0.5


@with_linuxcnc
def test_too_fast_it_notices_nothing_and_the_twin_does(linuxcnc: LinuxCnc, tmp_path: Path) -> None:
    """With an INI of its own, that asks for more than the motors can."""
    text = INI.read_text()
    for old, new in FAST.items():
        text = text.replace(old, new)
    for path in (INI.parent / "isel4030.tbl", INI):
        (tmp_path / path.name).write_text(path.read_text() if path != INI else text)
    done = linuxcnc(INI.name, "G0 X100", timeout_s=LIMIT_S)
    assert (done.code, done.said[-1]) == (0, "done"), done.log
    assert float(done.said[1].split()[2]) == pytest.approx(100.0, abs=0.01)
    seen = linuxcnc.served.ask({"state": True})
    assert abs(seen["lost_steps"][0]) > 1000.0
    assert seen["machine_position_mm"][0] < 90.0


# ---- without LinuxCNC ----


def test_an_ini_keeps_all_but_its_hardware_and_its_display() -> None:
    ini = "[DISPLAY]\nDISPLAY = axis\nCYCLE_TIME = 0.1\n[HAL]\nHALFILE = mesa.hal\nPOSTGUI_HALFILE = p.hal\n"
    text = changed(f"{ini}[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n", ["twin.hal", "pendant.hal"])
    assert text == (
        "[DISPLAY]\nDISPLAY = ./session.py\nCYCLE_TIME = 0.1\n[HAL]\nHALFILE = twin.hal\nHALFILE = pendant.hal\n"
        "[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n"
    )
    assert changed(INI.read_text(), ["isel4030.hal"]).splitlines().count("HALFILE = isel4030.hal") == 1


@pytest.mark.parametrize(
    ("ini", "line"),
    [
        ("[DISPLAY]\n[KINS]\nJOINTS = 3\n", "must have one section [HAL]"),
        ("[DISPLAY]\n[HAL]\n[KINS]\nJOINTS = 4\n", "[KINS]JOINTS = 4; allowed: 3"),
        ("[DISPLAY]\n[HAL]\n[KINS]\n", "[KINS]JOINTS = nothing; allowed: 3"),
        ("[DISPLAY]\n[HAL]\n[TRAJ]\nLINEAR_UNITS = inch\n[KINS]\nJOINTS=3\n", "LINEAR_UNITS = inch; allowed: mm"),
    ],
)
def test_an_ini_that_the_twin_cannot_serve_is_refused(ini: str, line: str) -> None:
    with pytest.raises(LinuxCncError) as caught:
        changed(ini, [])
    assert line in str(caught.value)


def test_counts_per_mm_must_be_whole() -> None:
    assert scale_of({"step_mm": [0.003125, 0.003125, 0.001, 0.5]}) == [320, 320, 1000]
    with pytest.raises(LinuxCncError, match="whole numbers"):
        scale_of({"step_mm": [0.003, 0.003125, 0.003125]})


@pytest.mark.skipif(bool(shutil.which("linuxcnc")), reason="LinuxCNC is installed")
@pytest.mark.parametrize("words", [(), ("--install",)])
def test_without_linuxcnc_it_says_so(words: tuple[str, ...]) -> None:
    done = isel_twin("linuxcnc", *words)
    line = "isel-twin: linuxcnc is not installed: apt-get install linuxcnc-uspace\n"
    assert (done.returncode, done.stderr) == (2, line)


PROGRAM = """#!/bin/sh
echo "session: called with $1 $2"
for file in "${2%/*}"/*; do echo "log: $(basename "$file") $(stat -c %A "$file" | cut -c1-10)"; done
echo "log: $(stat -c %A "${2%/*}") ${RTAPI_UID:-} ${RTAPI_FIFO_PATH:-}"
echo "session: $ISEL_TWIN_MDI, $ISEL_TWIN_PATIENCE_S s"
grep -h -E 'port=|HALFILE' "${2%/*}"/*.hal "$2"
echo changed > "${2%/*}/isel4030.tbl"
echo "isel_twin_rows: the twin does not answer"
exit 3
"""


@pytest.fixture
def pretending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Programs in the place of LinuxCNC's, that tell how they are called; a folder with an INI."""
    programs = tmp_path / "programs"
    programs.mkdir()
    for name, text in (("linuxcnc", PROGRAM), ("halrun", "#!/bin/sh\necho $1 > $0.called\n")):
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setattr(kit, "MODULES", tmp_path / "modules")
    folder = tmp_path / "ours"
    shutil.copytree(INI.parent, folder)
    (folder / "long.ngc").write_bytes(b"(" + b"x" * (1 << 20) + b")")
    (folder / "macros").mkdir()
    yield folder
    assert (programs / "halrun.called").read_text() == "-U\n"


def test_a_session_has_a_folder_of_its_own_and_leaves_the_users_alone(pretending: Path) -> None:
    """Small files are copied, long ones and folders linked to. How it ends is what LinuxCNC's session says."""
    before = (pretending / "isel4030.tbl").read_text()
    with Session("127.0.0.1:1234", [400, 320, 1000], pretending / INI.name, "G0 X1", ["pendant.hal"], 7.5) as session:
        ini = session.folder / INI.name
        done = session.wait()
        assert not session.running
    assert done.code == 3
    assert done.said == (f"called with -r {ini}", "G0 X1, 7.5 s", "isel_twin_rows: the twin does not answer")
    told = done.log.splitlines()
    for line in ("session.py -rwxr-xr-x", "long.ngc lrwxrwxrwx", "macros lrwxrwxrwx"):
        assert f"log: {line}" in told
    as_nobody = f"65534 {session.folder}/fifo" if os.geteuid() == 0 else " "
    assert f"log: drwxrwxrwx {as_nobody}" in told, "open to the realtime part, which is no root"
    assert "HALFILE = isel4030_sampler.hal" in told, "the component is not installed"
    assert "HALFILE = pendant.hal" in told
    reader = "loadusr -Wn isel-twin ./rows_by_sampler.py port=1234 scale=400,320,1000 period=[EMCMOT]SERVO_PERIOD"
    assert reader in told
    assert not session.folder.exists()
    assert (pretending / "isel4030.tbl").read_text() == before


def test_a_session_that_is_left_early_ends_and_makes_room(pretending: Path) -> None:
    kit.MODULES.mkdir()
    (kit.MODULES / "isel_twin_rows.so").touch()
    (pretending.parent / "programs" / "linuxcnc").write_text("#!/bin/sh\nexec sleep 600\n")
    for _ in range(2):
        with Session("127.0.0.1:1234", [320] * 3) as session:
            assert session.running
            assert "port=1234 scale=320,320,320" in (session.folder / "isel4030.hal").read_text(), "in lockstep"
            with open(Path(tempfile.gettempdir()) / "isel-twin-linuxcnc.lock") as lock, pytest.raises(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        assert not session.running


@pytest.mark.parametrize(
    ("code", "exit_code", "line"), [(0, 0, ""), (3, 3, "an emergency stop"), (9, 1, "did not come")]
)
def test_the_command_ends_as_linuxcnc_does(pretending: Path, code: int, exit_code: int, line: str) -> None:
    program = pretending.parent / "programs" / "linuxcnc"
    program.write_text(f"#!/bin/sh\necho 'session: done'\nexit {code}\n")
    done = isel_twin("linuxcnc", "--ini", pretending / INI.name, "--", "--plant", "kinematic")
    assert done.returncode == exit_code
    assert done.stdout.splitlines()[0] == "done"
    assert done.stdout.splitlines()[1].startswith("twin: ")
    assert line in done.stderr


@pytest.mark.parametrize(
    ("missing", "line"),
    [
        ("gcc", "no gcc, or no headers"),
        ("hal.h", "no gcc, or no headers"),
        ("modules", "not writable; call it with sudo"),
    ],
)
def test_what_the_component_needs_is_named(
    pretending: Path, monkeypatch: pytest.MonkeyPatch, missing: str, line: str
) -> None:
    programs = pretending.parent / "programs"
    (programs / "halrun.called").write_text("-U\n")
    monkeypatch.setattr(kit, "HEADERS", programs)
    for name in {"gcc", "hal.h"} - {missing}:
        (programs / name).write_text("#!/bin/sh\necho no such thing >&2\nexit 1\n")
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(programs))
    if missing != "modules":
        kit.MODULES.mkdir()
    with pytest.raises(LinuxCncError) as caught:
        kit.install()
    assert line in str(caught.value)


class Hal(ModuleType):
    """LinuxCNC's Python module `hal` as the sampler's reader uses it: its samples come from here."""

    HAL_FLOAT, HAL_BIT, HAL_U32, HAL_IN, HAL_OUT = range(5)

    def __init__(self, pieces: list[list[tuple[Any, ...]]]) -> None:
        super().__init__("hal")
        self.pieces, self.pins, self.is_ready = pieces, {}, False
        self.component = self.stream = lambda *_: self

    def newpin(self, name: str, kind: int, way: int) -> None:
        self.pins[name] = 0

    def ready(self) -> None:
        self.is_ready = True

    @property
    def readable(self) -> bool:
        """False at the end of each piece; LinuxCNC ends behind the last."""
        if not self.pieces:
            raise KeyboardInterrupt
        if self.pieces[0]:
            return True
        self.pieces.pop(0)
        return False

    def read(self) -> tuple[Any, ...]:
        return self.pieces[0].pop(0)

    def __getitem__(self, name: str) -> Any:
        return self.pins[name]

    def __setitem__(self, name: str, value: Any) -> None:
        assert name in self.pins
        self.pins[name] = value


def by_sampler(monkeypatch: pytest.MonkeyPatch, port: str, pieces: list[list[tuple[Any, ...]]]) -> Hal:
    """Run the reader to its end; the pins."""
    hal = Hal(pieces)
    monkeypatch.setitem(sys.modules, "hal", hal)
    monkeypatch.setattr(sys, "argv", ["rows_by_sampler.py", f"port={port}", "scale=320,320,320", "period=1000000"])
    program = ModuleType("rows_by_sampler")
    exec((KIT / "rows_by_sampler.py").read_text(), program.__dict__)
    waits = iter(range(len(pieces) + 1))
    monkeypatch.setattr(program.time, "sleep", lambda s: next(waits) if hal.is_ready and s < 0.1 else end())  # type: ignore[attr-defined]
    program.main()  # type: ignore[attr-defined]
    return hal


def end() -> None:
    raise KeyboardInterrupt


@pytest.fixture
def served() -> Iterator[ServedTwin]:
    twin = Twin(controller="external", plant="kinematic", start_mm=(1.0, 50.0, 20.0))
    served = ServedTwin(twin)
    yield served
    served.stop()


def test_by_a_sampler_set_points_move_the_twin_and_its_switches_come_back(
    served: ServedTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """160 rows of 0.01 mm towards a switch that is 1 mm away, in two pieces."""
    rows = [(-0.01 * n, 0.0, 0.02 * n, True, n == 1) for n in range(1, 161)]
    hal = by_sampler(monkeypatch, served.address.rpartition(":")[2], [rows[:100], rows[100:]])
    assert served.ask({"state": True})["counts"] == [round(-1.6 * 320), 0, round(3.2 * 320)]
    assert [hal[f"limit-1-{n}"] for n in range(3)] == [True, False, False]
    assert [hal[f"limit-2-{n}"] for n in range(3)] == [False, False, False]
    assert (hal["power-ok"], hal["estop-ok"], hal["silent"], hal["refused"]) == (True, True, 0, 0)
    assert capsys.readouterr().err == ""


def test_by_a_sampler_what_goes_wrong_is_an_emergency_stop(
    served: ServedTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row that is refused; a twin that is too late; no twin."""
    port = served.address.rpartition(":")[2]
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, True, True)], [(9.0e9, 0.0, 0.0, True, False)]])
    assert (hal["refused"], hal["power-ok"], hal["silent"]) == (1, False, 0)
    assert "rows_by_sampler: error '2880000000000'; allowed" in capsys.readouterr().err
    served.ask({"set": {"estop": "pressed"}})
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, False, False)]])
    assert (hal["power-ok"], hal["estop-ok"]) == (False, False)
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, True, False)] * 501])
    assert (hal["power-ok"], hal["silent"]) == (False, 1)
    assert "it is 501 rows late" in capsys.readouterr().err
    hal = by_sampler(monkeypatch, "1", [])
    assert (hal["power-ok"], hal["silent"]) == (False, 1)
    assert "the twin at 127.0.0.1:1: " in capsys.readouterr().err
