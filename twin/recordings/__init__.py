"""Recordings and traces of a twin for other tools, and reading them back.

    recorder.py   samples of the machine on a grid of virtual time, and every change of a level, input or output
    npz.py        the stream, exactly: t_ns, delta
    mcap.py       the recording: bytes of the line and the behaviour of the machine, in one growing file container.py
    writes its container format
    recording.py  records a twin; runs.py, samples.py: its motions and samples as messages
    reading.py    reads recordings; replay.py, compare.py: uses of them
    vcd.py        step and direction signals or commands, levels and positions for a waveform viewer
    parquet.py    the samples as a table
    viewer.py     for viewers of robot data: the machine in 3D, numbers by axis
    places.py     where the carriages of a recorded machine were
    csv.py        the same as text
    write.py      chooses the kind by the file name, for a twin or a recording

All are written in pieces: an hour of machining needs no more memory than a second. Files appear complete or not at all
(base/files.py).
"""
