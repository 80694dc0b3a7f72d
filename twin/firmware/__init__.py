"""Emulated controllers, one folder each, and what they share.

    activity.py    what takes time: what an activity may ask for
    executor.py    carries activities out, one at a time; keeps the motion in execution and the counters

A controller may use both, one or none of them; the border it must follow is `isel_twin.controller.Controller`.
"""
