"""Cycles: moves in program coordinates from one block with G69 to G89.

    block with G81 ... --- call.Call ---> drilling.py, pattern.py, milling.py --- call.Move, ... ---> the interpreter

A cycle depends on parameters, position, plane and tool, not on frames, feeds of the path or the machine: the
interpreter carries out its moves as if they were in the program.
"""
