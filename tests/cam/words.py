"""python -m tests.cam.words: every word of job files, through its reader and each writer, as docs/jobwords.md.

The words are those of the readers' own tables. Each is played in a short file with it and in the same file without it:

    refused      the reader, or the writer, ends at the word's line
    told         a caution at its line, or a remark in the job: the change of a tool, a stop
    acts         other commands
    no effect    what it asks for is so in any case, for the reason that NO_EFFECT has

An example is the part of a file around the word. Lines that begin with + are in the file with the word only, with - in
the one without it only.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import wrap

sys.path.append(str(Path(__file__).parents[1]))  # as pytest does

from cam.played import axes_of

from isel_twin.cam.gcode import codes
from isel_twin.cam.gcode.words import LETTERS, NO_AXIS
from isel_twin.cam.hpgl import plot
from isel_twin.cam.ncp import program as ncp
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.controller import offers
from isel_twin.language import WritesToolpaths, create_language

PAGE = Path(__file__).parents[2] / "docs" / "jobwords.md"
WRITERS = ("imc-s8", "ismif", "gmi99", "bwo900")
SERVO = ("gmi99", "bwo900")
LAG_S = 0.025  # of the 4030-servo
MOST = 112  # characters of words and cells in a line of the page
PARTS: Mapping[str, tuple[str, str]] = {  # of a file, before and behind an example
    "gcode": ("G21 G90\nF600\nG1 X10 Y5 Z-1\n", "G1 X20 Y8 Z-2\nX22 Y20\nM30\n"),
    "ncp": ("IMF_PBL_V1.0\nVEL 10000\nMOVEABS X10000 Y5000 Z-1000\n", "MOVEABS X20000 Y8000 Z-2000\nPROGEND\n"),
    "excellon": ("M48\n", "M30\n"),
    "hpgl": ("IN;\nSP1;\nPU400,400;\n", "PD800,400;\nPU;\nSP0;\n"),
}
NAMES = ("coolant", "coolant2", "P3", "A4.1", "M70", "M71", "M72", "M73", "M74", "M75", "M76", "M77")
CONSUMERS = ("WPCLAMP", "PUMP", "LAMP", "POPTION1", "POPTION2")

_CYCLE = "X12 Y6 Z-4 R1"
GCODE: Mapping[str, str] = {
    "G0": "+G0 X15\n-G1 X15",
    "G1": "G0 X12\n+G1 X15\n-X15",
    **{f"G{code}": f"+G{code} X14 Y9 I4\n-G1 X14 Y9" for code in (2, 3)},
    "G4": "+G4 P0.5",
    "G8": "+G8",
    "G10": "+G10 L2 P1 X5",
    "G18": "+G18\nG2 X14 Z-1 I2\nG17",
    "G19": "+G19\nG2 Y9 Z-1 J2\nG17",
    "G17": "G18\n+G17\nG2 X14 Y5 I2\nG17",
    "G20": "+G20\nG1 X0.5 Y0.2\nG21",
    "G21": "G20\n+G21\nG1 X1.5 Y0.2\nG21",
    "G70": "+G70\nG1 X0.5 Y0.2\nG21",
    "G71": "G70\n+G71\nG1 X1.5 Y0.2\nG21",
    "G28": "+G28 X12",
    "G28.1": "+G28.1\nG0 X15\nG28",
    "G30": "+G30 X12",
    "G30.1": "+G30.1\nG0 X15\nG30",
    "G43": "+G43 H4",
    "G49": "G43 H4\n+G49",
    "G52": "+G52 X2",
    "G53": "+G53 G0 X60\n-G0 X60",
    "G54": "G55\n+G54",
    **{f"G{name}": f"+G{name}" for name in ("55", "56", "57", "58", "59", "59.1", "59.2", "59.3")},
    "G61": "+G61",
    "G61.1": "+G61.1",
    "G64": "G61\n+G64",
    **{
        f"G{code}": f"+G{code} {_CYCLE}{rest}\n-G1 X12 Y6\nG80"
        for code, rest in ((73, " Q1"), (81, ""), (82, " P0.5"), (83, " Q1"), (85, ""), (89, " P0.5"))
    },
    "G80": f"G0 Z5\nG99 G81 {_CYCLE}\n+G80\nG98 G81 {_CYCLE}\nG80",
    "G90": "G91\n+G90",
    "G91": "+G91",
    "G90.1": "+G90.1\n+G2 X14 Y9 I14 J5\n-G1 X14 Y9",
    "G91.1": "G90.1\n+G91.1\n+G2 X14 Y5 I2\n-G1 X14 Y5",
    "G92": "+G92 X8",
    "G92.1": "G92 X8\n+G92.1",
    "G92.2": "G92 X8\n+G92.2",
    "G92.3": "G92 X8\nG92.2\n+G92.3",
    "G93": "+G93\n+G1 X12 F30\n-G1 X12\nG94 F600",
    "G94": "G93\n+G94\nG1 X12 F30\nG94 F600",
    "G98": f"G0 Z5\nG99\n+G98\nG81 {_CYCLE}\nG80",
    "G99": f"G0 Z5\n+G99\nG81 {_CYCLE}\nG80",
    "M0": "+M0",
    "M1": "+M1",
    "M2": "+M2",
    "M30": "+M30",
    "M3": "+M3 S12000",
    "M4": "S12000\n+M4\n-M3",
    "M5": "M3 S12000\n+M5",
    "M6": "T1\n+M6",
    "M7": "+M7",
    "M8": "+M8",
    "M9": "M8\n+M9\nM3",
    **{f"M{code}": f"+M{code} P3" for code in (62, 64)},
    **{f"M{code}": f"M{code - 1} P3\n+M{code} P3" for code in (63, 65)},
    **{f"M{code}": f"+M{code} P1" for code in (50, 51, 52, 53)},
    **{f"M{code} (din)": f"+M{code}" for code in range(70, 78)},
    **{f"M-{code} (din)": f"M{code}\n+M-{code}" for code in range(70, 78)},
    "G74 (din)": "+G74 X0",
    "G70 (din)": "+G70\nG1 X0.5 Y0.2\nG21",
    "G71 (din)": "G70\n+G71\nG1 X1.5 Y0.2\nG21",
    "G53 (din)": "+G53\n+G0 X60 Y60 Z-20\n-G0 X60 Y60",
    # letters
    "X": "+G1 X15\n-G1 Y6",
    "Y": "+G1 Y15\n-G1 X11",
    "Z": "+G1 Z-3\n-G1 X11",
    "D": "+G1 X15 D1\n-G1 X15",
    "E": "+G1 X15 E1\n-G1 X15",
    "F": "+G1 X15 F120\n-G1 X15",
    "F of G2": "+G2 X14 Y9 I4 F120\n-G2 X14 Y9 I4",
    "F of G4 (din)": "+G4 F0.5",
    "F of G81": f"+G81 {_CYCLE} F120\n-G81 {_CYCLE}\nG80",
    "H": "T4\n+G43 H4\n-G43",
    "I": "+G3 X20 Y5 I5\n-G1 X20 Y5",
    "J": "+G2 X20 Y5 I5 J2\n-G2 X20 Y5 I5",
    "K": "G18\n+G2 X20 Z-1 I5 K2\n-G2 X20 Z-1 I5\nG17",
    "L of G10": "+G10 L20 P1 X5\n-G10 L2 P1 X5",
    "L of G81": "G91\n+G81 X1 Y1 Z-2 R1 L2\n-G81 X1 Y1 Z-2 R1\nG80\nG90",
    "L": "+G1 X15 L2\n-G1 X15",
    "N": "+N10 G1 X15\n-G1 X15",
    "O": "+O1000",
    "P of G2": "+G2 X14 Y9 I4 P2\n-G2 X14 Y9 I4",
    "P of G4": "+G4 P0.5\n-G4 P0.1",
    "P of G10": "+G10 L2 P2 X5\n-G10 L2 P1 X5",
    "P of G64": "+G64 P0.001\n-G64",
    "P of G81": f"+G81 {_CYCLE} P0.5\n-G81 {_CYCLE}\nG80",
    "P of G82": f"+G82 {_CYCLE} P0.5\n-G82 {_CYCLE} P0.1\nG80",
    "P of G83": f"+G83 {_CYCLE} Q1 P0.5\n-G83 {_CYCLE} Q1\nG80",
    "P of M50": "+M50 P0\n-M50",
    "P of M62": "+M62 P3",
    "P": "+G1 X15 P1\n-G1 X15",
    "Q of G64": "+G64 P0.05 Q0.05\n-G64 P0.05",
    "Q of G81": f"+G81 {_CYCLE} Q1\n-G81 {_CYCLE}\nG80",
    "Q of G83": f"+G83 {_CYCLE} Q1\n-G83 {_CYCLE} Q2\nG80",
    "Q": "+G1 X15 Q1\n-G1 X15",
    "R of G2": "+G2 X14 Y5 R3\n-G2 X14 Y5 R5",
    "R of G10": "+G10 L2 P1 X5 R10\n-G10 L2 P1 X5",
    "R of G81": f"+G81 X12 Y6 Z-4 R2\n-G81 {_CYCLE}\nG80",
    "R": "+G1 X15 R1\n-G1 X15",
    "S": "+M3 S12000\n-M3 S6000",
    "S before M3": "+S12000\nM3",
    "S while it turns": "M3\n+S12000",
    "S over a change of the tool": "+M3 S12000\n-M3 S6000\nT1 M6\nM3",
    "S beyond the spindle's": "+M3 S99000\n-M3 S24000",
    "S of G4": "+G4 S0.5",
    "S of G4 P": "+G4 P0.5 S12000\n-G4 P0.5\nM3",
    "T": "+T1\n-T2\nM6",
    "T without M6": "+T1",
    "a dwell and the end in one line": "M3 S12000\n+G4 P0.5 M30\n-M30",
    "%": "+%",
    "/": "+/G1 X15\n-G1 X15",
    "( )": "+(a remark)",
    "(MSG, )": "+(MSG,hello)",
    ";": "+; a remark",
}
_ARC = "X14000 Y9000 I14000 J5000"
NCP: Mapping[str, str] = {
    "IMF_PBL": "+IMF_PBL another",
    "FASTABS": "+FASTABS X15000\n-MOVEABS X15000",
    "FASTREL": "+FASTREL X5000",
    "MOVEABS": "+MOVEABS X15000",
    "MOVEREL": "+MOVEREL X5000",
    **{word: f"+{word} {_ARC}\n-MOVEABS X14000 Y9000" for word in ("CWABS", "CCWABS")},
    **{word: f"+{word} X4000 Y4000 I4000 J0\n-MOVEREL X4000 Y4000" for word in ("CWREL", "CCWREL")},
    **{
        word: f"+{word} {_ARC} Z-3000 W{sweep}\n-MOVEABS X14000 Y9000"
        for word, sweep in (("CWHLXABS", 90), ("CCWHLXABS", 270))
    },
    "VEL": "+VEL 5000",
    "VEL before an arc": f"+VEL 5000\nCWABS {_ARC}",
    "FASTVEL": "+FASTVEL 5000\nFASTABS X15000",
    "PLANE": "+PLANE XZ\n+CWABS X14000 Z-1000 I12000 K-1000\n-MOVEABS X14000\nPLANE XY",
    "DRILLDEF": "DRILLDEF D3000\n+DRILLDEF D4000\nDRILL X12000",
    **{
        f"DRILLDEF {letter}": f"DRILLDEF C2 P0 S2000 D4000 F1000 O1000 V5000\n+DRILLDEF {letter}{value}\nDRILL X12000"
        for letter, value in zip("CPSDVTLFOR", (1, 100, 3000, 5000, 2000, 500, 6000, 500, 500, 500), strict=True)
    },
    "DRILLDEF I": "DRILLDEF D4000\n+DRILLDEF I100\nDRILL X12000",
    "DRILL": "DRILLDEF D4000\n+DRILL X12000\n-FASTABS X12000",
    "GETTOOL": "+GETTOOL 2",
    "SPINDLE": "+SPINDLE CW RPM12000",
    "SPINDLE CCW": "+SPINDLE CCW RPM12000\n-SPINDLE CW RPM12000",
    "SPINDLE RPM": "+SPINDLE CW RPM12000\n-SPINDLE CW RPM6000",
    "SPINDLE RPM before ON": "+SPINDLE RPM12000\nSPINDLE ON",
    "SPINDLE TIME": "+SPINDLE CW RPM12000 TIME2000\n-SPINDLE CW RPM12000",
    "SPINDLE OFF": "SPINDLE CW RPM12000\n+SPINDLE OFF",
    "COOLANT": "+COOLANT ON",
    "COOLANT2": "+COOLANT2 ON",
    "COOLANT OFF": "COOLANT ON\n+COOLANT OFF\nSPINDLE OFF",
    "COOLANT_OFF": "COOLANT ON\n+COOLANT_OFF\nSPINDLE OFF",
    **{word: f"+{word} ON" for word in CONSUMERS},
    "WAIT": "+WAIT 500",
    "SETPORT": "+SETPORT A4=00000001",
    "SETBIT": "+SETBIT A4.1=1",
    "WPCLEAR": "+WPCLEAR\nFASTABS X15000 Y15000 Z-20000\nWPZERO STANDARD",
    "WPZERO": "WPREG2ACT\n+WPZERO STANDARD",
    "WPREG": "+WPREG2ACT",
    "INCH": "+INCH\nMOVEABS X500\nMETRIC",
    "METRIC": "INCH\n+METRIC\nMOVEABS X1500\nMETRIC",
    "HALT": "+HALT",
    "TYPE": "+TYPE hello",
    "PROGEND": "+PROGEND",
    "REF": "+REF XYZ",
    "LIMIT": "+LIMIT",
    "A": "+MOVEABS X15000 A1\n-MOVEABS X15000",
    "B": "+MOVEABS X15000 B1\n-MOVEABS X15000",
    "C": "+MOVEABS X15000 C1\n-MOVEABS X15000",
    ";": "+; a remark",
    "(": "+(a remark)",
}
HPGL: Mapping[str, str] = {
    "IN": "PD600,400;\n+IN;",
    "DF": "PR;\n+DF;\nPD500,500;\nPA;",
    "PU": "PD500,400;\n+PU600,400;\n-PD600,400;",
    "PD": "+PD600,600;",
    "PA": "PR;\n+PA;\nPD600,600;\nPA;",
    "PR": "+PR;\nPD600,100;\nPA;",
    "AA": "+PD;AA500,400,90;\n-PD;",
    "AR": "+PD;AR100,0,90;\n-PD;",
    "AT": "+PD;AT600,600,800,400;\n-PD;",
    "RT": "+PD;RT200,200,400,0;\n-PD;",
    "CI": "+CI100;",
    **{code: f"+{code}600,600;" for code in ("EA", "RA")},
    **{code: f"+{code}200,200;" for code in ("ER", "RR")},
    **{code: f"+{code}200,0,90;" for code in ("EW", "WG")},
    "IP": "+IP0,0,1000,1000;\n+SC0,500,0,500;\nPA;",
    "SC": "IP0,0,1000,1000;\n+SC0,500,0,500;",
    "SP": "+SP2;",
    "PM": "+PM0;\nPD500,400,500,500;\n+PM2;",
    "EP": "PM0;\nPD500,400,500,500;\nPM2;\n+EP;",
    "FP": "PM0;\nPD500,400,500,500;\nPM2;\n+FP;",
    "RO": "+RO90;",
    "LB": "+LBtext\x03;",
    "IW": "+IW0,0,100,100;",
    **{code: f"+{code}10;" for code in ("VS", "AS", "FS")},
    "PE": "+PE<=?;",
    "a word that is none": "+QQ1;",
}
_UP, _HOME = "G00X12.0\nM15\n", "\nM16\nG05"
_STEPPED = "M25\nX12.0\n{}M01\n{}M02X5.0\n{}M08"
_BODY: Mapping[str, str] = {  # of a drill file, between two holes
    "X": "+X12.0\n-X11.0",
    "Y": "+Y12.0\n-Y11.0",
    "T": "+T2",
    "C": "+T3C1.2\n-T3C1.3",
    "R": "+R2X1.0",
    "A": f"{_UP}+G02X20.0A4.0\n-G01X20.0{_HOME}",
    "I": f"{_UP}+G02X20.0I4.0\n-G01X20.0{_HOME}",
    "J": f"{_UP}+G02Y18.0J4.0\n-G01Y18.0{_HOME}",
    **{letter: f"+X12.0{letter}7\n-X12.0" for letter in "FSBHZ"},
    "N": "+N10X12.0\n-X12.0",
    "G00": "+G00X12.0\n-X12.0\nG05",
    "G01": f"{_UP}+G01X14.0{_HOME}",
    "G02": f"{_UP}+G02X20.0A4.0\n-G01X20.0{_HOME}",
    "G03": f"{_UP}+G03X20.0A4.0\n-G01X20.0{_HOME}",
    "G04": "+G04",
    "G05": "G00X12.0\n+G05",
    "G07": "+G07",
    "G40": "+G40",
    "G41": "+G41",
    "G42": "+G42",
    "G81": "G00X12.0\n+G81",
    "G85": "+X12.0G85X14.0\n-X12.0",
    "G90": "G91\n+G90",
    "G91": "+G91\nX1.0Y1.0\nG90",
    "G93": "+G93X1.0Y1.0",
    "M00": "+M00",
    "M01": "M25\nX12.0\n+M01\n+M02X5.0\nM08",
    "M02": _STEPPED.format("", "+", ""),
    "M06": "+M06",
    "M08": _STEPPED.format("", "", "+"),
    "M09": "+M09",
    **{f"M{code}": f"G00X12.0\n+M{code}\nG01X14.0\nM16\nG05" for code in (14, 15)},
    **{f"M{code}": f"{_UP}+M{code}\nG01X14.0\nM16\nG05" for code in (16, 17)},
    "M18": "+M18",
    "M25": "+M25\nX12.0\n+M01\n+M02X5.0\nM08",
    "M30": "+M30",
    "M45": "+M45,hello",
    "M47": "+M47,hello",
    "M48": "+M48",
    "M71": "M72\n+M71\nX1.0Y1.0\nM71",
    "M72": "+M72\nX1.0Y1.0\nM71",
    "M95": "+M95",
    "M97": "+M97,text",
    "M98": "+M98,text",
    "%": "+%",
    ";": "+; a remark",
    "/": "+/X12.0\n-X12.0",
    "another word": "+Q1",
}
_HOLES = "\nT1C0.8\n%\nT1\nX1.0Y1.0\nX2.0"
EXCELLON: Mapping[str, str] = {
    **{word: f"METRIC,TZ\nT1C0.8\nT2C1.0\n%\nT1\nX10.0Y10.0\n{part}\nX20.0Y15.0" for word, part in _BODY.items()},
    "INCH": f"+INCH,TZ\n-METRIC,TZ{_HOLES}",
    "METRIC": f"+METRIC,TZ\n-INCH,TZ{_HOLES}",
    "LZ": "+METRIC,LZ\n-METRIC,TZ\nT1C0.8\n%\nT1\nX010Y010",
    "TZ": "+METRIC,TZ\n-METRIC,LZ\nT1C0.8\n%\nT1\nX010Y010",
    "000.00": "+METRIC,TZ,0000.00\n-METRIC,TZ,000.000\nT1C0.8\n%\nT1\nX010Y010",
    "ICI": f"METRIC,TZ\n+ICI,ON{_HOLES}",
    "FMAT,1": "METRIC,TZ\n+FMAT,1\nT1C0.8\n%\nT1\nX1.0Y1.0\nM00\nX2.0",
    "FMAT,2": f"METRIC,TZ\n+FMAT,2{_HOLES}",
    "VER": f"METRIC,TZ\n+VER,1{_HOLES}",
    "another setting": f"METRIC,TZ\n+DETECT,ON{_HOLES}",
}
EXAMPLES: dict[str, Mapping[str, str]] = {"gcode": GCODE, "ncp": NCP, "hpgl": HPGL, "excellon": EXCELLON}

_STEPS = "a motion ends at rest by itself"
NO_EFFECT: Mapping[str, Mapping[str, str]] = {
    "gcode": {
        "G8": "radii are read as such",
        "G40": "there is no compensation to be ended",
        **dict.fromkeys(("G15", "G40.1", "G50", "G69"), "what it ends has never begun (cam/36)"),
        **dict.fromkeys(("G61", "G61.1", "G64", "P of G64"), _STEPS),
        "Q of G64": "no moves are left out",
        "G97": "S counts turns a minute",
        **dict.fromkeys(("M48", "M49", "M50", "M51", "M53", "P of M50"), "no override is turned in a job"),
        **dict.fromkeys(("N", "O"), "a number of a line or a program"),
        "/": "left out with block_delete only",
        **dict.fromkeys(("( )", ";"), "a remark"),
    },
    "ncp": {
        **dict.fromkeys(("INITTOOL", "PROGBEGIN"), "a heading"),
        ";": "a remark",
    },
    "excellon": {
        **dict.fromkeys(("N", "%", "M48", "M95"), "a number of a line, or the frame of a header"),
        **dict.fromkeys(("FMAT,2", "VER"), "how the file is read anyway"),
        "G40": "there is no compensation to be ended",
        "M18": "a check of the tip of a tool",
        "/": "left out with block_delete only",
        ";": "a remark",
    },
    "hpgl": dict.fromkeys(sorted(plot.IGNORED), "pens, styles, pages and replies of a plotter (cam/15)"),
}


def words() -> Iterator[tuple[str, str]]:
    """Reader and word of every row: the tables of the readers, and what the examples have beside them."""
    gcode = [
        *(codes.name("G", code) for code in sorted({*codes.G_GROUPS, *codes.G_REFUSED})),
        *(codes.name("M", code) for code in sorted({*codes.M_GROUPS, *codes.M_REFUSED} - set(range(102, 200)))),
        *(letter for letter in sorted({*LETTERS, *NO_AXIS})),
    ]
    of_readers = {
        "gcode": gcode,
        "ncp": [*ncp.STATEMENTS],
        "excellon": [],
        "hpgl": [*sorted({*plot.INSTRUCTIONS, *plot.REFUSED, *plot.IGNORED})],
    }
    for reader, found in of_readers.items():
        yield from ((reader, word) for word in dict.fromkeys((*found, *EXAMPLES[reader])))


def example(reader: str, word: str) -> str:
    """The part of a file in which a word stands; by itself if it has none of its own."""
    if (given := EXAMPLES[reader].get(word)) is not None:
        return given
    if word in NO_AXIS and reader == "gcode":
        return f"+G1 X15 {word}1\n-G1 X15"
    return f"+{word};" if reader == "hpgl" else f"+{word}"


def files(reader: str, word: str) -> tuple[list[str], list[str], list[int]]:
    """The file with the word, the one without it, and the lines of the word."""
    head, tail = PARTS[reader]
    part = example(reader, word).split("\n")
    with_it = [*head.splitlines(), *(line.removeprefix("+") for line in part if line[0] != "-"), *tail.splitlines()]
    without = [*head.splitlines(), *(line.removeprefix("-") for line in part if line[0] != "+"), *tail.splitlines()]
    kept = [line for line in part if line[0] != "-"]
    first = len(head.splitlines()) + 1
    return with_it, without, [first + index for index, line in enumerate(kept) if line[0] == "+"]


def settings_of(writer: str, word: str, named: bool) -> CamSettings:
    """named: outputs and the scale of the spindle are told."""
    numbers: Mapping[str, int] = {}
    if named:
        every = (*NAMES, *CONSUMERS)
        spread = {"imc-s8": lambda index: index % 8, "ismif": lambda _: 12, "gmi99": lambda index: index + 8}
        numbers = {name: spread.get(writer, lambda index: 2 * index + 40)(index) for index, name in enumerate(every)}
    return CamSettings(
        zero=(50.0, 50.0, 20.0),
        zeros={number: (50.0 + number, 50.0, 20.0) for number in range(2, 10)},
        start=(50.0, 50.0, 20.0),
        tool_length_mm={4: 5.0},
        rapid_mm_s=30.0,
        feed_mm_s=10.0,
        dialect="din" if word.endswith("(din)") else "",
        outputs=numbers,
        spindle_max_rpm=24_000.0 if named else 0.0,
    )


def axes(writer: str) -> MachineAxes:
    return dataclasses.replace(axes_of(writer), lag_s=LAG_S if writer in SERVO else 0.0)


def lines_of(reader: str, lines: list[str], writer: str, settings: CamSettings) -> list[Written]:
    """Raises CamError."""
    language = create_language(writer)
    assert offers(language, WritesToolpaths)
    path = reader_named(reader).read([f"{line}\n" for line in lines], settings)
    return list(language.written(path, axes(writer), settings))


def commands(lines: list[Written]) -> list[str]:
    """Without remarks, numbers of blocks (BWO 900), and how they are sent: several in a line (GMI99), in jobs that 01h
    ends (iSMIF)."""
    texts = [part for each in lines if not _is_remark(each) for part in each.text.split(" | ")]
    return [text.split(" ", 1)[1] if text[:1] == "N" else text.removesuffix("<1>") for text in texts]


def remarks(lines: list[Written]) -> list[str]:
    return [each.text for each in lines if _is_remark(each) and each.caution is None]


def _is_remark(line: Written) -> bool:
    return line.text.startswith(("# ", "; "))


def verdict(reader: str, word: str, writer: str, named: bool) -> str:
    """What becomes of a word; "" if nothing does."""
    with_it, without, at = files(reader, word)
    settings = settings_of(writer, word, named)
    before = lines_of(reader, without, writer, settings)
    try:
        lines = lines_of(reader, with_it, writer, settings)
    except CamError as error:
        if error.place is None or error.place.line not in at:
            raise
        return "refused"
    old = {each.caution.text for each in before if each.caution}
    said = [each.caution for each in lines if each.caution and each.caution.text not in old]
    found = []
    if commands(lines) != commands(before):
        found.append("acts")
    if any(caution.place.line in at for caution in said) or remarks(lines) != remarks(before):
        found.append("told")
    return ", ".join(found)


def cell(reader: str, word: str, writer: str) -> str:
    """Of the table; "no effect" is for words that NO_EFFECT gives a reason."""
    named, bare = (verdict(reader, word, writer, named) for named in (True, False))
    if not named:
        named = "no effect"
    return named if bare in (named, "") else f"{named}; unset: {bare}"


def page() -> str:
    """docs/jobwords.md."""
    text = [
        "# Every word of job files",
        "",
        "Written by `python -m tests.cam.words`: files with each word and without it, read and written.",
        "",
        "- **acts**: other commands.",
        "- **told**: a caution at its line, or a remark in the job (a tool to be changed, a stop).",
        "- **unset**: so where [cam] `outputs` does not say which output it is, or nothing says what the spindle makes",
        "  at 10 V (`spindle_max_rpm`, or `[spindle]` of the machine).",
        "- **refused**: an error at its line.",
        "- **no effect**: what it asks for is so in any case.",
        "",
        "Several are told and acts: of another unit, of a wrong sense. M100 to M199 are as M100 and M101.",
    ]
    alike: dict[str, dict[tuple[str, ...], list[str]]] = {}
    for reader, word in words():
        cells = tuple(cell(reader, word, writer) for writer in WRITERS)
        alike.setdefault(reader, {}).setdefault(cells, []).append(f"`{word}`")
    for reader, rows in alike.items():
        text += [
            "",
            f"## {reader_named(reader).title}",
            "",
            f"| words | {' | '.join(WRITERS)} |",
            "|---|---|---|---|---|",
        ]
        for cells, found in rows.items():
            told = " | ".join(cells if len(set(cells)) > 1 else (cells[0], *["same"] * (len(cells) - 1)))
            text += (f"| {line} | {told} |" for line in _wrapped(found, MOST - len(told)))
        text.append("")
        reasons: dict[str, list[str]] = {}
        for word, reason in NO_EFFECT[reader].items():
            reasons.setdefault(reason, []).append(f"`{word}`")
        for reason, found in reasons.items():
            first, *rest = _wrapped([*found, f"no effect: {reason}."], MOST)
            text += [f"- {first}", *(f"  {line}" for line in rest)]
    return "\n".join([*text, ""])


def _wrapped(found: list[str], width: int) -> list[str]:
    """Lines in which no word is parted."""
    whole = " ".join(each.replace(" ", "\0") if each[0] == "`" else each for each in found)
    lines = wrap(whole, width, break_long_words=False, break_on_hyphens=False)
    return [line.replace("\0", " ") for line in lines]


def written() -> dict[tuple[str, str], tuple[str, ...]]:
    """Cells of the page, by reader and word."""
    titles = {reader_named(name).title: name for name in EXAMPLES}
    found: dict[tuple[str, str], tuple[str, ...]] = {}
    reader = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            reader = titles[line.removeprefix("## ")]
        elif line.startswith("| `"):
            named, *cells = line.removeprefix("| ").removesuffix(" |").split(" | ")
            cells = [cells[0] if each == "same" else each for each in cells]
            found |= {(reader, word): tuple(cells) for word in re.findall("`([^`]+)`", named)}
    return found


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
