"""LinuxCNC as the brain of a twin: what a retrofitter takes home. No Python of ours runs in LinuxCNC.

    isel_twin_rows.c    realtime component: set points to a served twin, switches back, in lockstep
    retrofit/           INI, HAL, tool table and a session without a screen, for an isel 4030

docs/connections.md has the steps.
"""
