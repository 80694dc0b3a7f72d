#!/usr/bin/env bash
# pstoedit's G-code is 0.08 % larger than the drawing.
#
# Guess: PostScript counts 72 points an inch, so a line of 720 points is 10 inches long in G20.
# Seen:  1/72 is written as 0.0139, of which its remark says `=1/72`; by that the line is 10.008 inches, 0.2 mm too long.
# Here:  all parts are wrong in the same proportion, so no part looks wrong alone. A twin that makes what the file says
#        makes it too large, and a comparison with the drawing must allow for that.
# With:  pstoedit 3.78-2 (Debian 12) with Ghostscript 10, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download -qq -o APT::Sandbox::User=root pstoedit=3.78-2 libpstoedit0c2a=3.78-2 || exit 3
for package in *.deb; do dpkg -x "$package" root; done
libraries=$(dirname "$PWD"/root/usr/lib/*/libpstoedit.so.0)
ln -s "$libraries/pstoedit" root/usr/lib/pstoedit     # its drivers are looked for beside the program
export LD_LIBRARY_PATH="$libraries" PATH="$PWD/root/usr/bin:$PATH"
{ command -v gs && ! ldd root/usr/bin/pstoedit | grep "not found"; } > missing.txt || exit 3

printf '%%!PS\n36 72 moveto 756 72 lineto stroke showpage\n' > line.ps
pstoedit -q -f gcode line.ps line.ngc 2> said.txt || { cat said.txt; exit 1; }  # of drivers that it does not need
scale=$(grep -a '^#1003' line.ngc)
echo "$scale"
awk '{ inches = 720 * $3; print "720 points are", inches, "inches"; exit inches != 10.008 }' <<< "$scale"
