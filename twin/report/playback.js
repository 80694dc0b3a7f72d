// A recorded session that plays by itself (playback.py): reads the data of the page, and keeps machine, line and scope
// at one time. All times are seconds of virtual time.
"use strict";

const $ = (id) => document.getElementById(id);
const SPEEDS = [0.01, 0.1, 0.25, 0.5, 1, 2, 5, 10, 20], ROWS = 160, AROUND_S = 0.05; // times real time; lines of the session that are shown; window at a time asked for

function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Index of the last of sorted times that is not after t; -1: all are.
function last_before(times, t) {
  let low = 0, high = times.length;
  while (low < high) { const middle = (low + high) >> 1; times[middle] <= t ? low = middle + 1 : high = middle; }
  return low - 1;
}

// ---- the data --------------------------------------------------------------------------------------------------------

async function read() {
  const packed = Uint8Array.from(atob($("session").textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const starts = [];
  about.sizes.reduce((at, size) => { starts.push(at); return at + size; }, 4 + length);
  const column = (number, order, scale = 1) => unpacked(bytes.subarray(starts[number], starts[number] + about.sizes[number]), order, scale);
  const session = { ...about, end: about.end_ns / 1e9, interval: about.interval_ns / 1e9, times: column(about.times, 2, 1e-9) };
  session.samples = about.samples.map((one) => ({ ...one, values: one.columns.map((number) => column(number, 1)
    .map((value) => value === one.nothing ? NaN : value * one.step)) }));
  if (about.machine) session.places = about.machine.columns.map((number) => column(number, 1, about.machine.step));
  if (about.ticks) session.ticks = { led: about.ticks.led, times: column(about.ticks.times, 2, 1e-9), moved: about.ticks.moved.map((number) => column(number, 0)) };
  return session;
}

// Whole numbers, 7 bits a byte, zigzag, as differences (order 1) or differences of those (order 2), times scale.
function unpacked(bytes, order, scale = 1) {
  let count = 0;
  for (const byte of bytes) count += byte < 128;
  const values = new Float64Array(count);
  let value = 0, weight = 1, at = 0, first = 0, second = 0;
  for (const byte of bytes) {
    value += (byte & 127) * weight;
    if (byte > 127) { weight *= 128; continue; }
    const number = value % 2 ? -(value + 1) / 2 : value / 2;
    first += number; second += first;
    values[at++] = (order === 2 ? second : order === 1 ? first : number) * scale;
    value = 0; weight = 1;
  }
  return values;
}

// ---- the page --------------------------------------------------------------------------------------------------------

let now = 0, playing = false, session = null;
const showing = []; // functions that show the present time

function go_to(t) {
  now = Math.min(Math.max(t, 0), session.end);
  for (const show of showing) show(now);
}

function play(on) {
  playing = on;
  $("play").textContent = on ? "Pause" : "Play";
  if (!on) return;
  if (now >= session.end) go_to(0);
  let before = performance.now();
  const tick = (at) => {
    if (!playing) return;
    go_to(now + Math.max(0, at - before) / 1000 * Number($("speed").value));
    before = at;
    now >= session.end ? play(false) : requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

function build_bar() {
  const slider = make("input", { id: "time", type: "range", min: 0, max: session.end, step: "any", value: 0, "aria-label": "time, s", oninput: () => { play(false); go_to(Number(slider.value)); } });
  const shown = make("output", { id: "now" });
  showing.push((t) => { slider.value = t; shown.textContent = `${t.toFixed(6)} s`; slider.setAttribute("aria-valuetext", `${t.toFixed(3)} s`); });
  return make("div", { class: "bar" },
    make("button", { id: "play", title: "Space", onclick: () => play(!playing) }, "Play"), slider, shown,
    make("label", {}, "speed ", make("select", { id: "speed" }, ...SPEEDS.map((speed) => make("option", { value: speed, selected: speed === 1 }, `× ${speed}`)))));
}

// The lines round the present one: thousands of them would take long to lay out.
function build_lines() {
  const list = make("ol", { id: "lines", tabindex: 0, "aria-label": "serial line and events" });
  const times = session.lines.map(([time_ns]) => time_ns / 1e9), nodes = new Map();
  let first = -1, present = null;
  const fill = (from) => {
    first = from;
    nodes.clear();
    list.replaceChildren(...session.lines.slice(from, from + ROWS).map(([time_ns, who, text, means], i) => {
      const node = make("li", { "data-who": who, onclick: () => { play(false); go_to(time_ns / 1e9); } },
        make("span", { class: "at" }, (time_ns / 1e9).toFixed(3)), make("b", {}, who), make("code", {}, text), make("span", {}, means));
      nodes.set(from + i, node);
      return node;
    }));
  };
  showing.push((t) => {
    const at = last_before(times, t);
    if (first < 0 || !nodes.has(Math.max(at, 0)) || at - first > ROWS * 0.9 || (first > 0 && at - first < ROWS * 0.1)) fill(Math.max(0, Math.min(at - ROWS / 2, times.length - ROWS)));
    if (present === nodes.get(at) && present) return;
    if (present) present.removeAttribute("aria-current");
    present = nodes.get(at) || null;
    if (!present) return;
    present.setAttribute("aria-current", "true");
    const top = present.offsetTop - list.offsetTop;
    if (top < list.scrollTop || top + present.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top - list.clientHeight / 2;
  });
  return list;
}

async function start() {
  try { session = await read(); } catch (error) { $("playback").append(make("p", {}, `This browser cannot read the recording: ${error.message}`)); return; }
  const scope = new Scope(session, (t) => { play(false); go_to(t); });
  $("playback").append(build_bar(), make("div", { class: "upper" }, build_machine(session), build_lines()), scope.node);
  if (session.left_out.length) $("playback").append(make("p", { class: "told" }, `Left out: ${session.left_out.join("; ")}.`));
  showing.push((t) => scope.show(t));
  addEventListener("keydown", (event) => {
    if (event.target.matches("input:not([type=range]), select, textarea, button, summary") || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === " ") { event.preventDefault(); play(!playing); } else scope.key(event);
  });
  const asked = /^#t=([\d.]+)$/.exec(location.hash); // seconds: a panel opens its scope there
  go_to(asked ? Number(asked[1]) : 0);
  if (asked) scope.look_at(now - AROUND_S, now + AROUND_S);
  document.body.dataset.ready = "true";
}

addEventListener("DOMContentLoaded", start);
