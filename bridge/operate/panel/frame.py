"""What the panel and its page say to each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

Frame = dict[str, Any]
COME: Mapping[str, Any] = {"come": True}  # instead of a request: a browser has come and wants the present state


class Asked(NamedTuple):
    """What a browser wants; None: it has gone."""

    client: int
    request: Mapping[str, Any] | None
