"""All that playing a job needs, modules and compiled code: a process that will fork workers imports it first
(base/crew.py), so that it is paid for once."""

from isel_twin.core.warm import warm_up
from isel_twin.jobs import playing, robust
from isel_twin.jobs.checks import job as checks

LOADED = (playing, robust, checks)

for _plant in ("mujoco", "kinematic"):
    warm_up(_plant, tell=lambda _: None)
