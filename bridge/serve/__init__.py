"""A twin behind ports, in real time.

borders.py         what the parts of a served line need of each other
server.py          one twin behind some endpoints: the loop
pacing.py          virtual time against wall time
loop.py            how the loop sleeps and is woken
keeping.py         how it ends: what was recorded is kept, whatever happens
pty.py             endpoint: pseudo terminal
tcp.py             endpoint: raw TCP
rfc2217.py         what RFC 2217 adds to it
endpoints.py       all of them, as a command names them
outbox.py          replies to a host that may be slow
uart.py            what a port at the wrong speed hears
host_settings.py   how hosts have set their ports
registry.py        what is served on this computer now
log.py             what a server says, without ever waiting for a reader
wire_log.py        the traffic, message by message
recording.py       what is served, recorded as it goes
"""
