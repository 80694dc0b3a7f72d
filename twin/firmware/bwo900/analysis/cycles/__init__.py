"""Cycles: what one block with G69 to G89 comes to, as moves in program coordinates.

    block with G81 ... --- call.Call ---> drilling.py, pattern.py, milling.py --- call.Move, ... ---> the interpreter

A cycle knows parameters, position, plane and tool, and nothing of frames, feeds of the path or the machine: the
interpreter carries its moves out as if they stood in the program.
"""
