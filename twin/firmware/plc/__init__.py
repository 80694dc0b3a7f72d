"""A programmable logic controller in a controller: a subset of STEP 5, assembled, loaded and run in cycles.

    text --- assembler.py ---> blocks --- image.py ---> bytes that a host loads
                                  |
                  codes.py: one table of instructions, both ways
                                  v
                      processor.py: one pass over the blocks, on copies of the images
                                  ^
    plc.py: cycles in virtual time, start-up blocks, effects at the end of a pass

It does not depend on a particular controller: a card passes its memory, the rights of a program to its flags, and its
built-in function blocks.

The language is general STEP 5: results of logic operations (VKE), AND before OR, edges of timers and counters, two
accumulators of 16 bits. The machine codes are from general knowledge of S5, not checked against a document; assembler
and processor agree with each other.
"""

from isel_twin.firmware.plc.image import ImageError, PlcBlock, PlcProgram
from isel_twin.firmware.plc.memory import PlcMemory, Rights
from isel_twin.firmware.plc.plc import INSTRUCTION_NS, Plc

__all__ = ["INSTRUCTION_NS", "ImageError", "Plc", "PlcBlock", "PlcMemory", "PlcProgram", "Rights"]
