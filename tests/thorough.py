"""How many of the worlds that are drawn at random a test looks at: `make test` a quarter, `make thorough` all."""

from __future__ import annotations

import math

from hypothesis import settings

ALL = 100
"""Examples of a test that does not say how many, of all."""
PART = 25
"""The same of a part. Each run of a test that is not `derandomize`d draws others."""
FEWEST = 5
"""A part is not smaller, if there are as many."""


def drawn(number: int) -> int:
    """How many of so many worlds the profile of this run looks at."""
    share = settings.default.max_examples / ALL
    return min(number, max(FEWEST, math.ceil(number * share)))
