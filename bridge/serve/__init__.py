"""A twin behind ports, in real time.

borders.py         protocols between the parts of a served line
server.py          one twin behind some endpoints: the loop
pacing.py          virtual time against wall time
loop.py            sleeping and waking of the loop
keeping.py         the end: recordings are kept in any case
pty.py             endpoint: pseudo terminal
tcp.py             endpoint: raw TCP
gate.py            who may speak on it: no browser
rfc2217.py         RFC 2217 on top of it
endpoints.py       all of them, from options
outbox.py          replies to a host that may be slow
uart.py            reception at the wrong speed
host_settings.py   port settings of hosts
registry.py        list of servers on this computer
log.py             logging that never blocks
wire_log.py        the traffic, message by message
recording.py       recording of a served twin
"""
