"""Robot Framework: keywords for a bench with a twin, over its control port.

    Library    isel_twin.bridge.robot.Bench

bench.py has the keywords; `python -m robot.libdoc isel_twin.bridge.robot.Bench list` names them.
"""

from __future__ import annotations

from isel_twin.bridge.robot.bench import Bench

__all__ = ["Bench"]
