"""Imports all modules and compiled code that playing a job needs, before workers are forked (base/crew.py)."""

from isel_twin.core.warm import warm_up
from isel_twin.jobs import playing, robust
from isel_twin.jobs.checks import job as checks

LOADED = (playing, robust, checks)

for _plant in ("mujoco", "kinematic"):
    warm_up(_plant, tell=lambda _: None)
