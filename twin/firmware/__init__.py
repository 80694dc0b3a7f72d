"""Emulated controllers, one folder each, and what they share.

    activity.py    actions that take time, and their requests
    executor.py    carries activities out, one at a time; keeps the motion in execution and the counters
    flash_image.py flash images in JSON with a checksum

A controller may use both, one or none of them; it must implement `isel_twin.controller.Controller`.
"""
