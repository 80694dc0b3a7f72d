"""Hosts in this process, in virtual time.

virtual_host.py    runs a host program: `isel-twin exec`, the fixture `virtual_host`
virtual_time.py    its virtual time: combines the parts below
turns.py           its threads, served in turn; host_thread.py: one of them
signals.py         Ctrl-C while time passes
host_code.py       tells which lines of code are the host's
stand_ins.py       replacements of real functions (stand_in.py: one of them):
                   clocks.py, locks.py, virtual_serial.py, refusals.py
cpython.py         private parts of CPython, checked

protocol_twin.py   pySerial's twin://, for hosts of one thread, without any of these
in_process.py      what the ports of both have in common
"""
