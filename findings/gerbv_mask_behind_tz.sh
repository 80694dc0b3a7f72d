#!/usr/bin/env bash
# gerbv reads the digits of a drill file, where they stand behind TZ or LZ, as if they were not there.
#
# Guess: `METRIC,TZ,000.00` says three digits before and two behind the point: X12500 is 125 mm.
# Seen:  12.5 mm; the hole is ten times too near to the corner, and nothing is said. `METRIC,000.00` without TZ is read
#        as meant.
# Here:  drill files have no point in their numbers, so the header decides by powers of ten. gerbv judges how a twin
#        reads such files; headers of this form it cannot judge, and they are held to what was written instead.
# With:  gerbv 2.9.6-1 (Debian 12), 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download -qq -o APT::Sandbox::User=root gerbv=2.9.6-1 || exit 3
dpkg -x gerbv_*.deb root
export LD_LIBRARY_PATH="$PWD/root/usr/lib/x86_64-linux-gnu:$PWD/root/usr/lib"
ldd root/usr/bin/gerbv | grep "not found" && exit 3

for header in METRIC,000.00 METRIC,TZ,000.00; do
  printf 'M48\n%s\nT1C0.8\n%%\nT1\nX12500Y700\nM30\n' "$header" > board.drl
  root/usr/bin/gerbv -x rs274x -o board.gbr board.drl 2> said.txt
  hole=$(grep D03 board.gbr)                            # millionths of an inch
  echo "$header: $hole $(cat said.txt)"
  echo "$hole" >> holes.txt
done
printf 'G01X4921260Y0275591D03*\nG01X0492126Y0027559D03*\n' | cmp - holes.txt
