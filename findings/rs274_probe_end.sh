#!/usr/bin/env bash
# rs274, LinuxCNC's interpreter alone, ends a probe that meets nothing 0.254 mm before its target, at a contact of its own.
#
# Guess: nothing is there to be touched, so `G38.2 Z-5` goes to Z-5 and ends with an error ("finished without making
#        contact"), or the program goes on from Z-5.
# Seen:  the next move begins at Z-4.746, a hundredth of an inch above, in mm and in inch; no error, and exit code 0. The
#        list of moves that it prints says -5 all the same.
# Here:  rs274 judges how a twin reads G-code. Behind a probe its moves are beside those of the program, by what looks
#        like a fault of units, so programs with G38 are no material for such a judge.
# With:  linuxcnc-uspace 2.9.0~pre1+git20230208.f1270d6ed7-1+deb12u2 (Debian 12), 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download -qq -o APT::Sandbox::User=root linuxcnc-uspace=2.9.0~pre1+git20230208.f1270d6ed7-1+deb12u2 \
  libboost-python1.74.0=1.74.0+ds1-21 || exit 3
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH="$PWD/root/usr/lib:$PWD/root/usr/lib/x86_64-linux-gnu"
ldd root/usr/bin/rs274 | grep "not found" && exit 3

printf '5161\t0.0\n' > fresh.var
printf 'T1 P1 Z0 D3\n' > tools.tbl
printf 'G21 G90 F100\nG0 X0 Y0 Z10\nG38.2 Z-5\nG1 X5\nM2\n' > probe.ngc
root/usr/bin/rs274 -t tools.tbl -v fresh.var -g probe.ngc | grep -E "STRAIGHT_(PROBE|FEED)" | tee moves.txt
grep -q "STRAIGHT_PROBE(0.0000, 0.0000, -5.0000" moves.txt && grep -q "STRAIGHT_FEED(5.0000, 0.0000, -4.7460" moves.txt
