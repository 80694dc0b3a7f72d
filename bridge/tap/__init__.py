"""A tap between a real host and a real controller.

tap.py             passes bytes on and records both directions
real_port.py       the controller's side
"""
