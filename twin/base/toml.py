"""Values as TOML writes them, each in one line: what hand-made files need, with comments and one table a line.

Writers that are kept (tomli-w, tomlkit) spread a list over many lines or write a table in line without room in it, so
files such as golden runs would lose their form.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: Any) -> str:
    """A number, text, switch, list or (in-line) table. Raises TypeError for what TOML does not have."""
    if isinstance(value, str):  # JSON's form is TOML's, but for 7Fh, which JSON leaves as it is
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return int.__repr__(value)
    if isinstance(value, float):  # nan and inf are TOML's words, too
        return float.__repr__(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(map(toml_line, value, value.values())) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    raise TypeError(f"TOML has no {type(value).__name__}: {value!r}")


def toml_line(key: str, value: Any) -> str:
    """`key = value`."""
    return f"{key if _BARE.fullmatch(key) else toml_value(key)} = {toml_value(value)}"
