"""The version, in a module of its own: whoever builds, installs or asks for it reads it here, and nothing else."""

from __future__ import annotations

from typing import Final

VERSION: Final = "1.0.0"
