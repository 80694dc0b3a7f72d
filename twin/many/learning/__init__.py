"""What a recorded session tells of the machine at the other end of the line.

session.py   a recording for replay: where the machine stood at power-on, replays on candidates
causes.py    what may be other than in the twin: settings of the flash, play, switches, firmware
explain.py   which of these make the twin answer as the recording does
learn.py     what can be told from a recording alone
"""
