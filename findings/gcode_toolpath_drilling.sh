#!/usr/bin/env bash
# gcode-toolpath draws a drilling cycle as a rapid from hole to hole, without its first hole.
#
# Guess: G81 at X10 and X20 gives rapids to the holes and feeds down to Z-3 and up again, or is refused.
# Seen:  the line of G81 is left out. X20, to which G81 still applies, is a rapid at the height of before. Nothing goes down.
# Here:  the parser stands behind web senders' previews. What such a preview shows of a drilling program is no check of it;
#        `isel-twin decode` writes the moves of each hole out.
# With:  gcode-toolpath 3.0.0 with gcode-parser 2.2.0 (npm), Node.js 20, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
npm install --silent --no-audit --no-fund gcode-toolpath@3.0.0 gcode-parser@2.2.0 || exit 3

cat > holes.mjs <<'JS'
import imported from "gcode-toolpath";

const Toolpath = imported.default ?? imported;
const moves = [];
const toolpath = new Toolpath({
  addLine: (modal, from, to) => moves.push(`${modal.motion} X${to.x} Y${to.y} Z${to.z}`),
});
toolpath.loadFromStringSync("G21 G90\nG0 X0 Y0 Z5\nG81 X10 Y0 Z-3 R2 F100\nX20\nG80\n");
console.log("gcode-toolpath 3.0.0:", moves.join(", "));
process.exit(moves.join() === "G0 X0 Y0 Z5,G0 X20 Y0 Z5" ? 0 : 1);
JS
node holes.mjs
