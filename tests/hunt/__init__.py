"""The hunt: whole-twin runs, each drawn from one seed, and what must hold in all of them whatever is drawn.

    seed --> World        what is switched on, what breaks and heals, how the host behaves, how time is cut    world.py
               |
             live         the host acts on what it sees, people and faults interfere           host.py, play.py
               |            every call of the controller's border and every look is checked    invariants.py
               v
             calm         the faults end, the operator puts everything right and resets: a reference run must succeed
               |
             again        the same actions at the same times, time cut otherwise: the same bits

First safety (whatever happens, nothing wrong is done), then liveness (once it is over, work goes on). A failure is one
line with the command that repeats it: python -m tests.hunt --seed N
"""
