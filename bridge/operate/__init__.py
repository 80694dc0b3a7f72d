"""Operating a served machine from outside.

control.py         the functions for all operators
control_port.py    for programs, over TCP
panel/             for people, in a browser
token.py           access
"""
