"""Twins as fixtures of pytest.

plugin.py          the fixtures: what every start of pytest imports
kept.py            what is kept of the twins, and told of a failing test
"""
