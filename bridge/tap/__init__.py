"""Between a real host and a real controller.

tap.py             passes bytes on, and notes both directions
real_port.py       the controller's side of it
"""
