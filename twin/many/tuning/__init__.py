"""Tuning: the fastest controller settings for a job, found by trials on the twin and on perturbed machines.

    job, language --> space.py    the parameters, for the whole job or for each move
                      |
                      v
                  study.py        which settings to try next, and all results (Optuna, a database)
                      |  ^         compose.py: move by move
                      v  |
                  judge.py        one setting on the machine and on similar ones: time, margin, first lost step
                      |
                      v
                  result.py       the fastest that holds: new lines of the job, commands that make it permanent
                  front.py        the trade-off of time and margin, as a table and a picture

Everything about a controller comes from its language (`isel_twin.language.RetimesJobs`). Only study.py needs Optuna.
"""

from isel_twin.many.tuning.judge import Judgement
from isel_twin.many.tuning.result import Tuned, confirm
from isel_twin.many.tuning.space import Problem

__all__ = ["Judgement", "Problem", "Tuned", "confirm"]
