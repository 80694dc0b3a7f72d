"""Real time: execution of blocks, set points, moves in HAND, power, outputs."""
