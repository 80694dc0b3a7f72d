"""Where hosts connect: everything that knows a wall clock, a socket or a device.

pacing.py          virtual time against wall time
server.py          one twin behind some endpoints: the loop of `isel-twin serve`
keeping.py         how it ends: what was recorded is kept, whatever happens
log.py             what it says meanwhile, without ever waiting for a reader
wire_log.py        and the traffic, message by message
pty.py             endpoint: pseudo terminal
tcp.py             endpoint: raw TCP
rfc2217.py         what RFC 2217 adds to it
endpoints.py       all of them, as a command names them
registry.py        which of them are served on this computer now
uart.py            what a port at the wrong speed hears

control.py         operating the machine from outside: one set of functions
control_port.py    for programs, over TCP
panel/             and for people, in a browser
recording.py       what is served, recorded as it goes

tap.py             between a real host and a real controller
real_port.py       the real controller's side of it

virtual_host.py    a host program in this process, in virtual time
virtual_time.py    what that is: turns.py, stand_in.py, stand_ins.py, virtual_serial.py

no_modem_lines.py  what ports in process have in common
protocol_twin.py   pySerial's twin://, in process, without any of the above but pacing
pytest_plugin.py   twins as fixtures of pytest: what every start of pytest imports
pytest_kept.py     and what it does once a test uses one
demo.py            `make demo`
"""

if __name__ != "isel_twin.bridge":
    raise ImportError(f"import isel_twin.bridge, not {__name__}: the folder bridge/ of the repository is that package")
