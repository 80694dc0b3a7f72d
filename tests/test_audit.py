"""`make audit` fails by advisories, not by an index that has none or does not answer.

Expected: the report of pip-audit (`--format json`): a list of packages, each with `vulns` or with `skip_reason`.
"""

from __future__ import annotations

from subprocess import CompletedProcess

from tests import audit

GOOD = {"name": "mcap", "version": "1.6.0", "vulns": []}
BAD = {
    "name": "websockets",
    "version": "9.0",
    "vulns": [{"id": "PYSEC-2021-95", "fix_versions": ["9.1"], "aliases": [], "description": ""}],
}
SKIPPED = {"name": "rich", "skip_reason": "Dependency not found on PyPI and could not be audited: rich (14.3.4)"}


def test_an_advisory_fails_with_its_remedy() -> None:
    told = "websockets 9.0: PYSEC-2021-95, mended in 9.1"
    assert audit.verdict({"dependencies": [GOOD, BAD]}) == (1, [told])


def test_none_is_good() -> None:
    assert audit.verdict({"dependencies": [GOOD]}) == (0, ["audit: 1 packages, no advisory"])


def test_a_package_that_could_not_be_looked_up_fails_beside_others() -> None:
    code, lines = audit.verdict({"dependencies": [GOOD, SKIPPED]})
    assert (code, lines) == (1, [f"rich: {SKIPPED['skip_reason']}"])


def test_an_index_without_advisories_is_told_in_a_line() -> None:
    assert audit.verdict({"dependencies": [SKIPPED]}) == (
        0, ["audit: this index has no advisories: nothing was looked up"]
    )  # fmt: skip


def test_so_is_one_that_does_not_answer() -> None:
    code, (line,) = audit.unanswered(CompletedProcess([], 2, "", "error: Request failed\n  Caused by: dns error\n"))
    assert (code, "\n" in line) == (0, False)
    assert line.startswith("audit: no index answers: nothing was looked up (")


def test_requirements_that_contradict_each_other_fail() -> None:
    code, lines = audit.unanswered(CompletedProcess([], 1, "", "  x No solution found when resolving dependencies\n"))
    assert (code, len(lines)) == (1, 1)
