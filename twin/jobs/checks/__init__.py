"""Jobs under test: bounds, findings and their formats.

rules.py        rules, bounds and findings
job.py          one job against its bounds: findings
incremental.py  the same again after each change of the job, from the last state before it
live.py         a job file while it is written: its project's bounds, its findings, its figures line by line
settings.py     bounds of a project: isel-twin.toml
formats.py      findings as JUnit XML, SARIF, JSON and annotations
watched.py      a twin under observation: its commands, and the positions meanwhile
asserts.py      assertions with explanations
"""

from isel_twin.jobs.checks.job import Report, check_job
from isel_twin.jobs.checks.rules import RULES, Bounds, Finding

__all__ = ["RULES", "Bounds", "Finding", "Report", "check_job"]
