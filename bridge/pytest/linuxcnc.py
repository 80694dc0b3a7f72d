"""The fixture `linuxcnc`: sessions of LinuxCNC that move a served twin."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from isel_twin.bridge.linuxcnc.session import INI, Outcome, Session, scale_of
from isel_twin.bridge.pytest.kept import ServedTwin


class LinuxCnc:
    """Call it for a session from its beginning to its end; `begin` one to do something meanwhile.

    served: the twin, operated by `served.ask`.
    """

    def __init__(self, served: ServedTwin, folder: Path) -> None:
        """folder: from where the names of INI files are seen."""
        self.served = served
        self._folder = folder

    def __call__(
        self, ini: str | Path = INI, mdi: str = "", keep: Sequence[str] = (), timeout_s: float = 120.0
    ) -> Outcome:
        """Home, carry the lines of `mdi` out, end. As `isel-twin linuxcnc`; raises LinuxCncError."""
        with self.begin(ini, mdi, keep, timeout_s) as session:
            return session.wait()

    def begin(
        self, ini: str | Path = INI, mdi: str = "", keep: Sequence[str] = (), timeout_s: float = 120.0
    ) -> Session:
        """A session that goes on while the test does; to be used in a `with`."""
        scale = scale_of(self.served.ask({"state": True}))
        return Session(self.served.address, scale, self._folder / ini, mdi, keep, timeout_s)
