"""Twins as fixtures of pytest.

plugin.py          the fixtures, imported at every start of pytest
kept.py            data kept of the twins, and reports of failing tests
"""
