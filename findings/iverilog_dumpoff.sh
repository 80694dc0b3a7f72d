#!/usr/bin/env bash
# Icarus Verilog's $dumpoff may leave a dump that looks as if it had no pause.
#
# Guess: from $dumpoff to $dumpon all signals of a dump are x (IEEE 1364, 18.1.3): a viewer shows where nothing is known.
# Seen:  the signals that changed at the instant of $dumpoff are written once more behind its x, with their levels. Until
#        $dumpon they look known, and what they did meanwhile never happened.
# Here:  a step signal falls, dumping stops, and three pulses are missing between two levels that say 0. So the words
#        $dumpoff and $dumpon make the gap, not the levels.
# With:  iverilog 11.0-1.1+b1 of Debian 12, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download --quiet=2 iverilog=11.0-1.1+b1 2>&1 || exit 3
dpkg --extract iverilog_*.deb . || exit 3
ivl=$PWD/usr/lib/$(uname -m)-linux-gnu/ivl

cat >board.v <<'V'
`timescale 1us/1us
module board;
  reg step;
  initial begin
    $dumpfile("board.vcd");
    $dumpvars(0, step);
    step = 0;
    #10 step = 1;
    #10 step = 0; $dumpoff;
    repeat (3) begin #10 step = 1; #10 step = 0; end
    $dumpon;
    #10 step = 1;
    #10 $finish;
  end
endmodule
V
usr/bin/iverilog -B "$ivl" -o board.vvp board.v
usr/bin/vvp -n -M "$ivl" board.vvp
sed -n '/enddefinitions/,$p' board.vcd
after=$(sed -n '/^\$dumpoff/,/^\$dumpon/p' board.vcd | tr '\n' ' ')
[ "$after" = '$dumpoff x! $end 0! #80 $dumpon ' ]
