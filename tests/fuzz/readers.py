"""Every reader of files that somebody else may have made: a sample that it reads, and how it is asked."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from isel_twin import Twin
from isel_twin.base.parameters import Place, read_toml
from isel_twin.cam.reader import text_lines
from isel_twin.cam.registry import reader_for, reader_named
from isel_twin.cam.settings import CamSettings, read_cam
from isel_twin.capture.load import load as load_capture
from isel_twin.jobs import golden, project
from isel_twin.jobs.checks import settings
from isel_twin.jobs.job import decode_job, parse_job
from isel_twin.language import create_language
from isel_twin.machine import load_machine
from isel_twin.many.identification.measured import read_measured
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.table import read_rows
from isel_twin.recordings.reading import read
from isel_twin.recordings.replay import rebuilt
from isel_twin.wiring.scenario import load_scenario
from tests.fuzz.kept import KEPT
from tests.fuzz.mutate import in_turn, mutated, restructured, retold
from tests.fuzz.shown import SHOWN
from tests.fuzz.talk import TALK
from tests.fuzz.trial import Reader
from tests.in_process import isel_twin

JOB = "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30  # a move\n! x == 5 +- 0.1 mm\n<0.5s>\n@0P => *\n"
PROGRAM = (
    "P1\nN10 G90 G1 F300 X10 Y5\nN20 G2 X20 Y5 I15 J5 (an arc)\nN30 M28.2\nN40 M30\nP2\nN10 P401:3 X:P401+2\nN20 M02\n"
)
MACHINE = 'based_on = "4030"\n[axes.x]\ntravel = { value = 300.0, unit = "mm", grade = "setting", source = "ours" }\n'
MACHINE += '[[fixture]]\nname = "vise"\nshape = "box"\nsize_mm = [10, 20, 30]\nat_mm = [100, 100, 0]\n'
SCENARIO = '[[event]]\nat = 0.5\nset = { estop = "pressed" }\nfor = 0.2\n[[event]]\nat = 1.0\nforce_n = { x = 50 }\n'
SETTINGS = '[check]\nmargin = 0.2\nset.payload.mass = 8\n[[check.job]]\nmatch = "p*.txt"\ncycle_s = 40.0\n'
SWEEP = '[sweep]\njob = "job.txt"\nplant = "kinematic"\nseeds = 2\n'
SWEEP += '[machine]\n"payload.mass" = { values = [0, 4], unit = "kg" }\n'
MEASURED = """gauge_sigma_mm = 0.005
[[reading]]
recording = "day1"
command = 20
axis = "x"
mm = 0.412
gauge = "push"
push_n = 150.0
[[act]]
recording = "day1"
command = 10
after_s = 0.5
set = { estop = "pressed" }
"""
NCP = "IMF_PBL part\nN5 VEL 9000\nFASTABS X1000 Y2000\nMOVEABS Z-500\nCCWABS I3000 J2000\n"
NCP += "CWHLXABS I2000 J2000 W720 Z-900\nDRILLDEF C2 D3000 F1000 O900\nDRILL X5000\n"
NCP += "SPINDLE CW RPM900 TIME10\nSETPORT A4=00000001\nWAIT 10\nPROGEND\n"
GCODE = "%\n(a part)\nN1 G21 G90 T1 M6\nG0 X1 Y2 Z3 S900 M3\nG1 Z-.5 F300\nG2 X3 I1 J0 P2\nG18 G3 X5 R4\nG17 G92 X0\n"
GCODE += "G98 G83 X9 Z-4 R1 Q2 F90 L2\nX12\nG80\nG10 L2 P2 X5\nG55 G53 G0 Z0\nG93 G1 X5 F3\nG28 Z1\nM30\n%\n"
HPGL = "IN;IP0,0,800,800;SC0,100,0,100;SP1;PU40,40;PD80,40,80,90;AA40,40,90;CI5;ER9,9;EW9,0,90;AT1,1,9,2;"
HPGL += "PM0;PD9,9,1,9;PM1;PM2;EP;LBtext\x03PU;SP0;\n"
HPGL = HPGL.replace(";", ";\n")
DRILL = "M48\n;FILE_FORMAT=3:3\nMETRIC,TZ,000.000\nFMAT,2\nT1C0.8F200S65\nT02C1\n%\nG90\nG05\nT1\nX12500Y7000\nX13.5\n"
DRILL += "R03X500Y-500\nX1000Y1000G85X3000\nM25\nT2\nX5000\nM01\nR2M02X1000Y500\nM08\nG93X0Y0\nG00X100Y100\nM15\n"
DRILL += "G01X900\nG03X900Y700A300\nG02X100I-400J0\nM16\nG05\nM47,words\nM71\nG91\nX-10\nT0\nM30\n"
CAM = 'zero = [1, 2, 3]\nzeros = { 2 = [4, 5, 6] }\nz_sign = 1\ndialect = "din"\ntool_length_mm = { 1 = 32.5 }\n'
CAM += 'drill_format = "mm 3:3 TZ"\ndepth_mm = 1.8\n'
CAM += 'rapid_mm_s = 30.0\nstrict = true\npark = [0, 0, 0]\noutputs = { spindle = 1, "A4.1" = 2 }\n'
CSV = "Time [s],step_x,dir_x\n0.0,0,1\n0.0001,1,1\n0.0002,0,1\n0.0003,1,0\n"
VCD = "$timescale 1 ns $end\n$var wire 1 ! step_x $end\n$var wire 1 # dir_x $end\n$enddefinitions $end\n"
VCD += "#0\n0!\n1#\n#5000\n1!\n#9000\n0!\n"
KLIPPER = "config_stepper oid=4 step_pin=PA1 dir_pin=PA2 invert_step=0\nreset_step_clock oid=4 clock=900\n"
KLIPPER += "set_next_step_dir oid=4 dir=1\nqueue_step oid=4 interval=100 count=9 add=-3\n"
GRBLHAL = "# block number 0\n0.00100 0, 0, 0, 0\n0.00200 4, -2, 0, 0\n0.00300 5, -2, 1, 0\n"


def _text(text: str) -> Callable[[Path], bytes]:
    return lambda _: text.encode()


def _recording(folder: Path) -> bytes:
    (folder / "job.txt").write_text(JOB)
    done = isel_twin("run", folder / "job.txt", "--plant", "kinematic", "--record", folder / "made.mcap")
    assert done.returncode == 0, done
    return (folder / "made.mcap").read_bytes()


def _rebuilt(path: Path) -> None:
    told = read(path)
    told.steps()
    if told.of_twin:
        rebuilt(told, path.parent)


def _steps(_: Path) -> bytes:
    file = io.BytesIO()
    np.savez(file, t_ns=np.array([10, 20], dtype=np.int64), delta=np.ones((2, 4), dtype=np.int8))
    return file.getvalue()


def _steps_reshaped(data: bytes, seed: int) -> bytes:
    """Arrays of other shapes, types and values, also without one of them."""
    draw = Random(seed)
    arrays = dict(np.load(io.BytesIO(data)))
    for _ in range(draw.randint(1, 3)):
        name = draw.choice(sorted(arrays))
        one = arrays[name]
        match draw.randrange(6):
            case 0:
                arrays[name] = one.astype(draw.choice(("float64", "uint8", "bool", "U3", "int64")))
            case 1:
                arrays[name] = one.reshape(draw.choice(((-1,), (1, -1), (-1, 1), (1, 1, -1))))
            case 2:
                arrays[name] = np.repeat(one, draw.choice((0, 2, 1000)), axis=0)
            case 3:
                arrays[draw.choice(("t_ns", "delta", "x"))] = one
            case 4 if len(arrays) > 1:
                del arrays[name]
            case _ if one.size and one.dtype.kind in "iuf":
                one = one.copy()
                one.flat[draw.randrange(one.size)] = draw.choice((0, -1, 127, 1))
                arrays[name] = one[::-1] if draw.random() < 0.3 else one
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _golden(folder: Path) -> bytes:
    (folder / "job.txt").write_text(JOB)
    done = isel_twin("golden", "record", folder / "job.txt", "--plant", "kinematic")
    assert done.returncode == 0, done
    return golden.golden_file(folder / "job.txt").read_bytes()


def _swept(folder: Path) -> bytes:
    (folder / "job.txt").write_text(JOB)
    (folder / "plan.toml").write_text(SWEEP)
    done = isel_twin("sweep", folder / "plan.toml", "--workers", "1")
    assert done.returncode == 0, done
    return (folder / "plan.parquet").read_bytes()


def _table_reshaped(data: bytes, seed: int) -> bytes:
    """A table of Parquet with other columns or other values."""
    draw = Random(seed)
    table = pq.read_table(io.BytesIO(data))
    for _ in range(draw.randint(1, 3)):
        at, other = draw.randrange(table.num_columns), draw.randrange(table.num_columns)
        match draw.randrange(4):
            case 0 if table.num_columns > 2:
                table = table.remove_column(at)
            case 1:
                table = table.set_column(at, table.column_names[at], table.column(other))
            case 2:
                table = table.append_column(f"x\x1b[2J{table.num_columns}", table.column(other))
            case _:
                table = pa.concat_tables([table] * draw.choice((2, 30)))
    out = io.BytesIO()
    pq.write_table(table, out)
    return out.getvalue()


def _plan(path: Path) -> None:
    (path.parent / "job.txt").write_text(JOB)
    load_plan(path)


def _machine(path: Path) -> None:
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    (folder / "machine.toml").write_bytes(path.read_bytes())
    load_machine(folder)


def _job(controller: str) -> Callable[[Path], object]:
    return lambda path: parse_job(decode_job(path.read_bytes()), create_language(controller), controller)


def _settings(path: Path) -> None:
    settings.load(path)
    project.fixtures(path)


def _cam(name: str) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        reader_for(path.read_bytes().decode("latin-1"), path.suffix)
        with path.open("rb") as file:
            deque(reader_named(name).read(text_lines(file), CamSettings(feed_mm_s=10.0)), maxlen=0)

    return read


def _cam_settings(path: Path) -> None:
    place = Place(path)
    read_cam(read_toml(place), place)


def _captured(path: Path) -> object:
    return load_capture(path)


TOML_CHANGES, NO_TOML = in_turn(mutated, retold, retold, restructured), "not a TOML file"
SETTABLE = Twin(plant="kinematic").settable


READERS: Mapping[str, Reader] = {
    reader.name: reader
    for reader in (
        Reader("recording.mcap", _recording, _rebuilt),
        Reader("capture.csv", _text(CSV), _captured),
        Reader("capture.vcd", _text(VCD), _captured),
        Reader("capture.npz", _steps, _captured, in_turn(mutated, *[_steps_reshaped] * 3), "is no .npz"),
        Reader("capture.dump", _text(KLIPPER), lambda path: load_capture(path, sample_rate_hz=1e6)),
        Reader("capture.out", _text(GRBLHAL), _captured),
        Reader("machine.toml", _text(MACHINE), _machine, TOML_CHANGES, NO_TOML),
        Reader("scenario.toml", _text(SCENARIO), lambda path: load_scenario(path, SETTABLE), TOML_CHANGES, NO_TOML),
        Reader("isel-twin.toml", _text(SETTINGS), _settings, TOML_CHANGES, NO_TOML),
        Reader("plan.toml", _text(SWEEP), _plan, TOML_CHANGES, NO_TOML),
        Reader("measured.toml", _text(MEASURED), read_measured, TOML_CHANGES, NO_TOML),
        Reader("measured.csv", _text("recording,command,axis,mm,gauge\nday1,20,x,0.412,push\n"), read_measured),
        Reader("golden", _golden, golden.load, TOML_CHANGES, NO_TOML),
        Reader("table.parquet", _swept, read_rows, in_turn(mutated, *[_table_reshaped] * 3), "no Parquet"),
        Reader("job-imc.txt", _text(JOB), _job("imc-s8")),
        Reader("job-ismif.txt", _text("L1,X3000<1>\n$H\n"), _job("ismif")),
        Reader("job-gmi99.txt", _text("Q7;1\nf2000\nM5000\n81h 9000\n"), _job("gmi99")),
        Reader("program.nc", _text(PROGRAM), _job("bwo900")),
        Reader("part.ncp", _text(NCP), _cam("ncp")),
        Reader("part.ngc", _text(GCODE), _cam("gcode")),
        Reader("part.plt", _text(HPGL), _cam("hpgl")),
        Reader("part.drl", _text(DRILL), _cam("excellon")),
        Reader("cam.toml", _text(CAM), _cam_settings, TOML_CHANGES, NO_TOML),
        *KEPT,
        *SHOWN,
        *TALK,
    )
}
