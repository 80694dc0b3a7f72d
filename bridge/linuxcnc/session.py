"""LinuxCNC beside a served twin, without a screen: from the INI of a machine, or of the kit.

The INI's hardware is replaced by the twin, its display by retrofit/session.py, in a folder that is made for the
session; the INI's own folder is only read. One LinuxCNC runs on a computer, so sessions wait for each other.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from isel_twin.base.errors import one_line
from isel_twin.base.files import alone, atomic_write, create

MODULES = Path("/usr/lib/linuxcnc/modules")
HEADERS = Path(os.environ.get("ISEL_TWIN_LINUXCNC", "/usr/include/linuxcnc"))
COMPONENT = "isel_twin_rows"
KIT = Path(__file__).parent / "retrofit"
INI = KIT / "isel4030.ini"
JOINTS = 3
CODES = {1: "an error of LinuxCNC", 2: "not in time", 3: "an emergency stop"}  # of retrofit/session.py
TOLD = ("session: ", "rows_by_sampler: ", f"{COMPONENT}: ")  # beginnings of lines of ours in LinuxCNC's log
NOBODY = 65534
GRACE_S = 30.0  # wall time for LinuxCNC to end behind its session
PATIENCE_S = (
    10  # wall time for an answer of LinuxCNC's motion: it may wait for the twin, which may have to load something
)
TEXT_BYTES = 1 << 20  # larger files beside an INI are not copied but linked to
LOG = ".isel-twin.log"  # in the session's folder: all that LinuxCNC prints
_HARDWARE = re.compile(r"\s*(HALFILE|POSTGUI_HALFILE|HALCMD|SHUTDOWN|HALUI|DISPLAY)\s*=", re.IGNORECASE)
_SECTION = re.compile(r"\s*\[(\w+)\]")


class LinuxCncError(ValueError):
    """A session cannot begin; one line that says why and what to do."""


def lacking() -> str:
    """What is missing for a session, in one line; "" if nothing is."""
    return "" if shutil.which("linuxcnc") else "linuxcnc is not installed: apt-get install linuxcnc-uspace"


def lockstep() -> bool:
    """Is the realtime component installed?"""
    return (MODULES / f"{COMPONENT}.so").is_file()


def install() -> Path:
    """Compile the component into LinuxCNC's folder of modules. Raises LinuxCncError."""
    made = MODULES / f"{COMPONENT}.so"
    if lacking():
        raise LinuxCncError(lacking())
    if shutil.which("gcc") is None or not (HEADERS / "hal.h").is_file():
        raise LinuxCncError(f"no gcc, or no headers in {HEADERS}: apt-get install gcc linuxcnc-uspace-dev")
    if not os.access(MODULES, os.W_OK):
        raise LinuxCncError(f"{MODULES}: not writable; call it with sudo")
    flags = ["-O2", "-shared", "-fPIC", "-DRTAPI", "-DUSPACE", "-D__MODULE__", "-D_GNU_SOURCE", f"-I{HEADERS}"]
    source = Path(__file__).parent / f"{COMPONENT}.c"
    done = subprocess.run(["gcc", *flags, source, "-o", made, "-lm"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise LinuxCncError(f"{source.name} is not compiled: {one_line(done.stderr)[:300] or 'gcc says nothing'}")
    return made


def changed(ini: str, hal_files: Sequence[str]) -> str:
    """The text of an INI with the session as its display and these HAL files. Raises LinuxCncError."""
    kept: list[str] = []
    sections: list[str] = []
    joints, unit = "", "mm"
    for line in ini.splitlines():
        if line.startswith("#INCLUDE"):
            raise LinuxCncError(f"{line}: write that file's lines into the INI: hardware in it would be started")
        if found := _SECTION.match(line):
            sections.append(found[1].upper())
        if not (_HARDWARE.match(line) or re.match(r"\s*COMM_TIMEOUT\s*=", line, re.IGNORECASE)):
            kept.append(line)
        if sections[-1:] == ["KINS"] and (value := re.match(r"\s*JOINTS\s*=\s*(\d+)", line, re.IGNORECASE)):
            joints = value[1]
        if sections[-1:] == ["TRAJ"] and (value := re.match(r"\s*LINEAR_UNITS\s*=\s*(\w+)", line, re.IGNORECASE)):
            unit = value[1].lower()
        if found and sections[-1] == "EMCMOT":
            kept.append(f"COMM_TIMEOUT = {PATIENCE_S}")
        if found and sections[-1] == "DISPLAY":
            kept.append("DISPLAY = ./session.py")
        if found and sections[-1] == "HAL":
            kept += [f"HALFILE = {name}" for name in hal_files]
    for name in ("DISPLAY", "HAL", "KINS"):
        if sections.count(name) != 1:
            raise LinuxCncError(f"the INI must have one section [{name}]")
    if joints != str(JOINTS):
        raise LinuxCncError(f"[KINS]JOINTS = {joints or 'nothing'}; allowed: {JOINTS}, the twin's axes")
    if unit not in ("mm", "metric"):
        raise LinuxCncError(f"[TRAJ]LINEAR_UNITS = {unit}; allowed: mm, the twin's")
    return "\n".join(kept) + "\n"


def scale_of(state: Mapping[str, Any]) -> list[int]:
    """Counts per mm of the twin's axes, from a state of the control port. Raises LinuxCncError unless whole."""
    scale = [1.0 / step_mm for step_mm in state["step_mm"][:JOINTS]]
    if any(abs(one - round(one)) > 1e-6 for one in scale):
        raise LinuxCncError(f"{scale} counts per mm; allowed: whole numbers, by axes.all.steps_per_rev")
    return [round(one) for one in scale]


@dataclass(frozen=True)
class Outcome:
    """How a session has ended. code: LinuxCNC's, 0 if all is well; said: lines of the session; log: all of LinuxCNC."""

    code: int
    said: tuple[str, ...]
    log: str


class Session:
    """A running LinuxCNC. Use it as a context, since it must end before another one can begin."""

    command: ClassVar[Sequence[str]] = ("linuxcnc",)

    def __init__(
        self,
        address: str,
        scale: Sequence[int],
        ini: Path = INI,
        mdi: str = "",
        keep: Sequence[str] = (),
        patience_s: float = 120.0,
    ) -> None:
        """address: HOST:PORT of a twin's place of another control, on this computer. scale: counts per machine unit.
        mdi: lines to carry out after homing. keep: HAL files of the INI that are loaded behind the twin's. patience_s:
        wall time of the session. Raises LinuxCncError, OSError."""
        if lacking():
            raise LinuxCncError(lacking())
        self._patience_s = patience_s
        with ExitStack() as stack:
            stack.enter_context(alone(Path(tempfile.gettempdir()) / "isel-twin-linuxcnc.lock"))
            self.folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="isel-twin-linuxcnc-")))
            self._fill(ini, address.rpartition(":")[2], scale, keep)
            log = stack.enter_context(create(self.folder / LOG))
            self.folder.chmod(0o1777)  # for the realtime part, which runs as nobody if root starts it
            self._process = subprocess.Popen(
                [*self.command, "-r", str(self.folder / ini.name)],
                env=self._environment(mdi),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            stack.callback(self._end)
            self._stack = stack.pop_all()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def wait(self) -> Outcome:
        """How it ends. Raises LinuxCncError if it does not."""
        try:
            self._process.wait(self._patience_s + 2 * GRACE_S)
        except subprocess.TimeoutExpired:
            raise LinuxCncError(f"LinuxCNC has not ended {2 * GRACE_S:g} s after its session's time") from None
        log = (self.folder / LOG).read_text("utf-8", "replace")
        said = [line.removeprefix("session: ") for line in log.splitlines() if line.startswith(TOLD)]
        return Outcome(self._process.returncode, tuple(said), log)

    def _fill(self, ini: Path, port: str, scale: Sequence[int], keep: Sequence[str]) -> None:
        hal = "isel4030.hal" if lockstep() else "isel4030_sampler.hal"
        text = changed(ini.read_text(encoding="utf-8", errors="replace"), [hal, *keep])
        for path in ini.parent.iterdir():
            if path.is_file() and path.stat().st_size <= TEXT_BYTES:
                atomic_write(self.folder / path.name, path.read_bytes())
            else:
                (self.folder / path.name).symlink_to(path.resolve())
        atomic_write(self.folder / ini.name, text.encode())
        port_and_scale = {"port=7800": f"port={port}", "scale=320,320,320": f"scale={','.join(map(str, scale))}"}
        for path in (KIT / name for name in (hal, "isel4030_nets.hal", "session.py", "rows_by_sampler.py")):
            text = path.read_text(encoding="utf-8")
            for old, new in port_and_scale.items():
                text = text.replace(old, new)
            atomic_write(self.folder / path.name, text.encode())
            (self.folder / path.name).chmod(0o755)

    def _environment(self, mdi: str) -> Mapping[str, str]:
        own = {
            "DISPLAY": "",
            "HOME": str(self.folder),
            "ISEL_TWIN_MDI": mdi,
            "ISEL_TWIN_PATIENCE_S": f"{self._patience_s:g}",
        }
        if os.geteuid() == 0:  # which LinuxCNC's realtime part refuses to be
            own |= {"RTAPI_UID": str(NOBODY), "RTAPI_FIFO_PATH": str(self.folder / "fifo")}
        return {**os.environ, **own}

    def _end(self) -> None:
        if self.running:
            os.killpg(self._process.pid, signal.SIGTERM)  # its script waits for the display before it heeds a signal
            try:
                self._process.wait(GRACE_S)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(["halrun", "-U"], capture_output=True, check=False, timeout=GRACE_S)
