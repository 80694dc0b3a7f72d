"""`make release REPOSITORY=https://HOST/OWNER/NAME`: source archive and wheels of a commit, the same bytes each time.

    commit --- git archive ---> tree --- addresses ---> pyproject.toml, README.md --- build ---> dist/*.tar.gz
    source archive --- ziglang, for each machine of wheels/backend.py ---> core --- build ---> dist/*.whl

Where the repository lies is known to whoever releases, and to nobody else (core/11): it becomes the `urls` of the
package, and relative links of README.md become absolute ones into the tree of the version's tag, as a package index
needs them. All times are those of the commit (SOURCE_DATE_EPOCH). All files are built twice, and must be equal.

`make package` builds what lies in the folder for this machine (`here`), `make wheels` for all (`everywhere`), once and
without addresses.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGETS: dict[str, str] = runpy.run_path(str(ROOT / "twin/native/compiling.py"))["TARGETS"]  # needs no installation

ADDRESS = re.compile(r"https://[a-z0-9.-]+(?::\d+)?/[\w.-]+/[\w.-]+")
LIBRARY = re.compile(r"\.(?:so|dylib|dll)$")
KINDS = {  # what the library of a wheel begins with, by its tag
    r".*linux.*_x86_64": rb"\x7fELF\x02\x01.{10}\x03\x00\x3e\x00",
    r".*linux.*_aarch64": rb"\x7fELF\x02\x01.{10}\x03\x00\xb7\x00",
    r"macosx_.*_x86_64": rb"\xcf\xfa\xed\xfe\x07\x00\x00\x01",
    r"macosx_.*_arm64": rb"\xcf\xfa\xed\xfe\x0c\x00\x00\x01",
    r"win_amd64": rb"MZ.*?PE\x00\x00\x64\x86",
}
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


def build(tree: Path, out: Path, epoch: int, targets: Iterable[str]) -> dict[str, str]:
    """Build the files of a source tree; SHA-256 by name. Each wheel is built of the source archive."""
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch), "PYTHONHASHSEED": "0"}
    call = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out)]
    subprocess.run([*call, "--sdist", str(tree)], check=True, env=environment, stdout=subprocess.DEVNULL)
    (archive,) = out.glob("*.tar.gz")
    same_bytes(archive, epoch)
    for target in targets:
        unpacked = out / "unpacked"
        with tarfile.open(archive) as file:
            file.extractall(unpacked, filter="data")
        (source,) = unpacked.iterdir()
        print("building for", target or "this machine", flush=True)
        settings = [f"-Ctarget={target}"] if target else []
        subprocess.run(
            [*call, "--wheel", *settings, str(source)], check=True, env=environment, stdout=subprocess.DEVNULL
        )
        shutil.rmtree(unpacked)
    found = sorted(out.iterdir())
    for path in found:
        look(path)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in found}


def look(path: Path) -> None:
    """Raise AssertionError unless a source archive has C and no library, and a wheel one library of its platform."""
    if path.suffix != ".whl":
        with tarfile.open(path) as file:
            names = file.getnames()
        assert not [name for name in names if LIBRARY.search(name)], f"{path.name}: has a library in it"
        assert [name for name in names if name.endswith("twin/native/core.c")], f"{path.name}: has no core.c"
        return
    with zipfile.ZipFile(path) as wheel:
        libraries = [name for name in wheel.namelist() if LIBRARY.search(name)]
        assert len(libraries) == 1, f"{path.name}: has {libraries or 'no library'}"
        head = wheel.read(libraries[0])
    tag = path.stem.rpartition("-")[2]
    begins = {begin for word, begin in KINDS.items() if re.fullmatch(word, tag)}
    assert [begin for begin in begins if re.match(begin, head, re.DOTALL)], f"{path.name}: its library is not for {tag}"


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
    parser.add_argument("repository", help="its address: https://HOST/OWNER/NAME; or here, everywhere")
    parser.add_argument("--commit", default="HEAD", help="what is released")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for both files; emptied before")
    call = parser.parse_args()
    repository = call.repository.rstrip("/")
    if repository in ("here", "everywhere"):
        shutil.rmtree(call.out, ignore_errors=True)
        epoch = int(git("show", "-s", "--format=%ct", call.commit))
        build(ROOT, call.out, epoch, [""] if repository == "here" else TARGETS)
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
        found.append(build(out / "tree", out / "dist", epoch, TARGETS))
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
