"""NCP: one row a case, the program and its toolpath in short words, or how the error begins."""

from __future__ import annotations

import dataclasses

import pytest
from conformance.rows import case

from isel_twin.cam.toolpath import CamError
from tests.cam.short import UP, told

SETTINGS = dataclasses.replace(UP, zero=(0.0, 0.0, 0.0), zeros={2: (1.0, 2.0, 3.0)}, strict=False)
ELSEWHERE = dataclasses.replace(SETTINGS, zero=(100.0, 50.0, 20.0), start=(100.0, 50.0, 20.0))


@pytest.mark.parametrize(
    ("program", "verdict"),
    [
        case("ncp-1-1", "IMF_PBL part\nPROGEND", "remark part | end"),
        case(
            "ncp-1-2",
            "IMF_PBL\nVEL 10000\nFASTVEL 5000\nFASTABS X1000 Z2000\nFASTABS Y500\nPROGEND",
            "rapid 1 0 2 F5 | rapid 1 0.5 2 F5 | end",
        ),
        case("ncp-1-3", "IMF_PBL\nVEL 10000\nMOVEABS X1000 Y2000 Z-3000\nPROGEND", "line 1 2 -3 F10 | end"),
        case(
            "ncp-1-4",
            "IMF_PBL\nVEL 10000\nFASTVEL 5000\nFASTREL X1000\nFASTREL X1000\nPROGEND",
            "rapid 1 0 0 F5 | rapid 2 0 0 F5 | end",
        ),
        case(
            "ncp-1-5",
            "IMF_PBL\nVEL 10000\nMOVEREL X1000\nMOVEREL X-3000\nPROGEND",
            "line 1 0 0 F10 | line -2 0 0 F10 | end",
        ),
        case("ncp-1-6", "IMF_PBL\nVEL 10000\nCWABS I5000 J0 X10000 Y0\nPROGEND", "arc 10 0 0 about 5 0 cw F10 | end"),
        case("ncp-1-7", "IMF_PBL\nVEL 10000\nCCWABS I5000 J0 X10000 Y0\nPROGEND", "arc 10 0 0 about 5 0 ccw F10 | end"),
        case(
            "ncp-1-8",
            "IMF_PBL\nVEL 10000\nFASTABS X1000\nCWREL I5000 J0 X10000 Y0\nPROGEND",
            "rapid 1 0 0 | arc 11 0 0 about 6 0 cw F10 | end",
        ),
        case(
            "ncp-1-9",
            "IMF_PBL\nVEL 10000\nFASTABS X1000\nCCWREL I5000 J0 X10000 Y0\nPROGEND",
            "rapid 1 0 0 | arc 11 0 0 about 6 0 ccw F10 | end",
        ),
        case(
            "ncp-1-10",
            "IMF_PBL\nVEL 10000\nCWHLXABS I5000 J0 W540 X10000 Y0 Z-1000\nPROGEND",
            "arc 10 0 -1 about 5 0 cw x2 F10 | end",
        ),
        case(
            "ncp-1-11",
            "IMF_PBL\nVEL 10000\nCCWHLXABS I5000 J0 W1080 Z-1000\nPROGEND",
            "arc 0 0 -1 about 5 0 ccw x3 F10 | end",
        ),
        case(
            "ncp-1-12",
            "IMF_PBL\nVEL 10000\nMOVEABS X1000\nVEL5000\nMOVEABS X2000\nPROGEND",
            "line 1 0 0 F10 | line 2 0 0 F5 | end",
        ),
        case(
            "ncp-1-13",
            "IMF_PBL\nVEL 10000\nFASTABS X1000\nFASTVEL 7000\nFASTABS X2000\nPROGEND",
            "rapid 1 0 0 | rapid 2 0 0 F7 | end",
        ),
        case(
            "ncp-1-14",
            "IMF_PBL\nVEL 10000\nPLANE YZ\nCWABS I5000 J0 Y10000\nPROGEND",
            "arc 0 10 0 about 5 0 YZ cw F10 | end",
        ),
        case(
            "ncp-1-15",
            "IMF_PBL\nVEL 10000\nDRILLDEF D1000 V500\nDRILLDEF S3000\nDRILL X1000\nPROGEND",
            "rapid 0 0 3 | rapid 1 0 3 | line 1 0 -1 F0.5 | rapid 1 0 3 | end",
        ),
        case(
            "ncp-1-16",
            "IMF_PBL\nVEL 10000\nDRILLDEF D1000\nDRILL X1000 Y1000\nPROGEND",
            "rapid 0 0 2 | rapid 1 1 2 | line 1 1 -1 F10 | rapid 1 1 2 | end",
        ),
        case("ncp-1-17", "IMF_PBL\nVEL 10000\nGETTOOL 7\nPROGEND", "tool 7 | end"),
        case("ncp-1-18", "IMF_PBL\nVEL 10000\nINITTOOL\nPROGEND", "end"),
        case(
            "ncp-1-19",
            "IMF_PBL\nVEL 10000\nSPINDLE RPM1000 CCW TIME500\nSPINDLE OFF\nPROGEND",
            "spindle ccw 1000 wait 0.5 | spindle off | end",
        ),
        case("ncp-1-20", "IMF_PBL\nVEL 10000\nCOOLANT ON\nCOOLANT OFF\nPROGEND", "coolant 1 on | coolant 1 off | end"),
        case(
            "ncp-1-21", "IMF_PBL\nVEL 10000\nCOOLANT2 ON\nCOOLANT2 OFF\nPROGEND", "coolant 2 on | coolant 2 off | end"
        ),
        case("ncp-1-22", "IMF_PBL\nVEL 10000\nCOOLANT_OFF\nPROGEND", "caution | coolant 1 off | end"),
        case("ncp-1-23", "IMF_PBL\nVEL 10000\nWAIT 250\nPROGEND", "dwell 0.25 | end"),
        case("ncp-1-24", "IMF_PBL\nVEL 10000\nSETPORT A4=10000001\nPROGEND", "output A4 255=129 | end"),
        case(
            "ncp-1-25",
            "IMF_PBL\nVEL 10000\nSETBIT A4.1=1\nSETBIT A4.8=0\nPROGEND",
            "output A4 1=1 | output A4 128=0 | end",
        ),
        case("ncp-1-26", "IMF_PBL\nVEL 10000\nWPCLEAR\nFASTABS X0\nPROGEND", "rapid 0 50 20 | end"),
        case("ncp-1-27", "IMF_PBL\nVEL 10000\nWPCLEAR\nWPZERO STANDARD\nFASTABS X0\nPROGEND", "rapid 100 50 20 | end"),
        case(
            "ncp-1-28",
            "IMF_PBL\nVEL 10000\nWPREG2ACT\nFASTABS X0\nWPCLEAR\nWPREG 2 ACT\nFASTABS Y0\nPROGEND",
            "rapid 1 50 20 | rapid 1 2 20 | end",
        ),
        case("ncp-1-29", "IMF_PBL\nINCH\nVEL 1000\nMOVEABS X1000\nPROGEND", "caution | line 25.4 0 0 F25.4 | end"),
        case("ncp-1-30", "IMF_PBL\nINCH\nMETRIC\nVEL 1000\nMOVEABS X1000\nPROGEND", "caution | line 1 0 0 F1 | end"),
        case("ncp-1-31", "IMF_PBL\nVEL 10000\nHALT\nPROGEND", "stop | end"),
        case("ncp-1-32", "IMF_PBL\nVEL 10000\nTYPE change; the part\nPROGEND", "remark change; the part | end"),
        case("ncp-1-33", "IMF_PBL\nVEL 10000\nPROGBEGIN\nPROGEND", "end"),
        case("ncp-1-34", "IMF_PBL\nVEL 10000\nPROGEND\nnonsense", "end"),
        case("ncp-1-35", "IMF_PBL\nVEL 10000\nWPCLAMP ON\nPROGEND", "output WPCLAMP 1=1 | end"),
        case("ncp-1-36", "IMF_PBL\nVEL 10000\nPUMP OFF\nPROGEND", "output PUMP 1=0 | end"),
        case("ncp-1-37", "IMF_PBL\nVEL 10000\nLAMP ON\nPROGEND", "output LAMP 1=1 | end"),
        case("ncp-1-38", "IMF_PBL\nVEL 10000\nPOPTION1 ON\nPROGEND", "output POPTION1 1=1 | end"),
        case("ncp-1-39", "IMF_PBL\nVEL 10000\nPOPTION2 ON\nPROGEND", "output POPTION2 1=1 | end"),
        case("ncp-1-40", "IMF_PBL\nVEL 10000\nREF XYZ\nPROGEND", "reference XYZ | end"),
        case("ncp-1-41", "IMF_PBL\nVEL 10000\nLIMIT\nPROGEND", "unknown word 'LIMIT'"),
        case("ncp-2-1", "IMF_PBL\nVEL 10000\nMOVEABS X001000 Y-02000 Z12.5\nPROGEND", "line 1 -2 0.013 F10 | end"),
        case("ncp-2-2", "IMF_PBL\nVEL 10000\nMOVEABS X 1000 Y 2000\nPROGEND", "line 1 2 0 F10 | end"),
        case("ncp-2-3", "IMF_PBL\nMOVEABS X1\nPROGEND", "MOVEABS comes before the first VEL"),
        case("ncp-2-4", "IMF_PBL\nVEL 10000\nMOVEABS\nPROGEND", "MOVEABS: names no axis"),
        case("ncp-2-5", "IMF_PBL\nVEL 10000\nMOVEABS A3600\nPROGEND", "MOVEABS: this machine has no axis A"),
        case(
            "ncp-3-1",
            "IMF_PBL\nVEL 10000\nCCWABS I5000 J0\nCWABS I5000 J0 X0 Y0\nPROGEND",
            "arc 0 0 0 about 5 0 ccw F10 | arc 0 0 0 about 5 0 cw F10 | end",
        ),
        case(
            "ncp-3-2",
            "IMF_PBL\nVEL 10000\nPLANE XZ\nCWABS I5000 K0 X10000\nPROGEND",
            "arc 10 0 0 about 5 0 XZ ccw F10 | end",
        ),
        case(
            "ncp-3-3",
            "IMF_PBL\nVEL 10000\nPLANE XZ\nCWABS I5000 J0 X10000\nPROGEND",
            "arc 10 0 0 about 5 0 XZ ccw F10 | end",
        ),
        case(
            "ncp-3-4",
            "IMF_PBL\nVEL 10000\nPLANE YZ\nCWABS J5000 K0 Y10000\nPROGEND",
            "arc 0 10 0 about 5 0 YZ cw F10 | end",
        ),
        case(
            "ncp-3-5",
            "IMF_PBL\nVEL 10000\nCWABS I5000 J0 X10000 Z-500\nPROGEND",
            "arc 10 0 -0.5 about 5 0 cw F10 | end",
        ),
        case("ncp-3-6", "IMF_PBL\nVEL 10000\nCWABS I5000 J0 X10009\nPROGEND", "arc 10.009 0 0 about 5 0 cw F10 | end"),
        case(
            "ncp-3-7",
            "IMF_PBL\nVEL 10000\nCWABS I5000 J0 X10020\nPROGEND",
            "5.0000 and 5.0200 mm as absolute",
        ),
        case(
            "ncp-3-8",
            "IMF_PBL\nVEL 10000\nFASTABS X20000\nCWABS I5000 J0 X30000\nPROGEND",
            "rapid 20 0 0 | caution | arc 30 0 0 about 25 0 cw F10 | end",
        ),
        case("ncp-3-9", "IMF_PBL\nVEL 10000\nCWHLXABS I5000 J0 W182 X10000\nPROGEND", "CWHLXABS: W182 does not lead"),
        *(
            case(
                "ncp-3-9",
                f"IMF_PBL\nVEL 10000\nCWHLXABS I5000 J0 W{sweep} X10000\nPROGEND",
                "arc 10 0 0 about 5 0 cw F10 | end",
            )
            for sweep in (179, 180, 181)
        ),
        case(
            "ncp-4-1",
            "IMF_PBL\nVEL 10000\nFASTABS Z-1000\nDRILLDEF D1000\nDRILL X1000\nPROGEND",
            "rapid 0 0 -1 | rapid 0 0 2 | rapid 1 0 2 | line 1 0 -1 F10 | rapid 1 0 2 | end",
        ),
        case(
            "ncp-4-2",
            "IMF_PBL\nVEL 10000\nFASTABS Z9000\nDRILLDEF D1000\nDRILL X1000\nPROGEND",
            "rapid 0 0 9 | rapid 1 0 9 | rapid 1 0 2 | line 1 0 -1 F10 | rapid 1 0 2 | end",
        ),
        case(
            "ncp-4-3",
            "IMF_PBL\nVEL 10000\nDRILLDEF P5000 S1000 D2000\nDRILL X1000\nPROGEND",
            "rapid 0 0 6 | rapid 1 0 6 | line 1 0 3 F10 | rapid 1 0 6 | end",
        ),
        case(
            "ncp-4-4",
            "IMF_PBL\nVEL 10000\nDRILLDEF D1000 L9000\nDRILL X1000\nPROGEND",
            "rapid 0 0 2 | rapid 1 0 2 | line 1 0 -1 F10 | rapid 1 0 9 | end",
        ),
        case(
            "ncp-4-5",
            "IMF_PBL\nVEL 10000\nDRILLDEF C2 D1500 F1000 O1000\nDRILL X0\nPROGEND",
            "rapid 0 0 2 | line 0 0 -1 F10 | rapid 0 0 2 | rapid 0 0 -0.75 | line 0 0 -1.5 F10 | rapid 0 0 2 | end",
        ),
        case(
            "ncp-4-6",
            "IMF_PBL\nVEL 10000\nDRILLDEF C3 D1000 T300\nDRILL X0\nPROGEND",
            "rapid 0 0 2 | line 0 0 -1 F10 | dwell 0.3 | rapid 0 0 2 | end",
        ),
        case("ncp-4-7", "IMF_PBL\nVEL 10000\nDRILL X0\nPROGEND", "DRILL: its depth is not known"),
        case(
            "ncp-5-1",
            "IMF_PBL\nVEL 10000\nSPINDLE CW RPM100\nSPINDLE CCW\nPROGEND",
            "spindle cw 100 | spindle ccw | end",
        ),
        case("ncp-5-2", "IMF_PBL\nVEL 10000\nSPINDLE ON CW RPM 9000\nPROGEND", "spindle cw 9000 | end"),
        case("ncp-5-3", "IMF_PBL\nVEL 10000\nGETTOOL -1\nPROGEND", "GETTOOL: -1 is out of range"),
        case("ncp-6-1", "IMF_PBL\nVEL 10000\nWPREG3ACT\nPROGEND", "WPREG: zero 3 is not known"),
        case("ncp-7-1", "N000000 IMF_PBL_V1.0\nN5 VEL 10000\nN3 MOVEABS X1000\nPROGEND", "line 1 0 0 F10 | end"),
        case(
            "ncp-7-2",
            "; first\nIMF_PBL_V1.0\nVEL 10000 ; 10 mm/s\n;N10 MOVEABS X1\nMOVEABS X1000\nPROGEND",
            "line 1 0 0 F10 | end",
        ),
        case("ncp-7-3", "IMF_PBL\nVEL 10000\n(a slip)\nPROGEND", "caution | end"),
        case("ncp-7-4", "VEL 10000\nMOVEABS X1000\nPROGEND", "caution | line 1 0 0 F10 | end"),
        case("ncp-7-5", "IMF_PBL\nVEL 10000\nMOVEABS X1000", "line 1 0 0 F10 | caution | end"),
        case("ncp-7-6", "IMF_PBL\nVEL 10000\nmoveabs x1000\nPROGEND", "caution | line 1 0 0 F10 | end"),
        case("ncp-7-7", "IMF_PBL\nVEL 10000\nFOX 5\nPROGEND", "unknown word 'FOX'"),
        case("ncp-7-8", "IMF_PBL\nVEL 10000\nMOVEABS X1 X2\nPROGEND", "MOVEABS: X is there twice"),
    ],
)
def test_statement(program: str, verdict: str) -> None:
    settings = ELSEWHERE if "WPCLEAR" in program or "WPREG2" in program or "G53" in program else SETTINGS
    if verdict.endswith("end"):
        assert told("ncp", program, settings) == verdict.split(" | ")
    else:
        with pytest.raises(CamError) as caught:
            told("ncp", program, settings)
        assert verdict in str(caught.value)
