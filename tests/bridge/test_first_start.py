"""The first start on a new installation: compiled code is there before the first byte is answered."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.bridge.conftest import Served, ask
from tests.forked import start_anew

SESSION = (
    "@07",
    "@0d5000,5000,5000",
    "@0R7",
    "@0A 3200,10000,320,10000,0,30,0,30",  # a line with ramps and cruise
    "@0A -1,100,0,30,0,30,0,30",  # one tick, without ramps
    "@0y400,1500,119,-141,141,-1,-1",  # a circle
    "@0R7",
)


@pytest.mark.slow
def test_everything_is_compiled_before_it_listens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No compiled function is added to the cache once the address is printed, and the second start adds none."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_OPT", "1")  # compiles in two thirds of the time
    before: set[str] = set()
    for plant in ("kinematic", "mujoco"):
        compiled = []
        for told in (True, False):
            served = Served(("--plant", plant, "--speed", "max"), start=start_anew)
            compiled.append({path.name for path in tmp_path.rglob("*.nbc")})
            with served.open() as port:
                assert [ask(port, command) for command in SESSION] == ["0"] * len(SESSION)
            assert served.stop(signal.SIGTERM) == 0
            _, log = served.process.communicate()
            assert ("compiling the physics" in log) == ("compiled in " in log) == told
            assert {path.name for path in tmp_path.rglob("*.nbc")} == compiled[0]
        assert compiled[0] == compiled[1]
        assert compiled[0] > before
        before = compiled[0]
