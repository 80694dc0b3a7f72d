"""Operating a served machine from outside.

control.py         one set of functions for everybody who operates
control_port.py    for programs, over TCP
panel/             for people, in a browser
token.py           who may
"""
