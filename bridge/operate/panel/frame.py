"""Data between the panel and its page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

Frame = dict[str, Any]
COME: Mapping[str, Any] = {"come": True}  # instead of a request: a new browser needs the present state


class Asked(NamedTuple):
    """A request of a browser; None: it has gone."""

    client: int
    request: Mapping[str, Any] | None
