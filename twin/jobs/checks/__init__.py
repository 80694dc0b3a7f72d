"""Jobs under test: what must hold, what was found, and how others are told of it.

job.py       one job against its bounds: findings
settings.py  bounds of a project: isel-twin.toml
formats.py   findings as JUnit XML, SARIF, JSON and annotations
watched.py   a twin under observation: its commands, and where the machine was meanwhile
asserts.py   assertions about it that explain themselves
"""

from isel_twin.jobs.checks.job import RULES, Bounds, Finding, Report, check_job

__all__ = ["RULES", "Bounds", "Finding", "Report", "check_job"]
