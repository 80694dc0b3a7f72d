"""The first start on a new installation: compiled code is there before the first byte is answered."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.bridge.conftest import Served, ask
from tests.forked import run, start_anew

pytestmark = pytest.mark.long(seconds=10)

SESSION = ("@07", "@0d5000,5000,5000", "@0R7", "@0A 3200,10000,320,10000,0,30,0,30")


@pytest.mark.slow
def test_it_is_compiled_before_it_listens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says so, keeps what it has compiled, and the second start has nothing to compile and nothing to say. That this
    is all that any session calls is shown in tests/test_warm.py. A job compiles as well, if only what is not there."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_OPT", "1")  # compiles in two thirds of the time
    compiled = []
    for told in (True, False):
        served = Served(("--plant", "kinematic", "--speed", "max"), start=start_anew)
        compiled.append({path.name for path in tmp_path.rglob("*.nbc")})
        with served.open() as port:
            assert [ask(port, command) for command in SESSION] == ["0"] * len(SESSION)
        assert served.stop(signal.SIGTERM) == 0
        _, log = served.process.communicate()
        assert ("compiling the physics" in log) == ("compiled in " in log) == told
        assert {path.name for path in tmp_path.rglob("*.nbc")} == compiled[0]
    assert compiled[0] == compiled[1] != set()
    for path in tmp_path.rglob("time_law._fill_ramp-*"):
        path.unlink()
    for told in (True, False):
        done = run(
            "run", "-", "--plant", "kinematic", "--steps", tmp_path / "steps.npz", input="@07\n@0R7\n", start=start_anew
        )
        assert done.returncode == 0
        assert ("compiling the physics (once per installation) ...\n" in done.stderr) == told
        assert done.stderr.startswith("isel-twin: compil") == told
        assert ("isel-twin: compiled in " in done.stderr) == told
    assert {path.name for path in tmp_path.rglob("*.nbc")} == compiled[0]
