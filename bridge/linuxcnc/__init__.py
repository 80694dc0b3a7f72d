"""LinuxCNC as the brain of a twin, and what a retrofitter takes home.

isel_twin_rows.c    realtime component: set points to a served twin, switches back, in lockstep
retrofit/           for an isel 4030: INI, HAL files, tool table, a session without a screen, and the same rows by a
                    sampler, where nothing can be compiled
session.py          all of it started by one call, from anybody's INI

docs/connections.md has the steps.
"""
