"""What a release is made of: one version, a README that reads whole on an index, publishing without a token."""

from __future__ import annotations

import io
import os
import re
import tarfile
import tomllib
from pathlib import Path

import yaml

from isel_twin.version import VERSION
from tests.release import LINK, absolute, project_urls, same_bytes

ROOT = Path(__file__).parents[1]
REPOSITORY = "https://code.example.org/acme/isel-twin"


def test_the_version_is_the_same_everywhere() -> None:
    """The newest heading of the changelog, and the citation, with one date."""
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    heading = re.search(r"^## (\d\S*) - (\d{4}-\d\d-\d\d)$", changelog, re.MULTILINE)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert heading is not None
    assert (heading[1], heading[2]) == (VERSION, str(citation["date-released"]))
    assert str(citation["version"]) == VERSION


def test_links_of_the_readme_hold_on_an_index() -> None:
    """Each of them is absolute, into the tree of the tag, and names a file that is there."""
    before = (ROOT / "README.md").read_text(encoding="utf-8")
    after = absolute(before, REPOSITORY, VERSION)
    places = [place.partition("#")[0] for _, place in LINK.findall(before)]
    assert len(places) > 30
    assert [place for place in places if not (ROOT / place).exists()] == []
    assert LINK.findall(after) == []
    assert after.count(f"({REPOSITORY}/blob/v{VERSION}/") == len(places) - 1
    assert f"![The 4030]({REPOSITORY}/raw/v{VERSION}/docs/images/4030.png)" in after


def test_the_urls_are_those_that_an_index_shows() -> None:
    table = tomllib.loads(project_urls(REPOSITORY, VERSION))["project"]["urls"]
    assert table.keys() == {"Homepage", "Documentation", "Repository", "Issues", "Changelog"}
    assert all(url.startswith(REPOSITORY) for url in table.values())


def test_an_archive_is_the_same_whoever_packs_it_and_when(tmp_path: Path) -> None:
    packed = []
    for number in range(2):
        path = tmp_path / f"{number}.tar.gz"
        with tarfile.open(path, "w:gz") as file:
            for name in ("b", "a") if number else ("a", "b"):
                member = tarfile.TarInfo(name)
                member.size, member.mtime, member.uid, member.uname = 1, number, number, f"user{number}"
                file.addfile(member, io.BytesIO(name.encode()))
        os.utime(path, (number, number))
        same_bytes(path, 1_700_000_000)
        packed.append(path.read_bytes())
    assert packed[0] == packed[1]
    with tarfile.open(tmp_path / "0.tar.gz") as file:
        assert [(one.name, one.mtime, one.uid, one.uname) for one in file] == [
            ("a", 1_700_000_000, 0, ""),
            ("b", 1_700_000_000, 0, ""),
        ]


def test_only_the_publishing_job_may_publish() -> None:
    """Trusted publishing: no secret in the file; the job that may ask for an identity builds nothing."""
    text = (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")
    workflow = yaml.safe_load(text)
    assert "secrets." not in text
    assert workflow["permissions"] == {}
    jobs = workflow["jobs"]
    assert {name for name, job in jobs.items() if "id-token" in job["permissions"]} == {"publish"}
    assert jobs["publish"]["environment"] == "pypi"
    assert [step for step in jobs["publish"]["steps"] if "run" in step] == []
    assert jobs["publish"]["needs"] == "try"
    assert jobs["try"]["needs"] == "build"
