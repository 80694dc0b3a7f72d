"""Captured step and direction signals of a real controller, and what drives and machine make of them.

    file                        signals                     ticks                     motions
    .vcd .csv  --- reader --->  levels over time  ------->  t_ns, delta  ---------->  a controller that plays them
    .npz       -------------------------------------------->

    wave.py       levels of one signal over time, a capture of several, what is wrong with a file
    mapping.py    which signal is the step, direction or enable of which axis
    load.py       the reader that the name of a file asks for: vcd.py or table.py
    ticks.py      edges to ticks, and what the drives of a real machine would have had against them
    player.py     the controller
    play.py       the stream in a twin, motion by motion

Files are read by compiled scanners that keep the wanted edges only: 10^7 of them take seconds and some hundred
megabytes.
"""
