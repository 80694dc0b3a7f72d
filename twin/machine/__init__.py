"""The numbers of a machine."""

from isel_twin.machine.machine import *  # noqa: F403
