// Moves that cncjs's gcode-toolpath sees in the G-code of standard input, as JSON. Its feeds it tells nobody.
// GCODE_TOOLPATH is the folder in which npm has installed it.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const imported = createRequire(`${process.env.GCODE_TOOLPATH}/here.js`)("gcode-toolpath");
const Toolpath = imported.default ?? imported;
const moves = [];
const toolpath = new Toolpath({
  addLine: (modal, from, to) => moves.push([modal.motion === "G0" ? "rapid" : "line", to.x, to.y, to.z]),
  addArcCurve: (modal, from, to, centre) =>
    moves.push(["arc", to.x, to.y, to.z, centre.x, centre.y, 2, modal.motion === "G3" ? 1 : -1]),
});
toolpath.loadFromStringSync(readFileSync(0, "utf8"));
console.log(JSON.stringify(moves));
