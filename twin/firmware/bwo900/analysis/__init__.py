"""From the blocks of a program to blocks of a path: parameters, words, cycles, calls."""
