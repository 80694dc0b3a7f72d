"""Jobs under test: bounds, findings and their formats.

job.py       one job against its bounds: findings
settings.py  bounds of a project: isel-twin.toml
formats.py   findings as JUnit XML, SARIF, JSON and annotations
watched.py   a twin under observation: its commands, and the positions meanwhile
asserts.py   assertions with explanations
"""

from isel_twin.jobs.checks.job import RULES, Bounds, Finding, Report, check_job

__all__ = ["RULES", "Bounds", "Finding", "Report", "check_job"]
