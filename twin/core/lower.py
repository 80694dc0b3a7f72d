"""`python -m isel_twin.core.lower FOLDER`: write what this package compiles as far as it is the same on all processors.

Whoever builds a package puts it into `lowered` of it (twin/base/lowered.py), once for each version of Python.
"""

from __future__ import annotations

import sys
from pathlib import Path

from isel_twin.base.lowered import write_to
from isel_twin.core.warm import warm_up_all

if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m isel_twin.core.lower FOLDER")
    write_to(Path(sys.argv[1]))
    warm_up_all()
