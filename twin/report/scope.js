// The scope of a recording: steps, levels, states and curves on one time axis; zoom, two cursors, trigger, VCD.
//
//   wheel, + -        zoom about the pointer or the present time      drag, arrow keys    move the window
//   click             go to that time                                 a, b                set a cursor to the present time

const HEIGHT = { steps: 34, bits: 18, words: 18, curves: 66 }, AXIS_PX = 22, PULSE_S = 5e-6, PAUSE_S = 0.05, LEAST_S = 2e-6, MOST_VCD = 2e6;

// Signals: {name, unit, kind, shown} and, by kind, what they have over time, as arrays `times` and `values`.
function signals_of(session) {
  const found = [];
  if (session.ticks) session.axes.forEach((axis, i) => {
    const moved = session.ticks.moved[i], rows = [];
    moved.forEach((step, k) => { if (step) rows.push(k); });
    if (!rows.length) return;
    const times = Float64Array.from(rows, (k) => session.ticks.times[k]), values = Float64Array.from(rows, (k) => moved[k]), sums = new Float64Array(rows.length + 1);
    values.forEach((step, k) => { sums[k + 1] = sums[k] + step; });
    const led = session.ticks.led; // set points, of any number of steps each
    found.push({ name: `${led ? "set points" : "step"} ${axis}`, unit: "steps/s", kind: "steps", led, axis, times, values, sums, shown: true });
    const turns = rows.map((_, k) => k).filter((k) => k === 0 || values[k] < 0 !== values[k - 1] < 0);
    found.push({ name: `dir ${axis}`, unit: "1: minus", kind: "bits", led, axis, times: Float64Array.from(turns, (k) => times[k]), values: turns.map((k) => values[k] < 0 ? 1 : 0), shown: true });
  });
  const wanted = ["position_error_mm", "margin", "force_n", "velocity_mm_s"];
  for (const one of session.samples) found.push({ name: one.name === "margin" ? "least margin" : one.name.replace(/_(mm|n|mm_s|v)$/, "").replaceAll("_", " "), unit: one.unit === "1" ? "" : one.unit, kind: "curves", times: session.times, curves: one.values, axes: one.values.length > 1 ? session.axes : ["path"], shown: wanted.includes(one.name) });
  for (const [name, changes] of Object.entries(session.changes)) {
    const values = changes.map(([, value]) => value), bits = values.every((value) => value === 0 || value === 1);
    found.push({ name, unit: "", kind: bits ? "bits" : "words", times: Float64Array.from(changes, ([time_ns]) => time_ns / 1e9), values, shown: changes.length > 1 && !/^output (current|analog)/.test(name) });
  }
  return found;
}

class Scope {
  constructor(session, go_to) {
    this.session = session; this.go_to = go_to; this.now = 0; this.view = [0, Math.max(session.end, 1e-3)]; this.cursors = { A: null, B: null }; this.signals = signals_of(session);
    this.canvas = make("canvas", { id: "traces", role: "img", tabindex: 0, "aria-label": "signals over time" });
    this.told = make("output", { id: "cursors" });
    this.values = make("p", { class: "unseen", id: "values" });
    this.node = make("section", { id: "scope", "aria-label": "scope" }, this.#tools(), this.told, this.#choice(), this.canvas, this.values);
    this.#pointer();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  // ---- what can be pressed

  #tools() {
    const button = (id, text, title, act) => make("button", { id, title, "aria-label": title, onclick: act }, text);
    const names = [...this.signals.map((signal) => signal.name), "serial line and events"];
    const signal = make("select", { id: "trigger", "aria-label": "trigger on" }, ...names.map((name) => make("option", {}, name)));
    const edge = make("select", { id: "edge", "aria-label": "what of it" }), value = make("input", { id: "level", "aria-label": "value", size: 8 });
    const choose = () => {
      const kind = (this.signals[signal.selectedIndex] || { kind: "lines" }).kind;
      edge.replaceChildren(...{ steps: ["begins", "any step", "turns round"], bits: ["rises", "falls", "changes"], words: ["changes", "becomes"], curves: ["goes above", "goes below"], lines: ["has the text"] }[kind].map((name) => make("option", {}, name)));
      value.hidden = kind === "steps" || kind === "bits";
      value.placeholder = kind === "curves" ? "value" : "text";
    };
    signal.addEventListener("change", choose);
    choose();
    const find = (way) => this.#find(this.signals[signal.selectedIndex], edge.value, value.value, way);
    return make("div", { class: "tools" },
      button("nearer", "+", "zoom in", () => this.zoom(0.5)), button("farther", "−", "zoom out", () => this.zoom(2)), button("all", "All", "the whole session", () => this.look_at(0, this.session.end)),
      button("cursor-a", "A", "set cursor A to the present time", () => this.set("A")), button("cursor-b", "B", "set cursor B to the present time", () => this.set("B")),
      make("span", { class: "group" }, make("span", { class: "head" }, "trigger"), signal, edge, value, button("previous", "◀", "the time before at which it happens", () => find(-1)), button("next", "▶", "the next time at which it happens", () => find(1))),
      button("vcd", "Save VCD", "what is shown, from cursor A to B or of this window, for waveform viewers", () => this.save()));
  }

  #choice() {
    const boxes = this.signals.map((signal) => make("label", {}, make("input", { type: "checkbox", checked: signal.shown, onchange: (event) => { signal.shown = event.target.checked; this.draw(); } }), signal.name));
    return make("details", { id: "choice" }, make("summary", {}, "Signals"), make("div", {}, ...boxes));
  }

  #pointer() {
    const canvas = this.canvas, at = (event) => this.time(event.clientX - canvas.getBoundingClientRect().left);
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      const x = event.clientX - canvas.getBoundingClientRect().left;
      const cursor = Object.keys(this.cursors).find((name) => this.cursors[name] !== null && Math.abs(this.x(this.cursors[name]) - x) < 6);
      from = { x: event.clientX, view: [...this.view], cursor, far: false };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      if (Math.abs(event.clientX - from.x) > 4) from.far = true;
      if (from.cursor) this.set(from.cursor, at(event));
      else if (from.far) { const shift = (from.x - event.clientX) * (from.view[1] - from.view[0]) / this.width; this.look_at(from.view[0] + shift, from.view[1] + shift); }
    });
    canvas.addEventListener("pointerup", (event) => { if (from && !from.far && !from.cursor) this.go_to(at(event)); from = null; });
    canvas.addEventListener("wheel", (event) => { if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.move((event.deltaX || event.deltaY) / 800); else this.zoom(Math.exp(event.deltaY / 400), at(event)); event.preventDefault(); }, { passive: false });
  }

  key(event) {
    const act = { "+": () => this.zoom(0.5), "-": () => this.zoom(2), ArrowLeft: () => this.move(-0.1), ArrowRight: () => this.move(0.1), a: () => this.set("A"), b: () => this.set("B") }[event.key];
    if (act && !event.target.matches("input")) { event.preventDefault(); act(); }
  }

  // ---- window and cursors

  get left() { return this.canvas.clientWidth < 600 ? 84 : 150; }
  get width() { return Math.max(1, this.canvas.clientWidth - this.left - 6); }
  x(t) { return this.left + this.width * (t - this.view[0]) / (this.view[1] - this.view[0]); }
  time(x) { return this.view[0] + (this.view[1] - this.view[0]) * (x - this.left) / this.width; }
  look_at(a, b) { const span = Math.min(Math.max(b - a, LEAST_S), this.session.end || LEAST_S), from = Math.min(Math.max(a, 0), Math.max(0, this.session.end - span)); this.view = [from, from + span]; this.draw(); }
  zoom(factor, about = this.#visible(this.now) ? this.now : (this.view[0] + this.view[1]) / 2) { const [a, b] = this.view; this.look_at(about + (a - about) * factor, about + (b - about) * factor); }
  move(share) { const shift = share * (this.view[1] - this.view[0]); this.look_at(this.view[0] + shift, this.view[1] + shift); }
  #visible(t) { return t >= this.view[0] && t <= this.view[1]; }

  set(name, t = this.now) {
    this.cursors[name] = Math.min(Math.max(t, 0), this.session.end);
    const { A, B } = this.cursors, dt = A === null || B === null ? null : B - A;
    const seconds = (value) => `${value.toFixed(7)} s`;
    this.told.textContent = [["A", A], ["B", B]].filter(([, value]) => value !== null).map(([one, value]) => `${one} ${seconds(value)}`).join("  ") + (dt === null ? "" : `  dt ${seconds(dt)}  1/dt ${dt ? (1 / Math.abs(dt)).toPrecision(6) : "∞"} Hz`);
    this.draw();
  }

  show(t) {
    const was = this.#visible(this.now);
    this.now = t;
    const span = this.view[1] - this.view[0];
    if (!this.#visible(t) && (was || !playing)) this.look_at(t - span * (playing ? 0.02 : 0.5), t + span * (playing ? 0.98 : 0.5));
    else this.draw();
  }

  // ---- trigger

  #find(signal, edge, value, way) {
    const hits = signal ? hits_of(signal, edge, value) : this.session.lines.filter(([, , text, means]) => `${text} ${means}`.toLowerCase().includes(value.toLowerCase())).map(([time_ns]) => time_ns / 1e9);
    const i = way > 0 ? last_before(hits, this.now + 1e-10) + 1 : last_before(hits, this.now - 1e-10);
    if (i >= 0 && i < hits.length) { this.go_to(hits[i]); this.told.textContent = `hit ${i + 1} of ${hits.length} at ${hits[i].toFixed(7)} s`; }
    else this.told.textContent = hits.length ? `none ${way > 0 ? "after" : "before"} this time, ${hits.length} in all` : "it never happens in this session";
  }

  // ---- what is drawn

  draw() {
    const canvas = this.canvas, rows = this.signals.filter((signal) => signal.shown), ratio = devicePixelRatio || 1;
    const height = rows.reduce((sum, signal) => sum + HEIGHT[signal.kind], AXIS_PX);
    canvas.style.height = `${height}px`;
    const [w, h] = [canvas.clientWidth * ratio, height * ratio].map(Math.round);
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, canvas.clientWidth, height);
    pen.font = "11px system-ui, sans-serif"; pen.textBaseline = "middle";
    this.ink = Object.fromEntries(["ink", "soft", "line", "paper", "x", "y", "z", "a", "path", "mark", "chip"].map((name) => [name, colour(name)]));
    this.#grid(pen, height);
    let top = 0, said = [];
    for (const signal of rows) {
      const box = { top, bottom: top + HEIGHT[signal.kind] };
      pen.strokeStyle = this.ink.line; pen.lineWidth = 1; pen.beginPath(); pen.moveTo(0, box.bottom - 0.5); pen.lineTo(canvas.clientWidth, box.bottom - 0.5); pen.stroke();
      const text = value_text(signal, this.now, this.view);
      said.push(`${signal.name}: ${text}`);
      this.#label(pen, signal, text, box);
      pen.save(); pen.beginPath(); pen.rect(this.left, box.top, this.width, box.bottom - box.top); pen.clip();
      this[`draw_${signal.kind}`](pen, signal, box);
      pen.restore();
      top = box.bottom;
    }
    this.#mark(pen, this.now, "mark", "", height);
    for (const [name, t] of Object.entries(this.cursors)) if (t !== null) this.#mark(pen, t, "ink", name, height);
    this.values.textContent = `at ${this.now.toFixed(6)} s: ${said.join("; ")}`;
  }

  #label(pen, signal, text, { top, bottom }) {
    const narrow = this.left < 100;
    pen.textAlign = "left";
    pen.save(); pen.beginPath(); pen.rect(0, top, this.left - 4, bottom - top); pen.clip();
    pen.fillStyle = this.ink[signal.axis] || this.ink.ink;
    const low = bottom - top < 30;
    const name = narrow ? signal.name.replace(/^(level|input|output) /, "") : signal.name;
    pen.fillText(name, 2, low ? (top + bottom) / 2 : top + 10, this.left - 8);
    pen.fillStyle = this.ink.soft;
    if (!low) { const parts = signal.kind === "curves" ? text.split(" ") : [text]; if (signal.kind === "curves") { parts.slice(0, 3).forEach((part, i) => { pen.fillStyle = this.ink[signal.axes[i]] || this.ink.soft; pen.fillText(part, 2, top + 24 + 13 * i); }); pen.fillStyle = this.ink.soft; pen.textAlign = "right"; if (!narrow) pen.fillText(signal.unit, this.left - 46, top + 24); } else pen.fillText(text, 2, top + 24); }
    pen.restore();
  }

  #grid(pen, height) {
    const [a, b] = this.view, rough = (b - a) / Math.max(2, this.width / 110), power = 10 ** Math.floor(Math.log10(rough)), step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    pen.textAlign = "center";
    for (let n = Math.ceil(a / step); n * step <= b; n++) {
      const x = this.x(n * step);
      pen.strokeStyle = this.ink.line; pen.lineWidth = 1; pen.beginPath(); pen.moveTo(x, 0); pen.lineTo(x, height - AXIS_PX + 4); pen.stroke();
      pen.fillStyle = this.ink.soft; if (x < this.left + this.width - 20) pen.fillText(`${(n * step).toFixed(digits)} s`, Math.max(x, this.left + 18), height - 8);
    }
  }

  #mark(pen, t, ink, name, height) {
    if (!this.#visible(t)) return;
    const x = this.x(t);
    pen.strokeStyle = pen.fillStyle = this.ink[ink]; pen.lineWidth = 1; pen.setLineDash(name ? [4, 3] : []); pen.beginPath(); pen.moveTo(x, 0); pen.lineTo(x, height - AXIS_PX); pen.stroke(); pen.setLineDash([]);
    pen.textAlign = "left"; if (name) pen.fillText(name, x + 3, 8);
  }

  draw_bits(pen, { times, values, axis }, { top, bottom }) {
    const low = bottom - 4, high = top + 4, [a, b] = this.view;
    let i = last_before(times, a), y = i < 0 ? null : values[i] ? high : low;
    pen.strokeStyle = this.ink[axis] || this.ink.ink; pen.lineWidth = 1.2; pen.beginPath();
    if (y !== null) pen.moveTo(this.left, y);
    for (i++; i < times.length && times[i] <= b; i++) {
      const x = this.x(times[i]), next = values[i] ? high : low;
      y === null ? pen.moveTo(x, next) : (pen.lineTo(x, y), pen.lineTo(x, next));
      y = next;
    }
    if (y !== null) pen.lineTo(this.x(Math.min(b, this.session.end)), y);
    pen.stroke();
  }

  draw_words(pen, { times, values }, { top, bottom }) {
    const [a, b] = this.view;
    for (let i = Math.max(0, last_before(times, a)); i < times.length && times[i] <= b; i++) {
      const from = Math.max(this.left, this.x(times[i])), to = Math.min(this.left + this.width, i + 1 < times.length ? this.x(times[i + 1]) : Infinity);
      pen.fillStyle = this.ink.chip; pen.fillRect(from, top + 2, Math.max(1, to - from - 1), bottom - top - 5);
      pen.fillStyle = this.ink.ink; pen.textAlign = "left";
      const text = String(values[i]).replaceAll("_", " ");
      if (pen.measureText(text).width < to - from - 6) pen.fillText(text, from + 4, (top + bottom) / 2);
    }
  }

  // Single pulses, up for plus and down for minus, or the slowest and fastest rate of each pixel if they lie too close.
  draw_steps(pen, { times, values, sums, axis }, { top, bottom }) {
    const [a, b] = this.view, first = last_before(times, a) + 1, last = last_before(times, b), middle = (top + bottom) / 2, room = (bottom - top) / 2 - 4;
    pen.strokeStyle = pen.fillStyle = this.ink[axis] || this.ink.ink; pen.lineWidth = 1; pen.beginPath();
    if (last - first < this.width / 3) {
      pen.moveTo(this.left, middle);
      for (let i = first; i <= last; i++) {
        const x = this.x(times[i]), wide = Math.max(1, Math.min(this.x(times[i] + PULSE_S) - x, i < last ? (this.x(times[i + 1]) - x) / 2 : Infinity)), y = middle - Math.sign(values[i]) * room;
        pen.lineTo(x, middle); pen.lineTo(x, y); pen.lineTo(x + wide, y); pen.lineTo(x + wide, middle);
      }
      pen.lineTo(this.left + this.width, middle); pen.stroke();
      return;
    }
    const bars = rates_of(times, sums, this.left, this.width, (x) => this.time(x), first, last);
    const most = bars.reduce((big, [low, high]) => Math.max(big, -low, high), 1);
    bars.forEach(([low, high], px) => { if (high > low) pen.fillRect(this.left + px, middle - high / most * room, 1.2, (high - low) / most * room); });
    const fastest = `${Math.round(most)} steps/s`, wide = pen.measureText(fastest).width + 6;
    pen.fillStyle = this.ink.paper; pen.fillRect(this.left + this.width - wide, top + 1, wide, 14); // to be read before pulses
    pen.fillStyle = this.ink.soft; pen.textAlign = "right"; pen.fillText(fastest, this.left + this.width - 3, top + 8);
  }

  draw_curves(pen, { times, curves, axes }, { top, bottom }) {
    const [a, b] = this.view, first = Math.max(0, last_before(times, a)), last = Math.min(times.length - 1, last_before(times, b) + 1);
    let low = 0, high = 0;
    for (const values of curves) for (let i = first; i <= last; i++) { if (values[i] < low) low = values[i]; if (values[i] > high) high = values[i]; }
    if (high - low < 1e-9) high = low + 1;
    const y = (value) => bottom - 6 - (bottom - top - 12) * (value - low) / (high - low);
    const pauses = (i) => i > 0 && times[i] - times[i - 1] > 3 * this.session.interval;
    pen.strokeStyle = this.ink.line; pen.beginPath(); pen.moveTo(this.left, y(0)); pen.lineTo(this.left + this.width, y(0)); pen.stroke();
    curves.forEach((values, k) => {
      pen.strokeStyle = this.ink[axes[k]] || this.ink.ink; pen.lineWidth = 1.2; pen.beginPath();
      let on = false, i = first;
      while (i <= last) { // all samples of a pixel: in, least, most, out; none is left out
        if (Number.isNaN(values[i])) { on = false; i++; continue; }
        const from = i, x = this.x(times[from]);
        if (on && pauses(from)) pen.lineTo(this.x(times[from] - this.session.interval), y(values[from - 1])); // nothing moved meanwhile
        let least = values[from], most = least;
        for (i++; i <= last && !Number.isNaN(values[i]) && !pauses(i) && this.x(times[i]) < x + 1; i++) { if (values[i] < least) least = values[i]; if (values[i] > most) most = values[i]; }
        on ? pen.lineTo(x, y(values[from])) : pen.moveTo(x, y(values[from]));
        if (i - from > 2) { pen.lineTo(x, y(least)); pen.lineTo(x, y(most)); }
        if (i - from > 1) pen.lineTo(this.x(times[i - 1]), y(values[i - 1]));
        on = true;
      }
      if (on && last === times.length - 1) pen.lineTo(this.x(this.session.end), y(values[last]));
      pen.stroke();
    });
    pen.fillStyle = this.ink.soft; pen.textAlign = "right"; pen.fillText(short(high), this.left + this.width - 3, top + 9); if (low < 0) pen.fillText(short(low), this.left + this.width - 3, bottom - 9);
  }

  save() {
    const { A, B } = this.cursors, span = A !== null && B !== null && A !== B ? [Math.min(A, B), Math.max(A, B)] : this.view;
    const text = vcd(this.signals.filter((signal) => signal.shown), ...span);
    if (text === null) { this.told.textContent = "too many changes in this window for a VCD: zoom in, or isel-twin export writes all of them"; return; }
    const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "text/plain" })), download: `${document.title.split(" · ")[0].replace(/\.mcap$/, "")}-${span[0].toFixed(6)}s.vcd` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}

function short(value) { const size = Math.abs(value); return size >= 100 ? value.toFixed(0) : size >= 1 ? value.toFixed(1) : String(Number(value.toPrecision(2))); }

// Of each pixel the least and the largest rate, 0 included, over cells of PAUSE_S or a pixel: from the last pulse before
// a cell, if there was no pause since, to the last one in it. Rates of both directions have room in one pixel.
function rates_of(times, sums, left, width, time, first, last) {
  const bars = Array.from({ length: Math.ceil(width) }, () => [0, 0]), cell_s = Math.min(time(left + 1) - time(left), PAUSE_S), begin = time(left);
  for (let i = first; i <= last;) {
    const cell = Math.floor((times[i] - begin) / cell_s), end = begin + (cell + 1) * cell_s, from = i > 0 && times[i] - times[i - 1] <= PAUSE_S ? i - 1 : i;
    while (i + 1 <= last && times[i + 1] < end) i++;
    const rate = from < i ? (sums[i + 1] - sums[from + 1]) / (times[i] - times[from]) : (sums[i + 1] - sums[i]) / PAUSE_S; // a single one in a long time
    const bar = bars[Math.min(bars.length - 1, Math.floor((times[i] - begin) / (time(left + 1) - begin)))];
    if (rate < bar[0]) bar[0] = rate;
    if (rate > bar[1]) bar[1] = rate;
    i++;
  }
  return bars;
}

// The rate of the last step, or how long there has been none: whether the machine stands is for the velocity to say.
function value_text(signal, t) {
  const i = last_before(signal.times, t);
  if (signal.kind === "steps") {
    if (i < 0) return "no step yet";
    const since = t - signal.times[i], took = signal.times[i] - signal.times[i - 1], rate = signal.values[i] / took;
    if (took <= 1 && since <= Math.max(took, PAUSE_S)) return `${Math.abs(rate) < 100 ? rate.toFixed(1) : Math.round(rate)} steps/s`;
    return `last ${since < 10 ? since.toFixed(3) : since.toFixed(1)} s ago`;
  }
  if (i < 0) return "–";
  if (signal.kind === "curves") return signal.curves.map((values) => Number.isNaN(values[i]) ? "–" : values[i].toFixed(3)).join(" ");
  return String(signal.values[i]);
}

// Times at which a signal does what a trigger asks for.
function hits_of(signal, edge, value) {
  const { times, values } = signal, found = [];
  if (signal.kind === "curves") {
    const limit = Number(value || 0), beyond = (i) => signal.curves.some((one) => edge === "goes above" ? one[i] > limit : one[i] < limit);
    for (let i = 1; i < times.length; i++) if (beyond(i) && !beyond(i - 1)) found.push(times[i]);
    return found;
  }
  for (let i = 0; i < times.length; i++) {
    const is = { "any step": true, begins: !i || times[i] - times[i - 1] > PAUSE_S, "turns round": i && values[i] < 0 !== values[i - 1] < 0, rises: i && values[i] && !values[i - 1], falls: i && !values[i] && values[i - 1],
      changes: i > 0, becomes: String(values[i]).toLowerCase().includes(value.toLowerCase()) }[edge];
    if (is) found.push(times[i]);
  }
  return found;
}

// A value change dump of signals from a to b (IEEE 1364), in the scopes, names and codes of recordings/vcd.py, so that
// isel-twin drive and sigrok take it; null if it would be too long.
function vcd(signals, a, b) {
  const scopes = {}, entries = [], begin = [], signs = "!%&()*+,./:;<=>?@[]^_{|}~", id = (number) => { let text = ""; do { text += signs[number % signs.length]; number = Math.floor(number / signs.length) - 1; } while (number >= 0); return text; };
  const add = (scope, name, kind, first, changes) => {
    const code = id(begin.length);
    (scopes[scope] = scopes[scope] || []).push(`$var ${kind} ${kind === "real" ? 64 : 1} ${code} ${name.replaceAll(/[^\w]+/g, "_")} $end`);
    begin.push(first === null ? "" : first(code));
    for (const [t, text] of changes) entries.push([Math.round(t * 1e9), text(code)]);
  };
  for (const signal of signals) {
    if (signal.led && signal.kind === "bits") continue; // the command tells its direction
    const from = last_before(signal.times, a) + 1, to = last_before(signal.times, b);
    if (entries.length + 2 * (to - from) > MOST_VCD) return null;
    const bit = (value) => (code) => `${value ? 1 : 0}${code}`, real = (value) => (code) => `r${value} ${code}`, word = (value) => (code) => `s${String(value).replaceAll(" ", "_") || "_"} ${code}`;
    const span = Array.from({ length: Math.max(0, to - from + 1) }, (_, i) => from + i);
    if (signal.led) add("step", `command ${signal.axis}`, "real", real(signal.sums[from]), span.map((i) => [signal.times[i], real(signal.sums[i + 1])]));
    else if (signal.kind === "steps") add("step", signal.name, "wire", bit(0), span.flatMap((i) => [[signal.times[i], bit(1)], [signal.times[i] + Math.min(PULSE_S, i + 1 < signal.times.length ? (signal.times[i + 1] - signal.times[i]) / 2 : PULSE_S), bit(0)]]));
    else if (signal.kind === "curves") signal.curves.forEach((values, k) => { if (!values.every(Number.isNaN)) add("machine", `${signal.name} ${signal.axes[k]} ${signal.unit}`.trim(), "real", from && !Number.isNaN(values[from - 1]) ? real(values[from - 1]) : null, span.filter((i) => !Number.isNaN(values[i])).map((i) => [signal.times[i], real(values[i])])); });
    else { const value = signal.kind === "bits" ? bit : word, [group, ...rest] = signal.name.split(" "); add(group === "dir" ? "step" : group, group === "dir" ? signal.name : rest.join(" "), signal.kind === "bits" ? "wire" : "string", from ? value(signal.values[from - 1]) : null, span.map((i) => [signal.times[i], value(signal.values[i])])); }
  }
  entries.sort((one, other) => one[0] - other[0]);
  const lines = ["$comment isel-twin $end", "$timescale 1 ns $end", ...Object.entries(scopes).flatMap(([scope, names]) => [`$scope module ${scope} $end`, ...names, "$upscope $end"]), "$enddefinitions $end", `#${Math.round(a * 1e9)}`, "$dumpvars", ...begin.filter(Boolean), "$end"];
  let at = -1;
  for (const [t, text] of entries) { if (t !== at) lines.push(`#${at = t}`); lines.push(text); }
  return `${lines.join("\n")}\n#${Math.round(b * 1e9)}\n`;
}
