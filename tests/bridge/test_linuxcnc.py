"""LinuxCNC itself, unmodified and without a screen, moves the twin.

By a sampler where it is installed (linuxcnc-uspace). In lockstep where its headers are, too (linuxcnc-uspace-dev, gcc),
and these tests run as root: the component is put into LinuxCNC's folder of modules as these tests see it only (a mount
of their own). ISEL_TWIN_LINUXCNC names another folder for the headers. What LinuxCNC is not needed for is tested
everywhere.
"""

from __future__ import annotations

import ctypes
import fcntl
import math
import os
import runpy
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
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

pytestmark = pytest.mark.long(seconds=5)

LIMIT_S = 300.0
LOOK_S = 0.05  # of wall time between two looks at the twin, each of which costs it some
SQUARE = "G1 F1200 X20 Y10\nG1 X30\nG1 Y20\nG1 X20\nG1 Y10"
FAST = {
    "MAX_LINEAR_VELOCITY = 30": "MAX_LINEAR_VELOCITY = 150",
    "MAX_VELOCITY = 25": "MAX_VELOCITY = 150",
    "MAX_ACCELERATION = 200": "MAX_ACCELERATION = 3000",
}


def lacks(*programs: str) -> str:
    """What is missing for sessions, in lockstep with these programs."""
    for program in ("linuxcnc", *programs):
        if shutil.which(program) is None:
            return f"{program} is not installed"
    if not programs:
        return ""
    if not (kit.HEADERS / "hal.h").is_file():
        return f"LinuxCNC's headers are not in {kit.HEADERS}: linuxcnc-uspace-dev, or ISEL_TWIN_LINUXCNC"
    tried = subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False)
    return "" if os.geteuid() == 0 and tried.returncode == 0 else "needs root, for a mount of its own"


with_linuxcnc = pytest.mark.skipif(bool(lacks()), reason=lacks())
in_lockstep = pytest.mark.skipif(bool(lacks("gcc", "unshare")), reason=lacks("gcc", "unshare"))


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
def sampler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LinuxCnc]:
    """As the fixture of the plugin, on a machine whose switches are near, without the component."""
    monkeypatch.setattr(kit, "lockstep", lambda: False)
    machine = str(near_switches(tmp_path, 8.0))
    twin = Twin(machine=machine, controller="external", seed=5, overrides={"controller.watchdog_ms": 0})
    served = ServedTwin(twin)
    yield LinuxCnc(served, tmp_path)
    served.stop()


@pytest.fixture
def linuxcnc(sampler: LinuxCnc, modules: Path, monkeypatch: pytest.MonkeyPatch) -> LinuxCnc:
    """The same with the component, which is seen by these tests only."""
    mounted = f'mount --bind {modules} {kit.MODULES} && exec linuxcnc "$@"'
    monkeypatch.setattr(Session, "command", ("unshare", "-m", "sh", "-c", mounted, "sh"))
    monkeypatch.setattr(kit, "lockstep", lambda: True)
    return sampler


@pytest.mark.parametrize(
    "way", [pytest.param("linuxcnc", marks=in_lockstep), pytest.param("sampler", marks=with_linuxcnc)]
)
def test_it_homes_runs_a_square_and_the_hood_stops_it(way: str, request: pytest.FixtureRequest) -> None:
    """Home is where the switches are, so what it believes is machine coordinates within trip point, hysteresis and
    backlash of the switch (0.5 mm); it loses nothing. Then the hood is forced open in motion."""
    linuxcnc: LinuxCnc = request.getfixturevalue(way)
    ask = linuxcnc.served.ask
    with linuxcnc.begin(mdi=f"{SQUARE}\nG1 X100", timeout_s=LIMIT_S) as session:
        while (seen := ask({"state": True}))["machine_position_mm"][0] < 40.0:
            assert session.running, session.wait().log
            time.sleep(LOOK_S)
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


@in_lockstep
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
    ini += "HALCMD = net a\n[EMCMOT]\nCOMM_TIMEOUT = 1\nEMCMOT = motmod\n"
    text = changed(f"{ini}[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n", ["twin.hal", "pendant.hal"])
    assert text == (
        "[DISPLAY]\nDISPLAY = ./session.py\nCYCLE_TIME = 0.1\n[HAL]\nHALFILE = twin.hal\nHALFILE = pendant.hal\n"
        "[EMCMOT]\nCOMM_TIMEOUT = 10\nEMCMOT = motmod\n[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n"
    )
    assert changed(INI.read_text(), ["isel4030.hal"]).splitlines().count("HALFILE = isel4030.hal") == 1


@pytest.mark.parametrize(
    ("ini", "line"),
    [
        ("#INCLUDE mesa.inc\n[DISPLAY]\n[HAL]\n[KINS]\nJOINTS = 3\n", "#INCLUDE mesa.inc: write that file's lines"),
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
    assert f"log: drwxrwxrwt {as_nobody}" in told, "open to the realtime part, which is no root; what is there stays"
    assert "HALFILE = isel4030_sampler.hal" in told, "the component is not installed"
    assert "HALFILE = pendant.hal" in told
    reader = "loadusr -Wn isel-twin ./rows_by_sampler.py port=1234 scale=400,320,1000 period=[EMCMOT]SERVO_PERIOD"
    assert reader in told
    assert not session.folder.exists()
    assert (pretending / "isel4030.tbl").read_text() == before


def test_a_session_that_is_left_early_ends_and_makes_room(pretending: Path) -> None:
    """As LinuxCNC's script does, it waits for its display before it heeds a signal; and it says very much."""
    kit.MODULES.mkdir()
    (kit.MODULES / "isel_twin_rows.so").touch()
    (pretending.parent / "programs" / "linuxcnc").write_text("#!/bin/sh\nseq 99999\nsleep 600\necho over\n")
    for _ in range(2):
        with Session("127.0.0.1:1234", [320] * 3) as session:
            assert session.running
            while "99999" not in (session.folder / kit.LOG).read_text():
                pass
            assert "port=1234 scale=320,320,320" in (session.folder / "isel4030.hal").read_text(), "in lockstep"
            with open(Path(tempfile.gettempdir()) / "isel-twin-linuxcnc.lock") as lock, pytest.raises(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        assert not session.running


def test_a_linuxcnc_that_does_not_end_is_told_and_killed(pretending: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It heeds no signal; no other session would ever begin."""
    monkeypatch.setattr(kit, "GRACE_S", 0.25)
    deaf = "#!/bin/sh\ntrap '' TERM\necho deaf\nwhile :; do sleep 1; done\n"
    (pretending.parent / "programs" / "linuxcnc").write_text(deaf)
    with Session("127.0.0.1:1234", [320] * 3, patience_s=0.01) as session:
        while "deaf" not in (session.folder / kit.LOG).read_text():
            assert session.running
        with pytest.raises(LinuxCncError, match=r"LinuxCNC has not ended 0.5 s after its session's time"):
            session.wait()
        assert session.running
    assert session._process.returncode == -signal.SIGKILL
    assert not session.folder.exists()


SLOW = """#!/bin/sh
sleep 1
echo $2 > "${0%/*}/begun"
sleep 600
"""


def test_a_signal_ends_linuxcnc_and_the_twin(pretending: Path) -> None:
    """Nothing of either is left."""
    (pretending.parent / "programs" / "linuxcnc").write_text(SLOW)
    begun = pretending.parent / "programs" / "begun"
    call = [sys.executable, "-m", "isel_twin", "linuxcnc", "--ini", pretending / INI.name, "--"]
    process = subprocess.Popen([*call, "--plant", "kinematic"], stderr=subprocess.PIPE, text=True)
    while not (begun.exists() and (folder := begun.read_text().rpartition("/")[0])):
        assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate()  # until the twin, too, has closed it
    assert process.returncode != 0
    assert "Traceback" not in told
    assert not Path(folder).exists()


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
        self.pieces, self.is_ready = pieces, False
        self.pins: dict[str, Any] = {}

    def component(self, name: str) -> Hal:
        assert name == "isel-twin"
        return self

    def stream(self, component: Hal, key: int, kinds: str) -> Hal:
        """Sampler 0: SAMPLER_SHMEM_KEY of LinuxCNC's streamer.h."""
        assert (component, key, kinds) == (self, 0x48534130, "fffbb")
        return self

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


class Threads:
    """LinuxCNC's library of HAL, as far as it holds and lets go."""

    def __init__(self, refuses: bool = False) -> None:
        self.calls: list[str] = []
        self._refuses = refuses

    def hal_stop_threads(self) -> int:
        self.calls.append("stop")
        return -1 if self._refuses else 0

    def hal_start_threads(self) -> int:
        self.calls.append("start")
        return 0


def by_sampler(
    monkeypatch: pytest.MonkeyPatch,
    port: str,
    pieces: list[list[tuple[Any, ...]]],
    threads: Threads | None = None,
    prompt: bool = True,
) -> Hal:
    """Run the reader to its end; the pins. prompt: answers come soon."""
    hal = Hal(pieces)
    monkeypatch.setitem(sys.modules, "hal", hal)
    monkeypatch.setattr(sys, "argv", ["rows_by_sampler.py", f"port={port}", "scale=320,320,320", "period=1000000"])
    monkeypatch.setattr(ctypes, "CDLL", lambda _: threads or Threads())
    program = ModuleType("rows_by_sampler")
    exec((KIT / "rows_by_sampler.py").read_text(), program.__dict__)
    waits = iter(range(len(pieces) + 1))

    def sleep(s: float) -> None:
        if s > 0.1:
            raise KeyboardInterrupt
        next(waits)

    with monkeypatch.context() as patch:
        patch.setattr(program.select, "select", lambda *_: ([prompt] * prompt, [], []))
        patch.setattr(program.time, "sleep", sleep)
        program.main()
    return hal


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


@pytest.mark.parametrize(
    ("rows", "prompt", "refuses", "calls"),
    [
        ([5, 5], True, False, []),
        ([6], True, False, ["stop", "start"]),
        ([6, 7, 1], True, False, ["stop", "start", "stop", "start"]),
        ([1], False, False, ["stop", "start"]),
        ([6, 6], True, True, ["stop", "stop"]),
    ],
)
def test_by_a_sampler_linuxcnc_is_held_while_it_is_ahead(
    served: ServedTwin,
    monkeypatch: pytest.MonkeyPatch,
    rows: list[int],
    prompt: bool,
    refuses: bool,
    calls: list[str],
) -> None:
    """By more than five rows, or while an answer is late; where its threads cannot be stopped they are not started."""
    threads, still = Threads(refuses), (0.0, 0.0, 0.0, False, False)
    looks = [look for n in rows for look in ([still] * n, [])]
    hal = by_sampler(monkeypatch, served.address.rpartition(":")[2], looks, threads, prompt)
    assert (threads.calls, hal["silent"], hal["refused"]) == (calls, 0, 0)
    assert served.ask({"state": True})["time_ns"] >= sum(rows) * 1_000_000


def test_by_a_sampler_what_goes_wrong_is_an_emergency_stop(
    served: ServedTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rows that are refused; a twin that is too late; one that goes. LinuxCNC is not held then, so that it sees it."""
    port = served.address.rpartition(":")[2]
    too_far = [(9.0e9, 0.0, 0.0, True, False), (9.0e9, 0.0, 0.0, True, False)]
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, True, True)], too_far])
    assert (hal["refused"], hal["power-ok"], hal["silent"]) == (2, False, 0)
    told = capsys.readouterr().err
    assert "rows_by_sampler: error '2880000000000'; allowed" in told
    assert told.count("\n") == 1, "the first of many"
    served.ask({"set": {"estop": "pressed"}})
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, False, False)]])
    assert (hal["power-ok"], hal["estop-ok"]) == (False, False)
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, True, False)] * 500])
    assert hal["silent"] == 0
    hal = by_sampler(monkeypatch, port, [[(0.0, 0.0, 0.0, True, False)] * 501])
    assert (hal["power-ok"], hal["silent"]) == (False, 1)
    assert "it is 501 rows late" in capsys.readouterr().err
    hal = by_sampler(monkeypatch, port, [[(math.nan, 0.0, 0.0, True, False)]])
    assert (hal["power-ok"], hal["silent"]) == (False, 1)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        threads, dies = Threads(), threading.Thread(target=one_that_dies, args=(listener,))
        dies.start()
        hal = by_sampler(monkeypatch, str(listener.getsockname()[1]), [[(0.0, 0.0, 0.0, True, True)] * 6], threads)
        dies.join()
    assert (hal["power-ok"], hal["estop-ok"], hal["silent"], threads.calls) == (False, False, 1, ["stop", "start"])
    assert "it has closed the line" in capsys.readouterr().err


def one_that_dies(listener: socket.socket) -> None:
    """A twin that goes at its first rows."""
    connection = listener.accept()[0]
    with connection, connection.makefile("rwb", buffering=0) as line:
        for answer in (b"names axes=3 limit_x1\n", b"ok 0 1 0\n"):
            line.readline()
            line.write(answer)
        connection.recv(65_536)


def test_by_a_sampler_a_session_without_its_twin_does_not_begin(
    served: ServedTwin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody there; one that has another client; one with other axes; one whose watchdog has struck. LinuxCNC waits for
    components that are not ready, so the program ends."""

    def told(port: str) -> str:
        with pytest.raises(SystemExit) as done:
            by_sampler(monkeypatch, port, [])
        assert not sys.modules["hal"].is_ready
        return str(done.value.code)

    assert "the twin at 127.0.0.1:1: " in told("1")
    port = served.address.rpartition(":")[2]
    with socket.create_connection(("127.0.0.1", int(port))):
        assert "in use by another client" in told(port)
    for settings, line in (({"controller.axes": 4}, "names axes=4 "), ({}, "the watchdog has switched")):
        twin = Twin(controller="external", plant="kinematic", overrides=settings)
        if not settings:
            twin.query("out stages=1")
            twin.run(2.0)
        other = ServedTwin(twin)
        try:
            assert line in told(other.address.rpartition(":")[2])
        finally:
            other.stop()


class LinuxCncModule(ModuleType):
    """LinuxCNC's Python module as the session uses it. A line of MDI takes `busy` looks until it has ended; then come
    these messages."""

    STATE_ESTOP, STATE_ESTOP_RESET, STATE_ON, MODE_MANUAL, MODE_MDI, EXEC_DONE, INTERP_IDLE = range(7)
    NML_ERROR, NML_TEXT, OPERATOR_ERROR, OPERATOR_TEXT = 1, 2, 11, 12
    error = RuntimeError

    def __init__(self, messages: dict[str, list[tuple[int, str]]], busy: int = 3) -> None:
        super().__init__("linuxcnc")
        self.stat = self.command = self.error_channel = lambda: self
        self.task_state, self.exec_state, self.interp_state, self.inpos = self.STATE_ESTOP, 5, 6, True
        self.homed, self.joint_actual_position = [False] * 3, [0.0] * 3
        self._messages, self._busy, self._left, self._line = messages, busy, 0, ""
        self.ended: list[str] = []

    def state(self, state: int) -> None:
        self.task_state = state

    def mode(self, _: int) -> None:
        self._left = 0

    def home(self, _: int) -> None:
        self.homed = [True] * 3

    def mdi(self, line: str) -> None:
        self._left, self._line = self._busy, line
        if line == "M9 (hood)":
            self.task_state = self.STATE_ESTOP

    def wait_complete(self, _: float = 5.0) -> int:
        self._left = max(0, self._left - 1)
        if self._left:
            return -1
        self.ended += [self._line] if self._line else []
        return 1

    def poll(self) -> Any:
        told = self._messages.get(self._line, [])
        return told.pop(0) if told and not self._left else None


@pytest.mark.parametrize(
    ("mdi", "messages", "code", "last"),
    [
        ("G0 X1\nG0 X2", {}, 0, "done"),
        ("G0 X1\nG0 X2", {"G0 X1": [(12, "a message")]}, 0, "done"),
        ("G0 X1\nG0 X2", {"G0 X2": [(12, "a message"), (11, "wrong")]}, 1, "G0 X2: wrong"),
        ("M9 (hood)", {}, 3, "M9 (hood): emergency stop"),
    ],
)
def test_a_session_waits_for_each_line_and_ends_at_an_error(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    mdi: str,
    messages: dict[str, list[tuple[int, str]]],
    code: int,
    last: str,
) -> None:
    """Also where the task is idle still, as it has not begun. Messages of a program are no errors."""
    module = LinuxCncModule(messages)
    monkeypatch.setitem(sys.modules, "linuxcnc", module)
    monkeypatch.setenv("ISEL_TWIN_MDI", mdi)
    with pytest.raises(SystemExit) as done:
        runpy.run_path(str(KIT / "session.py"))
    assert done.value.code == code
    assert capsys.readouterr().out.splitlines()[-1] == f"session: {last}"
    assert code == 3 or [*dict.fromkeys(module.ended)] == mdi.splitlines()
