"""LinuxCNC itself, unmodified and without a screen, moves the twin.

Where it is installed with its headers (linuxcnc-uspace, linuxcnc-uspace-dev, gcc) and these tests run as root: the
component is put into LinuxCNC's folder of modules as these tests see it only (a mount of their own). ISEL_TWIN_LINUXCNC
names another folder for the headers. One LinuxCNC runs on a computer, so they wait for a lock.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from isel_twin.bridge.linuxcnc import __file__ as KIT
from tests.bridge.conftest import Served
from tests.in_process import isel_twin
from tests.near import near_switches

HEADERS = Path(os.environ.get("ISEL_TWIN_LINUXCNC", "/usr/include/linuxcnc"))
MODULES = Path("/usr/lib/linuxcnc/modules")
LIMIT_S = 90
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
    if not (HEADERS / "hal.h").is_file():
        return f"LinuxCNC's headers are not in {HEADERS}: linuxcnc-uspace-dev, or ISEL_TWIN_LINUXCNC"
    tried = subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False)
    return "" if os.geteuid() == 0 and tried.returncode == 0 else "needs root, for a mount of its own"


pytestmark = pytest.mark.skipif(bool(lacks()), reason=lacks())


def open_folder() -> Path:
    """A new folder for the realtime part, which runs as nobody; pytest's are closed to others."""
    folder = Path(tempfile.mkdtemp(prefix="isel-twin-linuxcnc-"))
    folder.chmod(0o777)
    return folder


@pytest.fixture(scope="module")
def modules() -> Iterator[Path]:
    """LinuxCNC's modules and the component, compiled."""
    folder = open_folder()
    for path in MODULES.glob("*.so"):
        shutil.copy(path, folder)
    source, made = Path(KIT).parent / "isel_twin_rows.c", folder / "isel_twin_rows.so"
    call = ["gcc", "-O2", "-shared", "-fPIC", "-Wall", "-Werror", "-DRTAPI", "-DUSPACE", "-D__MODULE__"]
    call += ["-D_GNU_SOURCE", f"-I{HEADERS}", str(source), "-o", str(made), "-lm"]
    subprocess.run(call, check=True)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def only_one() -> Iterator[None]:
    import fcntl

    with open(Path(tempfile.gettempdir()) / "isel-twin-linuxcnc.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
        subprocess.run(["halrun", "-U"], capture_output=True, check=False)


class Session:
    """A LinuxCNC with the kit's files, beside a served twin."""

    def __init__(self, served: Served, modules: Path, changed: dict[str, str], mdi: str) -> None:
        self.served = served
        self.folder = folder = open_folder()
        for path in (Path(KIT).parent / "retrofit").iterdir():
            text = path.read_text()
            for old, new in {"port=7800": f"port={served.info['tcp'].rpartition(':')[2]}", **changed}.items():
                text = text.replace(old, new)
            (folder / path.name).write_text(text)
            (folder / path.name).chmod(0o755)
        environment = {
            **{"HOME": str(folder), "RTAPI_UID": "65534", "RTAPI_FIFO_PATH": str(folder / "fifo")},
            **{"ISEL_TWIN_MDI": mdi, "ISEL_TWIN_PATIENCE_S": str(LIMIT_S), "PATH": os.environ["PATH"]},
        }
        call = f"mount --bind {modules} {MODULES} && exec linuxcnc -r {folder}/isel4030.ini"
        self.process = subprocess.Popen(
            ["unshare", "-m", "sh", "-c", call],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def end(self) -> tuple[int, list[str]]:
        """Exit code, and what the session has said."""
        said, _ = self.process.communicate(timeout=2 * LIMIT_S)
        told = [line.removeprefix("session: ") for line in said.splitlines() if line.startswith("session: ")]
        assert told, said
        return self.process.returncode, told

    @property
    def state(self) -> dict[str, Any]:
        return dict(json.loads(isel_twin("ctl", self.served.info["control"], "state").stdout))


@pytest.fixture
def session(serve: Any, tmp_path: Path, modules: Path, only_one: None) -> Iterator[Any]:
    started: list[Session] = []

    def start(mdi: str, changed: dict[str, str] | None = None) -> Session:
        machine = near_switches(tmp_path, 8.0)
        call = ("--controller", "external", "--machine", str(machine), "--seed", "5", "--tcp", "127.0.0.1:0")
        served = serve(*call, "--control", "127.0.0.1:0", "--set", "controller.watchdog_ms=0", plant="mujoco")
        started.append(Session(served, modules, changed or {}, mdi))
        return started[-1]

    yield start
    for one in started:
        one.process.terminate()
        one.process.communicate(timeout=LIMIT_S)
        shutil.rmtree(one.folder)


def test_it_homes_runs_a_square_and_the_hood_stops_it(session: Any) -> None:
    """Home is where the switches are, so what it believes is machine coordinates within trip point, hysteresis and
    backlash of the switch (0.5 mm); it loses nothing. Then the hood is forced open in motion."""
    one = session(f"{SQUARE}\nG1 X100")
    control = one.served.info["control"]
    while (seen := one.state)["machine_position_mm"][0] < 40.0:
        assert one.process.poll() is None, one.end()
    assert max(map(abs, seen["lost_steps"])) < 16.0, "half a slip"
    assert isel_twin("ctl", control, "set", "hood=forced").returncode == 0
    code, told = one.end()
    assert code == 3, told
    assert told[0] == "homed"
    believed = [[float(mm) for mm in line.rpartition(": ")[2].split()] for line in told[1:6]]
    corners = [[20, 10, 2], [30, 10, 2], [30, 20, 2], [20, 20, 2], [20, 10, 2]]
    assert believed == [pytest.approx(corner, abs=0.01) for corner in corners]
    assert told[6] == "G1 X100: emergency stop"
    assert one.state["outputs"]["power"] == 0
    assert abs(one.state["machine_position_mm"][1] - 10.0) < 0.5


def test_too_fast_it_notices_nothing_and_the_twin_does(session: Any) -> None:
    one = session("G0 X100", FAST)
    code, told = one.end()
    assert (code, told[-1]) == (0, "done")
    assert float(told[1].split()[2]) == pytest.approx(100.0, abs=0.01)
    seen = one.state
    assert abs(seen["lost_steps"][0]) > 1000.0
    assert seen["machine_position_mm"][0] < 90.0
