"""Seeded crashes and near misses: does the twin tell of each contact, at its instant, and of no other?

world.py       a fixture, a way of the tool, and when it strikes, by closed forms of upright cylinders and boxes
play.py        the same on both plants
__main__.py    many of them: python -m tests.crashes 1000
"""
