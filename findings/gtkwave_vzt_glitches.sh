#!/usr/bin/env bash
# GTKWave's converters keep pulses without width, halve them or drop them, by the format.
#
# Guess: a dump may say that a wire rises and falls at one time (a glitch, IEEE 1364), and its binary forms keep that or
#        tell that they do not: FST, LXT2 and VZT hold what the dump holds.
# Seen:  ten such pulses are ten in FST, five in LXT2 and none in VZT, whose wire never moves. No message, exit code 0.
# Here:  a simulator with a coarse time unit writes such pulses of a step signal. `isel-twin drive` takes the dump itself,
#        and counts each of them.
# With:  gtkwave 3.3.118-0.1~deb12u1 of Debian 12, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download --quiet=2 gtkwave=3.3.118-0.1~deb12u1 2>&1 || exit 3
dpkg --extract gtkwave_*.deb . || exit 3
export PATH="$PWD/usr/bin:$PATH"

{
  echo '$timescale 1 ns $end'
  echo '$var wire 1 s step $end'
  echo '$enddefinitions $end'
  printf '#0\n$dumpvars\n0s\n$end\n'
  for time in 10 20 30 40 50 60 70 80 90 100; do printf '#%d\n1s\n0s\n' "$time"; done
  echo '#110'
} >glitches.vcd
vcd2fst glitches.vcd glitches.fst >/dev/null
vcd2lxt2 glitches.vcd glitches.lxt2 >/dev/null 2>&1
vcd2vzt glitches.vcd glitches.vzt >/dev/null 2>&1

pulses() { grep --count '^1' || true; }
fst=$(fst2vcd glitches.fst | pulses)
lxt2=$(lxt2vcd glitches.lxt2 2>/dev/null | pulses)
vzt=$(vzt2vcd glitches.vzt 2>/dev/null | pulses)
echo "ten pulses without width: $fst in FST, $lxt2 in LXT2, $vzt in VZT"
[ "$fst $lxt2 $vzt" = "10 5 0" ]
