"""Specific cutting forces of materials: Kienzle's law F_t = kc1 b h^(1-m) (h in mm), sharp tools, 0 degrees of rake.

Figures of public tables that agree within the spread given; plastics and wood are of one collection each and no
handbook's. Worn edges take 20 to 50 % more. Each degree of positive rake takes 1 to 1.5 % less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Material:
    """kc1 in N/mm2 at a chip of 1 mm; m: its exponent; spread: standard deviation of kc1, relative."""

    kc1_n_mm2: float
    m: float
    spread: float
    source: str


_TABLES = "public tables of Kienzle's constants"
_HOBBY = "a collection of hobby machines' figures; plausible, no handbook"

MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "aluminium": Material(700.0, 0.25, 0.15, f"wrought 6061, 6082, 7075: 700 to 820; {_TABLES}"),
        "brass": Material(780.0, 0.18, 0.15, f"700 to 780; {_TABLES}"),
        "copper": Material(1000.0, 0.25, 0.15, f"900 to 1100; {_TABLES}"),
        "steel": Material(1700.0, 0.25, 0.15, f"S235 1600, S355 1780; {_TABLES}"),
        "C45": Material(1900.0, 0.26, 0.15, _TABLES),
        "stainless": Material(2100.0, 0.23, 0.15, f"304, 316: 2000 to 2200; {_TABLES}"),
        "cast-iron": Material(1100.0, 0.28, 0.15, f"grey; {_TABLES}"),
        "POM": Material(110.0, 0.25, 0.4, _HOBBY),
        "PMMA": Material(120.0, 0.25, 0.4, _HOBBY),
        "PEEK": Material(350.0, 0.20, 0.4, _HOBBY),
        "MDF": Material(55.0, 0.3, 0.4, _HOBBY),
        "oak": Material(70.0, 0.3, 0.4, _HOBBY),
        "plywood": Material(65.0, 0.3, 0.4, f"birch; {_HOBBY}"),
        "PU-board": Material(4.0, 0.3, 0.4, _HOBBY),
    }
)
