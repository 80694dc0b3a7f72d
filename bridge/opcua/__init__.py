"""OPC UA: a server beside a served twin, with the companion specification for machine tools (OPC 40501-1 1.01.1).

nodes.py      the variables, and their values from a state of the control port
server.py     the address space, and its life beside the twin
alerts.py     events when something begins and when it is over
access.py     who may read: anybody on the loopback interface, elsewhere whoever has the password, encrypted
nodesets/     the types, as published by the OPC Foundation under the MIT license (bridge/30)
"""
