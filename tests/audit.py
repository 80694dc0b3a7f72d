"""What an installation of today would bring, with every extra, against the public database of advisories: `make audit`.

    pyproject.toml --- uv resolves ---> versions --- pip-audit asks the index ---> advisories, none, or nobody answers

Exit code 1 if there is an advisory, a package that the index does not know beside others that it knows, or if the
requirements contradict each other. Where no index answers, or one without advisories, one line says so and it is 0.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[1]
CONTRADICTION = "No solution found"
OPTIONS = ("--progress-spinner", "off", "--disable-pip", "--no-deps", "--format", "json", "-r")


def verdict(report: dict[str, Any]) -> tuple[int, list[str]]:
    """Exit code and lines for what pip-audit has found."""
    packages = report["dependencies"]
    known = [package for package in packages if "vulns" in package]
    if not known:
        return 0, ["audit: this index has no advisories: nothing was looked up"]
    lines = [
        f"{package['name']} {package['version']}: {one['id']}, mended in {', '.join(one['fix_versions']) or 'none'}"
        for package in known
        for one in package["vulns"]
    ]
    lines += [f"{package['name']}: {package['skip_reason']}" for package in packages if package not in known]
    return (1, lines) if lines else (0, [f"audit: {len(known)} packages, no advisory"])


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "uv", *words], cwd=ROOT, capture_output=True, text=True, check=False)


def unanswered(done: subprocess.CompletedProcess[str]) -> tuple[int, list[str]]:
    """The same where a program has not come to its end."""
    if CONTRADICTION in done.stderr or "No module named" in done.stderr or "unexpected argument" in done.stderr:
        return 1, [done.stderr.strip()]
    return 0, [f"audit: no index answers: nothing was looked up ({' '.join(done.stderr.split()[-12:])})"]


def audited(extras: Sequence[str]) -> tuple[int, list[str]]:
    with TemporaryDirectory() as folder:
        versions = Path(folder) / "requirements.txt"
        chosen = [word for extra in extras for word in ("--extra", extra)]
        done = run("pip", "compile", "--quiet", *chosen, "pyproject.toml", "--output-file", versions)
        if done.returncode:
            return unanswered(done)
        done = run("tool", "run", "--quiet", "pip-audit", *OPTIONS, versions)
    try:
        return verdict(json.loads(done.stdout))
    except ValueError:
        return unanswered(done)


def main() -> int:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    code, lines = audited([extra for extra in project["optional-dependencies"] if extra != "dev"])
    print(*lines, sep="\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
