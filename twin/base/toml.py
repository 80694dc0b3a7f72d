"""Values in TOML syntax, each on one line, for files that keep the form of hand-written ones.

tomli-w and tomlkit spread a list over many lines or write an in-line table without blanks, so files such as golden runs
would lose their form.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: Any) -> str:
    """A number, text, switch, list or (in-line) table. Raises TypeError for what TOML does not have."""
    if isinstance(value, str):  # JSON's syntax is valid TOML, except that it does not escape 7Fh
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return int.__repr__(value)
    if isinstance(value, float):  # TOML writes nan and inf as Python does
        return float.__repr__(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(map(toml_line, value, value.values())) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    raise TypeError(f"TOML has no {type(value).__name__}: {value!r}")


def toml_line(key: str, value: Any) -> str:
    """`key = value`."""
    return f"{key if _BARE.fullmatch(key) else toml_value(key)} = {toml_value(value)}"
