"""Files of CAM programs that somebody gives to a controller as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.jobs.foreign import kind_of
from tests.in_process import isel_twin
from tests.smoke.test_every_command import JOBS

FILES = {
    "NCP": "; a part\nIMF_PBL_V1.0\nN000010 FASTVEL 50000\nN000020 FASTABS Z5000\nMOVEABS X1000 Y-2000\nPROGEND\n",
    "G-code": "%\n(a part)\nG21 G90\nN10 G0 X0 Y0 Z5\nG1 Z-1.5 F300\nG2 X10 Y0 I5 J0\nM30\n%\n",
    "HPGL": "IN;SP1;\nPU0,0;\nPD400,0;\nPD400,400;\nPU;\n",
}


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize("controller", ["imc-s8", "c142", "ismif", "gmi99"])
def test_it_is_one_line_that_says_what_it_is(kind: str, controller: str, tmp_path: Path) -> None:
    file = tmp_path / "part.txt"
    file.write_text(FILES[kind])
    done = isel_twin("run", file, "--controller", controller, "--machine", JOBS[controller][0])
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"isel-twin: {file}: is {kind}, which {controller} does not understand: ")
    assert done.stderr.count("\n") == 1
    assert ("programs by DIN 66025 run on bwo900" in done.stderr) == (kind == "G-code")


@pytest.mark.parametrize(
    "job", [*(job for _, job in JOBS.values()), "Q7;1\nG53\nf2000\nM5000\n81h 9000\n", "", "# nothing\n"]
)
def test_a_job_is_none_of_them(job: str) -> None:
    assert kind_of(job.replace("N10 G1 F300 G91 X10\nN20 M30\n", "")) == ""


def test_one_command_among_them_makes_it_a_job() -> None:
    assert kind_of(FILES["G-code"] + "@0A100,900,0,30,0,30,0,30\n") == ""
