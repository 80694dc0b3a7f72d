// The desk of the panel: moves by hand, and the job. Loaded behind panel.js, whose functions it uses.
"use strict";

// ---- moves by hand ---------------------------------------------------------------------------------------------------

const AT_REST = "at rest", STILL_MM_S = 0.05, NEAR_MM = 0.05; // a carriage that rings so near to its counter is at rest
const STEPS_MM = [10, 1, 0.1, 0.01], HELD_MS = 250; // while a key is held it is said so often
const JOG_KEYS = { ArrowLeft: ["x", -1], ArrowRight: ["x", 1], ArrowDown: ["y", -1], ArrowUp: ["y", 1], PageDown: ["z", -1], PageUp: ["z", 1] };
let step_mm = 1, by_keys = false, held = null; // null: continuous; held: {axis, way, beat} of the key that is down

const desk_please = (act) => request({ desk: act }).catch((error) => tell(error.message.replace("desk: ", "")));
const speed_mm_s = () => Number($("jogspeed").value) || about.desk.mm_s[2];

// way: in the sense of the workpiece, Z upwards; controllers may count Z downwards.
function jog(axis, way) {
  const sign = way * about.desk.signs[about.desk.axes.indexOf(axis)];
  if (step_mm !== null) { desk_please({ jog: { axis, mm: sign * step_mm, mm_s: speed_mm_s() } }); return; }
  if (held) return;
  held = { axis, way, beat: setInterval(() => desk_please({ hold: true }), HELD_MS) };
  request({ desk: { jog: { axis, way: sign, mm_s: speed_mm_s() } } }).catch((error) => { let_go(); tell(error.message); });
  for (const button of document.querySelectorAll("#pad [data-axis]")) button.classList.toggle("down", button.dataset.axis === axis && Number(button.dataset.way) === way);
}

function let_go() {
  if (!held) return;
  clearInterval(held.beat);
  held = null;
  desk_please({ stop: true });
  for (const button of document.querySelectorAll("#pad .down")) button.classList.remove("down");
}

function jog_button(axis, way, text, name) {
  return make("button", { "data-axis": axis, "data-way": way, "aria-label": `jog ${name}`, title: name,
    onclick: () => { if (step_mm !== null) jog(axis, way); },
    onpointerdown: () => { if (step_mm === null) jog(axis, way); },
    onpointerup: let_go, onpointerleave: let_go, onpointercancel: let_go, onblur: let_go,
    onkeydown: (event) => { if (step_mm === null && [" ", "Enter"].includes(event.key) && !event.repeat) jog(axis, way); },
    onkeyup: let_go }, text);
}

function build_pad(keys) {
  const x = (way) => jog_button("x", way, way > 0 ? "X+" : "X\u2212", way > 0 ? "X plus" : "X minus");
  const y = (way) => jog_button("y", way, way > 0 ? "Y+" : "Y\u2212", way > 0 ? "Y plus" : "Y minus");
  const z = (way) => jog_button("z", way, way > 0 ? "Z up" : "Z down", way > 0 ? "Z up" : "Z down");
  const gap = () => make("span");
  const stop = make("button", { class: "stop", id: "jogstop", title: "Escape: break off what moves by hand", onclick: () => { let_go(); desk_please({ stop: true }); } }, "Stop");
  return make("div", { id: "pad", role: "group", "aria-label": "jog" },
    gap(), y(1), gap(), gap(), z(1), x(-1), stop, x(1), gap(), keys, gap(), y(-1), gap(), gap(), z(-1));
}

function build_steps() {
  const buttons = [null, ...STEPS_MM].map((mm) => make("button", { "data-step": String(mm), onclick: () => choose(mm) }, mm === null ? "hold" : String(mm)));
  const choose = (mm) => { let_go(); step_mm = mm; for (const button of buttons) mark(button, "aria-pressed", button.dataset.step === String(mm)); };
  choose(step_mm);
  return make("span", { class: "states", role: "group", "aria-label": "step in mm, or as long as the key is held" }, ...buttons);
}

function build_places() {
  const rows = about.desk.axes.map((axis, i) => {
    const work = make("output", { class: "work", "data-work": axis }), counter = make("output", { class: "counter", "data-counter": axis });
    const zero = make("button", { "data-zero": axis, title: `the tool is at ${axis} 0 of the workpiece`, "aria-label": `zero ${axis}`, onclick: () => desk_please({ zero: { [axis]: 0 } }) }, "zero");
    const field = make("input", { type: "number", step: "any", "data-go": axis, "aria-label": `go to ${axis}, mm of the workpiece` });
    field.addEventListener("keydown", (event) => { if (event.key === "Enter") go(); });
    updates.push((now) => { put(work, now.desk.work_mm[i].toFixed(3)); put(counter, (now.counts[i] * about.step_mm[i]).toFixed(3)); });
    return [make("b", { class: axis }, axis), work, counter, zero, field];
  });
  const heads = ["", "workpiece, mm", "counter, mm", "", "go to, mm"].map((text) => make("span", { class: "head" }, text));
  return make("div", { id: "places" }, ...heads, ...rows.flat());
}

function go() {
  const fields = [...document.querySelectorAll("#places input")].filter((field) => field.value !== "");
  if (!fields.length) { tell("no place to go to: fill in at least one axis"); return; }
  desk_please({ go: Object.fromEntries(fields.map((field) => [field.dataset.go, Number(field.value)])), mm_s: speed_mm_s() });
}

function build_override() {
  const key = about.keys.find((one) => one.key === "override" && one.form && one.form.number);
  if (!key) return make("span", { class: "far", id: "override", title: "it moves at the speeds in its commands" }, "no feed override on this controller");
  const { low, high } = key.form.number, shown = make("output");
  const slider = make("input", { type: "range", min: low, max: high, step: 1, "aria-label": "override in percent", onchange: () => please({ key: { override: Number(slider.value) } }) });
  updates.push((now) => {
    put(shown, `${now.keys.override} %`);
    if (document.activeElement !== slider && Number(slider.value) !== now.keys.override) slider.value = now.keys.override;
  });
  return make("label", { class: "far", id: "override", title: key.meaning }, "override", slider, shown);
}

// The machine as it is, whoever moves it: the desk knows its own moves only.
function motion_text(now) {
  const moving = about.axes.flatMap((axis, i) => now.step_hz[i] ? [`${axis} ${Math.round(now.step_hz[i])} steps/s`] : []);
  if (moving.length) return `moving: ${moving.join(", ")}`;
  const drifts = about.axes.flatMap((axis, i) => Math.abs(now.velocity_mm_s[i] || 0) >= STILL_MM_S && Math.abs(now.position_error_mm[i]) >= NEAR_MM ? [`${axis} ${now.velocity_mm_s[i].toFixed(1)} mm/s`] : []);
  if (drifts.length) return `moving without steps: ${drifts.join(", ")}`;
  return now.idle ? AT_REST : `${AT_REST}; the controller is at work`;
}

function build_desk() {
  held = null;
  if (!about.desk) { $("desk").replaceChildren(make("p", {}, "The language of this controller is not known: nothing can be moved by hand.")); return; }
  const [low, high, usual] = about.desk.mm_s;
  const speed = make("input", { type: "number", id: "jogspeed", min: low, max: high, step: "any", value: usual, "aria-label": "speed by hand, mm/s" });
  const keys = make("button", { class: "toggle", id: "bykeys", "aria-pressed": by_keys, title: "arrow keys jog X and Y, page keys Z; Escape stops",
    onclick: () => { by_keys = !by_keys; let_go(); mark(keys, "aria-pressed", by_keys); } }, "Keys");
  const doings = make("p", { id: "doings", role: "status" });
  const all = Object.fromEntries(about.desk.axes.map((axis) => [axis, 0]));
  updates.push((now) => {
    const { doing, waiting, why } = now.desk, seen = motion_text(now);
    put(doings, doing ? `${doing}${waiting ? `, ${waiting} more` : ""}` : [why, why && seen === AT_REST ? "" : seen].filter(Boolean).join("; "));
    mark(doings, "data-state", why ? "failed" : "");
  });
  $("desk").replaceChildren(build_places(),
    make("div", { class: "line" },
      make("button", { id: "home", title: "reference runs of all axes", onclick: () => desk_please({ home: true }) }, "Home"),
      make("button", { id: "zeroall", title: "the tool is at the zero of the workpiece", onclick: () => desk_please({ zero: all }) }, "Zero all"),
      make("button", { id: "go", title: "to the places that are filled in", onclick: go }, "Go"), build_override()),
    build_pad(keys),
    make("div", { class: "line" }, make("label", {}, "mm", build_steps()), make("label", {}, "mm/s", speed)),
    doings);
}

const types = (node) => node instanceof HTMLElement && (node.matches("input:not([type=range]), select, textarea") || node.isContentEditable);
addEventListener("keydown", (event) => {
  if (!about || !about.desk || document.body.inert) return;
  if (event.key === "Escape" && frame.desk.doing) { let_go(); desk_please({ stop: true }); }
  const key = JOG_KEYS[event.key];
  if (!key || !by_keys || types(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  if (!event.repeat) jog(...key);
});
addEventListener("keyup", (event) => { if (held && JOG_KEYS[event.key]) let_go(); });
addEventListener("blur", let_go);

// ---- the job ---------------------------------------------------------------------------------------------------------

const LONGEST = 500000, LINES = 20000; // characters of a file, lines of it that are shown
const STATES = { ready: "ready", running: "running", pausing: "pausing", paused: "paused", done: "all lines accepted", failed: "failed", stopped: "stopped" };
let opened = 0, chosen = null; // the file that was chosen last: a refused one may be opened with another zero

$("file").addEventListener("change", async (event) => {
  const file = event.target.files[0];
  event.target.value = "";
  if (!file) return;
  if (file.size > LONGEST) { tell(`${file.name}: is longer than ${LONGEST / 1000} kB; isel-twin run takes it`); return; }
  const data = await file.arrayBuffer();
  let text;
  try { text = new TextDecoder("utf-8", { fatal: true }).decode(data); } catch { text = new TextDecoder("latin1").decode(data); }
  chosen = { name: file.name, text };
  $("fit").disabled = false;
  open_job({});
});
const open_job = (more) => request({ job: { open: { ...chosen, ...more } } }).catch((error) => tell(error.message));
$("fit").addEventListener("click", () => open_job({ zero: "fit" }));
const job_please = (act) => request({ job: { [act]: true } }).catch((error) => tell(error.message));
$("start").addEventListener("click", () => job_please("start"));
$("hold").addEventListener("click", () => job_please(frame.job.state === "paused" ? "go_on" : "pause"));
$("single").addEventListener("click", () => job_please("line"));
$("halt").addEventListener("click", () => job_please("stop"));
for (const name of ["from", "to"]) $(name).addEventListener("change", choose_part);

// A new beginning behind the end that was asked for before goes to the end of the file.
function choose_part(event) {
  const from_line = Number($("from").value) || null, end = Number($("to").value) || null;
  const to_line = event.target === $("from") && end < from_line ? null : end;
  request({ job: { part: { from_line, to_line } } }).then(show_part, (error) => { tell(error.message); show_part(frame.job); });
}

function show_part({ from_line, to_line }) {
  $("from").value = from_line > 1 ? from_line : "";
  $("to").value = to_line || "";
}

function build_job() {
  opened = 0;
  $("program").replaceChildren();
  $("hold").title = about.desk && about.desk.pauses === "now" ? "the motion is held, and gone on with" : "at the end of this line: this controller cannot hold a motion over its line";
  updates.push((now) => {
    const job = now.job;
    const moves = job.state === "running" || job.state === "pausing", paused = job.state === "paused";
    $("start").disabled = !job.state || moves || paused;
    $("single").disabled = !job.state || moves;
    $("hold").disabled = job.state !== "running" && !paused;
    $("halt").disabled = !moves && !paused;
    put($("hold"), paused ? "Go on" : "Pause");
    for (const name of ["from", "to"]) $(name).disabled = !job.format || moves || paused;
    if (!job.state) return;
    if (![$("from"), $("to")].includes(document.activeElement)) show_part(job);
    if (job.opened !== opened) {
      opened = job.opened;
      request({ job: { text: true } }).then((told) => show_program(told.text), () => {});
    }
    put($("jobbed"), moves || paused ? `${Math.floor(100 * job.made / job.commands)} %` : "");
    const format = job.format ? ` (${job.format})` : "", times = job.state === "ready" ? "" : `, ${job.seconds.toFixed(1)} s`;
    put($("doing"), `${job.name}${format}: ${STATES[job.state]}, ${job.made} of ${job.commands} commands${times}${job.not_made ? `, ${job.not_made} not made` : ""}${job.why ? `: ${job.why}` : ""}`);
    $("doing").dataset.state = job.state;
    put($("cautions"), job.cautions.map((said) => `caution: ${said}`).join("\n"));
    const at = $("program").children[job.line - 1], before = $("program").querySelector("[aria-current]");
    if (job.state === "ready" || before === at) return;
    if (before) before.removeAttribute("aria-current");
    if (at) { at.setAttribute("aria-current", "step"); at.scrollIntoView({ block: "nearest" }); }
  });
}

function show_program(text) {
  const lines = text.replace(/\r\n?/g, "\n").replace(/\n$/, "").split("\n");
  $("program").replaceChildren(...lines.slice(0, LINES).map((line) => make("li", {}, line)));
}
