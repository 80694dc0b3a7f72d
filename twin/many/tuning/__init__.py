"""Settings of a controller for a job: found by trial on the twin, judged on its bad days, brought back to it.

    job, language --> space.py    what can be set, for the whole job or for each move
                      |
                      v
                  study.py        which settings are tried next, and what became of all that were (Optuna, a database)
                      |  ^         compose.py: move by move
                      v  |
                  judge.py        one setting on the machine and on others of its kind: time, margin, first lost step
                      |
                      v
                  result.py       the fastest that holds: the job's new lines, the commands that make it permanent
                  front.py        what else could be had: time against margin, as a table and a picture

Everything about a controller comes from its language (`isel_twin.language.RetimesJobs`). Only study.py needs Optuna.
"""

from isel_twin.many.tuning.judge import Judgement
from isel_twin.many.tuning.result import Tuned, confirm
from isel_twin.many.tuning.space import Problem

__all__ = ["Judgement", "Problem", "Tuned", "confirm"]
