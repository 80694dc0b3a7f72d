"""Imports all that playing a job needs, the compiled core with it, before workers are forked (base/crew.py)."""

from isel_twin.jobs import playing, robust
from isel_twin.jobs.checks import job as checks
from isel_twin.native import core
from isel_twin.plant import kinematic, mujoco

LOADED = (playing, robust, checks, kinematic, mujoco)

core.load()
