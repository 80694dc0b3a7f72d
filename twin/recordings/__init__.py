"""What happened to a twin, written down for other tools, and read back.

    recorder.py   samples of the machine on a grid of virtual time, and every change of a level, input or output
    npz.py        the stream, exactly: t_ns, delta
    mcap.py       the recording: bytes of the line and what the machine did, in one file that grows as it goes
    container.py  its container, written
    recording.py  a twin recorded; runs.py, samples.py: its motions and samples as messages
    reading.py    recordings read back; replay.py, compare.py: what is made of them
    vcd.py        step and direction signals or commands, levels and positions for a waveform viewer
    parquet.py    the samples as a table
    csv.py        the same as text
    write.py      one of these, as the name of the file says, of a twin or of a recording

Everything is written in pieces: an hour of machining needs no more memory than a second. Files appear complete or not
at all (files.py).
"""
