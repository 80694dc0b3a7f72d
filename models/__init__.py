"""The machines that come with the package, one folder each: its numbers, its MuJoCo model, and where both are from.

`isel_twin.machine` reads them. Their names are here, where asking for them costs nothing.
"""

from __future__ import annotations

if __name__ != "isel_twin.models":
    raise ImportError(f"import isel_twin.models, not {__name__}: the folder models/ of the repository is that package")

from pathlib import Path

__all__ = ["machine_names", "models_folder"]


def models_folder() -> Path:
    """Where the machines that come with the package live."""
    return Path(__file__).parent


def machine_names() -> list[str]:
    """Names of the machines that come with the package, sorted."""
    return sorted(path.parent.name for path in models_folder().glob("*/machine.toml"))
