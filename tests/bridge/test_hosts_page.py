"""What docs/hosts.md tells a stranger to do works."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from isel_twin.cli import main

PAGE = (Path(__file__).parents[2] / "docs" / "hosts.md").read_text()


def test_a_session_from_a_shell_with_nothing_but_python(serving):
    found = re.search(r"python3 -c '\n(.*?)'\n", PAGE, re.DOTALL)
    assert found is not None
    endpoint = TcpEndpoint("127.0.0.1:0")
    serving(endpoint)
    code = "\n".join(line.strip() for line in found[1].splitlines())
    code = code.replace("4000", str(parse_address(endpoint.address)[1]))
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, {})
    assert printed.getvalue() == f"{b'00' + b'0' * 19!r}\n"


def test_a_machine_whose_z_counts_negative_downwards():
    found = re.search(r"printf '(@0ID4.*?)' \| isel-twin run", PAGE)
    assert found is not None
    twin = Twin(plant="kinematic")
    for command in found[1].split(r"\n"):
        if command:
            assert twin.query(command) == "0"
    host = Twin(plant="kinematic", flash=twin.flash)
    assert [host.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    top_mm = host.machine_position_mm[2]
    assert top_mm < 5.0
    move = "@0A0,900,0,900,-3200,5000,0,900"
    assert move in PAGE
    assert host.query(move) == "0"
    assert host.machine_position_mm[2] == pytest.approx(top_mm + 10.0, abs=0.02)
    assert host.query("@0A0,900,0,900,6400,5000,0,900") == "2"  # the upper switch
    assert [host.query(command) for command in ("@07", "@0N7", move)] == ["0", "0", "0"]  # and off it again, downwards


def test_the_sample_job(tmp_path, capsys):
    job = tmp_path / "job.txt"
    job.write_text(re.search(r"( {4}# set up.*?)\n\n", PAGE, re.DOTALL)[1])
    with pytest.raises(SystemExit) as caught:
        main(["run", str(job), "--json", "--plant", "kinematic"])
    *lines, summary = map(json.loads, capsys.readouterr().out.splitlines())
    assert (caught.value.code, [line["reply"] for line in lines]) == (0, ["0", "0", "F0"])
    assert summary["counts"][0] == 16000
    named = set(re.findall(r"`(\w+)`", PAGE))
    told = {"machine", "controller", "plant", "seed", "interrupted"}  # "and what was called"
    assert set(summary) - told - {"summary", "ok"} <= named


def test_modem_lines_of_a_pseudo_terminal_are_refused_as_the_page_says(serve):
    with serve().open() as port:
        for ask in (lambda: port.cts, lambda: port.dsr, lambda: setattr(port, "dtr", True)):
            with pytest.raises(OSError, match="Inappropriate ioctl"):
                ask()
        port.break_condition = True
