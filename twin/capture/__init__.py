"""Captured step and direction signals of a real controller, played on the simulated drives and machine.

    file                        signals                     ticks                     motions
    .vcd .csv  --- reader --->  levels over time  ------->  t_ns, delta  ---------->  a controller that plays them
    .npz       -------------------------------------------->

    wave.py       levels of one signal over time, a capture of several, errors
    mapping.py    which signal is step, direction or enable of an axis
    load.py       the reader for a file name: vcd.py, table.py or firmware_files.py
    ticks.py      edges to ticks, and their timing errors for real drives
    player.py     the controller
    play.py       the stream in a twin, motion by motion

Compiled scanners keep only the wanted edges: 10^7 of them take seconds and some hundred megabytes.
"""
