"""`make release REPOSITORY=https://HOST/OWNER/NAME`: source archive and wheel of a commit, the same bytes each time.

    commit --- git archive ---> tree --- addresses ---> pyproject.toml, README.md --- build ---> dist/*.tar.gz
    source archive --- lower, with each Python of 3.11 to 3.14 that is found ---> lowered code --- build ---> dist/*.whl

Where the repository lies is known to whoever releases, and to nobody else (core/11): it becomes the `urls` of the
package, and relative links of README.md become absolute ones into the tree of the version's tag, as a package index
needs them. All times are those of the commit (SOURCE_DATE_EPOCH). Both files are built twice, and must be equal.

`make package` builds what lies in the folder, once, without addresses.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from tests.versions import interpreters

ROOT = Path(__file__).parents[1]
ADDRESS = re.compile(r"https://[a-z0-9.-]+(?::\d+)?/[\w.-]+/[\w.-]+")
LINK = re.compile(r"(!?\[[^\]]*\])\((?![a-z]+:|#)([^)\s]+)\)")


def project_urls(repository: str, version: str) -> str:
    """The table of pyproject.toml."""
    tree = f"{repository}/blob/v{version}"
    urls = {
        "Homepage": repository,
        "Documentation": f"{tree}/docs/index.md",
        "Repository": repository,
        "Issues": f"{repository}/issues",
        "Changelog": f"{tree}/CHANGELOG.md",
    }
    return "\n[project.urls]\n" + "".join(f'{name} = "{url}"\n' for name, url in urls.items())


def absolute(readme: str, repository: str, version: str) -> str:
    """README.md with links and pictures that hold on a package index."""

    def link(found: re.Match[str]) -> str:
        text, place = found.groups()
        kind = "raw" if text.startswith("!") else "blob"
        return f"{text}({repository}/{kind}/v{version}/{place})"

    return LINK.sub(link, readme)


def same_bytes(archive: Path, epoch: int) -> None:
    """Write a .tar.gz anew: members in order of their names, times of the commit, nobody's files."""
    with tarfile.open(archive) as old:
        members = [(member, old.extractfile(member)) for member in sorted(old.getmembers(), key=lambda one: one.name)]
        plain = io.BytesIO()
        with tarfile.open(fileobj=plain, mode="w", format=tarfile.PAX_FORMAT) as new:
            for member, content in members:
                member.mtime, member.uid, member.gid, member.uname, member.gname = epoch, 0, 0, "", ""
                member.mode, member.pax_headers = 0o755 if member.mode & 0o100 or member.isdir() else 0o644, {}
                new.addfile(member, content)
    with archive.open("wb") as file, gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=epoch) as packed:
        packed.write(plain.getvalue())


def lower(source: Path) -> None:
    """Put lowered code (twin/base/lowered.py) into a source tree, for each Python that is found.

    Each has an environment in build/, whose place is in that code as the file of errors that numba can raise.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    for name, python in ((f"python3.{sys.version_info.minor}", Path(sys.executable)), *interpreters()):
        folder, kept = ROOT / "build" / f"lower-{name}", ROOT / "build" / f"lower-{name}-compiled"
        own = folder / "bin" / "python"
        shutil.rmtree(kept, ignore_errors=True)
        for command in (
            (python, "-m", "venv", "--clear", folder),
            (own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", source),
            (own, "-m", "isel_twin.core.lower", source.resolve() / "twin" / "lowered"),
        ):
            print(name, *command[1:], flush=True)
            variables = {**environment, "NUMBA_CACHE_DIR": str(kept), "PYTHONHASHSEED": "0"}
            subprocess.run(command, check=True, env=variables, cwd=ROOT / "build")
    shutil.rmtree(source / "build", ignore_errors=True)


def build(tree: Path, out: Path, epoch: int) -> dict[str, str]:
    """Build the files of a source tree; SHA-256 by name. The wheel is built of the source archive and lowered code."""
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch), "PYTHONHASHSEED": "0"}
    call = [sys.executable, "-m", "build", "--outdir", str(out)]
    subprocess.run([*call, "--sdist", str(tree)], check=True, env=environment, stdout=subprocess.DEVNULL)
    (archive,) = out.glob("*.tar.gz")
    same_bytes(archive, epoch)
    unpacked = out / "unpacked"
    with tarfile.open(archive) as file:
        file.extractall(unpacked, filter="data")
    (source,) = unpacked.iterdir()
    lower(source)
    subprocess.run([*call, "--wheel", str(source)], check=True, env=environment, stdout=subprocess.DEVNULL)
    shutil.rmtree(unpacked)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.iterdir())}


def git(*words: str) -> bytes:
    return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True).stdout


def prepared(tree: Path, repository: str, commit: str) -> None:
    """The commit in a folder, with the addresses in it."""
    with tarfile.open(fileobj=io.BytesIO(git("archive", commit))) as file:
        file.extractall(tree, filter="data")
    found = re.search(r'VERSION: Final = "(.+)"', (tree / "twin/version.py").read_text(encoding="utf-8"))
    assert found is not None
    version = found[1]
    readme, project = tree / "README.md", tree / "pyproject.toml"
    readme.write_text(absolute(readme.read_text(encoding="utf-8"), repository, version), encoding="utf-8")
    head, mark, rest = project.read_text(encoding="utf-8").partition("\n[project.optional-dependencies]\n")
    project.write_text(head + project_urls(repository, version) + mark + rest, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(prog="release", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("repository", help="address of the repository: https://HOST/OWNER/NAME; 'here': none, once")
    parser.add_argument("--commit", default="HEAD", help="what is released")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for both files; emptied before")
    call = parser.parse_args()
    repository = call.repository.rstrip("/")
    if repository == "here":
        shutil.rmtree(call.out, ignore_errors=True)
        build(ROOT, call.out, int(git("show", "-s", "--format=%ct", call.commit)))
        return 0
    if not ADDRESS.fullmatch(repository):
        print(f"release: {call.repository!r} is no address https://HOST/OWNER/NAME; where does the repository lie?")
        return 2
    epoch = int(git("show", "-s", "--format=%ct", call.commit))
    work = ROOT / "build" / "again"
    found = []
    for out in (work / "first", work / "second"):
        shutil.rmtree(out, ignore_errors=True)
        prepared(out / "tree", repository, call.commit)
        found.append(build(out / "tree", out / "dist", epoch))
    if found[0] != found[1]:
        print(f"release: two builds differ: {found[0]}, {found[1]}")
        return 1
    shutil.rmtree(call.out, ignore_errors=True)
    shutil.copytree(work / "first" / "dist", call.out)
    shutil.rmtree(work)
    for name, digest in found[0].items():
        print(f"{digest}  {name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
