// The page of the operator panel: built from what the server tells (`about`), brought up to date by its frames.
//
//   about                        what can be set and to what, terminals, axes, acts: once
//   frame, lines, plots          the state, messages of the line, points of the plots: up to 20 times a second
//   answers                      what has become of requests, by their number
//
// Buttons follow the states of their elements, not the clicks: what is shown is what the machine has, in every browser.
"use strict";

const $ = (id) => document.getElementById(id);
const SECONDS = 20, POINTS = 600, MESSAGES = 500;
const DARK = matchMedia("(prefers-color-scheme: dark)");

let about = null, frame = null, socket = null, number = 0, plots = [], retry_ms = 300;
const waiting = new Map(), updates = [];

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

function put(node, text) { if (node.textContent !== text) node.textContent = text; }
function mark(node, name, value) { if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value); }
function plain(name) { return name.replaceAll("_", " "); }

// A colour of the page, light or dark.
function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`); }

// ---- the server ------------------------------------------------------------------------------------------------------

function connect() {
  socket = new WebSocket(`ws://${location.host}/operate`);
  socket.onopen = () => { retry_ms = 300; };
  socket.onmessage = (event) => hear(JSON.parse(event.data));
  socket.onclose = (event) => {
    $("link").dataset.state = "lost";
    put($("link"), event.reason || "no server");
    document.body.inert = true; // nothing can be pressed, and nothing looks as if it were
    for (const button of document.querySelectorAll("[aria-pressed=true]")) mark(button, "aria-pressed", false);
    for (const { reject } of waiting.values()) reject(new Error("the server has gone"));
    waiting.clear();
    setTimeout(connect, retry_ms);
    retry_ms = Math.min(retry_ms * 2, 2000);
  };
}

function hear(message) {
  if (message.about) begin(message.about);
  for (const answer of message.answers || []) {
    const asked = waiting.get(answer.id);
    waiting.delete(answer.id);
    if (asked) "error" in answer ? asked.reject(new Error(answer.error)) : asked.resolve(answer.ok);
  }
  if (message.lines) say(message.lines);
  if (message.plots) { plots.push(...message.plots); plots.splice(0, plots.length - POINTS); }
  if (message.frame) { frame = message.frame; for (const update of updates) update(frame); }
  if (message.plots) draw();
  if (frame) draw_in_3d(); // after all the rest is to be seen: it takes a moment
}

function draw_in_3d() {
  if ($("scene").src || $("scene").hidden) return;
  if (make("canvas").getContext("webgl2")) $("scene").src = DARK.matches ? "/scene?darkMode" : "/scene";
  else { $("scene").hidden = $("legend").hidden = true; $("flat").hidden = false; }
}

function request(content) {
  return new Promise((resolve, reject) => {
    if (!socket || socket.readyState !== WebSocket.OPEN) { reject(new Error("no server")); return; }
    waiting.set(++number, { resolve, reject });
    socket.send(JSON.stringify({ id: number, ...content }));
  });
}

function ask(action, extra = {}) {
  return request({ ask: action, ...extra }).catch((error) => { tell(error.message); throw error; });
}
const please = (action, extra) => ask(action, extra).catch(() => {});

let telling = 0;
function tell(text) {
  put($("told"), text.replace(/^request: /, ""));
  $("told").classList.add("shown");
  clearTimeout(telling);
  telling = setTimeout(() => $("told").classList.remove("shown"), 6000);
}

// ---- the page --------------------------------------------------------------------------------------------------------

function begin(told) {
  about = told;
  updates.length = 0;
  plots = [];
  put($("what"), `${about.machine} · ${about.controller}${about.physics ? "" : " · kinematic"}`);
  document.title = `${about.machine} ${about.controller} · isel-twin`;
  $("link").dataset.state = "on";
  put($("link"), "connected");
  document.body.inert = false;
  $("monitor").replaceChildren();
  $("recording").hidden = !about.recording;
  $("scope").hidden = !about.recording;
  if (about.recording) $("recording").download = about.recording;
  build_time(); build_elements(); build_keys(); build_outputs(); build_axes(); build_ports(); build_faults(); build_plots(); build_job(); build_desk(); build_trigger();
}

function build_time() {
  const speeds = ["0.1", "0.25", "0.5", "1", "2", "5", "10", "20", "max"];
  $("speed").replaceChildren(...speeds.map((speed) => make("option", { value: speed }, speed === "max" ? "max" : `× ${speed}`)));
  $("steps").replaceChildren(...[[0.001, "1 ms"], [0.01, "10 ms"], [0.1, "100 ms"], [1, "1 s"]].map(([seconds, name]) =>
    make("button", { onclick: () => please({ step: seconds }), "aria-label": `step ${name}`, title: `let ${name} pass` }, `+${name}`)));
  updates.push((now) => {
    put($("time"), now.time_s.toFixed(3));
    mark($("pause"), "aria-pressed", now.paused);
    put($("pause"), now.paused ? "Go on" : "Pause");
    for (const button of $("steps").children) button.disabled = !now.paused;
    const speed = String(now.speed);
    if (![...$("speed").options].some((option) => option.value === speed)) $("speed").append(make("option", { value: speed }, `× ${speed}`));
    if (document.activeElement !== $("speed") && $("speed").value !== speed) $("speed").value = speed;
    put($("link"), now.hosts.length ? `host on ${now.hosts.join(", ")}` : "connected");
    put($("pace"), pace_text(now));
    $("pace").hidden = !now.behind;
    mark($("pace"), "data-state", now.reached !== null && now.reached < 1 && now.speed >= 1 ? "lost" : "slow");
  });
}

// Only less than real time is behind it; less than was asked for may still be much more.
function pace_text({ reached, speed }) {
  if (reached === null) return `less than × ${speed}`;
  const is = `× ${reached < 10 ? reached.toFixed(2) : reached.toFixed(1)}`;
  return reached < 1 && speed >= 1 ? `behind real time: ${is}` : `${is}, not × ${speed}`;
}

const own_states = (name) => about.settable[name].filter((state) => !about.fault_states.includes(state));
const same = (a, b) => a.length === b.length && a.every((entry, i) => entry === b[i]);
const is_fault = (state) => about.fault_states.includes(state);

// What an element looks like follows from the states it has: released/pressed latches, up/down springs back, the rest
// stays as it is put. Several alike in name and states, such as inputs 0 to 7, stand in a row.
function build_elements() {
  const names = Object.keys(about.settable).filter((name) => own_states(name).length > 1);
  const rows = new Map();
  for (const name of names) {
    const match = /^(.*)_(\d+)$/.exec(name);
    if (match && own_states(name).length === 2) rows.set(match[1], [...(rows.get(match[1]) || []), name]);
  }
  const nodes = [], late = [];
  $("near").replaceChildren();
  for (const name of names) {
    const match = /^(.*)_(\d+)$/.exec(name);
    if (match && rows.has(match[1])) {
      if (rows.get(match[1])[0] === name) late.push(...row(match[1], rows.get(match[1])));
    } else if (same(own_states(name), ["released", "pressed"])) nodes.unshift(...mushroom(name));
    else nodes.push(element(name));
  }
  $("elements").replaceChildren(...nodes, ...late);
}

// Pressed at once, in whatever state; released by a button of its own, so that a second click cannot do it. On small
// screens it stands in the header, too.
function mushroom(name) {
  const word = /^e_?stop/.test(name) ? "E-STOP" : plain(name).toUpperCase();
  const made = (mark_as) => {
    const hint = make("small", {}, "press");
    const button = make("button", { class: "mushroom", [mark_as]: name, "aria-label": `${word}: ${plain(name)}, press`,
      onclick: () => please({ set: { [name]: "pressed" } }) }, word, hint);
    const release = make("button", { class: "release", "data-release": name, onclick: () => please({ set: { [name]: "released" } }) }, "Turn to release");
    updates.push((now) => {
      const pressed = now.inputs[name] === "pressed";
      mark(button, "aria-pressed", pressed);
      put(hint, pressed ? "pressed" : "press");
      release.hidden = !pressed;
    });
    return [button, release];
  };
  $("near").append(...made("data-near"));
  return made("data-element");
}

function element(name) {
  const states = own_states(name);
  const line = make("div", { class: "element", "data-element": name }, make("span", {}, plain(name)));
  if (same(states, ["up", "down"])) line.append(push(name, states));
  else {
    const buttons = states.map((state, i) => make("button", { "data-state": state, class: i ? "unusual" : "",
      onclick: () => please({ set: { [name]: state } }) }, state));
    line.append(make("span", { class: "states", role: "group", "aria-label": plain(name) }, ...buttons));
    updates.push((now) => { for (const button of buttons) mark(button, "aria-pressed", now.inputs[name] === button.dataset.state); });
  }
  updates.push((now) => line.classList.toggle("faulty", name in now.faults));
  return line;
}

function spring(down, up, attributes, text) {
  let since = 0;
  const press = () => { if (!since) { since = performance.now(); please(down, { gone: up }); } };
  const release = () => {
    if (!since) return;
    setTimeout(() => please(up), Math.max(0, 120 - (performance.now() - since)));
    since = 0;
  };
  return make("button", { ...attributes, onpointerdown: press, onpointerup: release, onpointerleave: release, onblur: release,
    onkeydown: (event) => { if ([" ", "Enter"].includes(event.key) && !event.repeat) press(); }, onkeyup: release }, text);
}

// Down as long as it is held, and long enough to be seen; let go by the server if the browser goes meanwhile.
function push(name, [up, down]) {
  const button = spring({ set: { [name]: down } }, { set: { [name]: up } }, { class: "push" }, plain(name));
  updates.push((now) => mark(button, "aria-pressed", now.inputs[name] === down));
  return button;
}

function row(group, names) {
  const buttons = names.map((name) => {
    const [low, high] = own_states(name);
    const button = make("button", { "data-element": name, title: `${plain(name)}: ${low} or ${high}`, "aria-label": plain(name),
      onclick: () => please({ set: { [name]: frame.inputs[name] === high ? low : high } }) }, name.slice(group.length + 1));
    updates.push((now) => mark(button, "aria-pressed", now.inputs[name] === high));
    return button;
  });
  return [make("div", { class: "rowname" }, `${plain(group)} inputs`), make("div", { class: "row" }, ...buttons)];
}

// Keys of the controller's own panel, from its table: push-buttons in a row, the rest by what they take.
function build_keys() {
  $("keys").hidden = !about.keys.length;
  const pushed = [], nodes = about.keys.flatMap((key) => {
    const name = plain(key.key), press = (value) => please({ key: { [key.key]: value } });
    if (!key.form) {
      pushed.push(make("button", { class: "key", "data-key": key.key, title: key.meaning, onclick: () => press(true) }, name));
      return [];
    }
    const line = make("div", { class: "element", "data-key": key.key, title: key.meaning }, make("span", {}, name));
    if (key.form.number) {
      const field = number_field(key.form.number, 0, name);
      field.addEventListener("change", () => { press(field.value === "" ? null : Number(field.value)); field.blur(); });
      line.append(field);
      updates.push((now) => { if (document.activeElement !== field && Number(field.value) !== now.keys[key.key]) field.value = now.keys[key.key] ?? ""; });
    } else {
      const states = key.form.words || [false, true];
      const event = (state) => ({ key: { [key.key]: state } });
      const buttons = key.held ? states.slice(1).map((state) => spring(event(state), event(states[0]), { "data-state": state }, plain(state))) : states.map((state) => make("button", { "data-state": String(state), onclick: () => press(state) }, key.form.words ? plain(state) : state ? "on" : "off"));
      line.append(make("span", { class: "states", role: "group", "aria-label": name }, ...buttons));
      updates.push((now) => { for (const button of buttons) mark(button, "aria-pressed", String(now.keys[key.key]) === button.dataset.state); });
    }
    return [line];
  });
  $("keys").lastElementChild.replaceChildren(make("div", { class: "row" }, ...pushed), ...nodes);
}

function build_outputs() {
  const nodes = new Map();
  $("outputs").replaceChildren();
  updates.push((now) => {
    for (const [name, value] of Object.entries(now.outputs)) {
      if (!nodes.has(name)) {
        const node = make("div", { class: /fault/.test(name) ? "lamp fault" : "lamp", "data-output": name, title: plain(name) }, make("i"), plain(name), make("b"));
        nodes.set(name, node);
        $("outputs").append(node);
      }
      const node = nodes.get(name);
      mark(node, "data-on", value ? 1 : 0);
      put(node.lastChild, value > 1 ? String(value) : "");
    }
  });
}

function build_axes() {
  const rows = about.axes.map((axis) => {
    const cells = Array.from({ length: 9 }, () => make("td"));
    put(cells[0], axis);
    cells[0].className = axis;
    return cells;
  });
  $("axes").tBodies[0].replaceChildren(...rows.map((cells, i) => make("tr", { "data-axis": about.axes[i] }, ...cells)));
  const closed = about.closed_loop.slice(0, 3);
  put($("lag"), closed.every(Boolean) ? "following error" : "load angle");
  $("lag").title = closed.some(Boolean) ? "of a servo: command minus encoder, increments" : "counter minus rotor as an electrical angle; 180 is lost";
  updates.push((now) => put($("since"), now.margin_since_s.toFixed(3)));
  const fixed = (value, digits) => value === undefined || value === null ? "–" : value.toFixed(digits);
  updates.push((now) => rows.forEach((cells, i) => {
    const slip = about.slip_steps[i], lag = slip && i < 3 && about.physics && !about.closed_loop[i] ? 360 * now.lost_steps[i] / slip : null;
    put(cells[1], String(now.counts[i]));
    put(cells[2], i < 3 ? fixed(now.counts[i] * about.step_mm[i], 3) : "–");
    put(cells[3], fixed(now.position_mm[i], 3));
    put(cells[4], fixed(now.position_error_mm[i], 3));
    put(cells[5], Math.round(now.step_hz[i]).toString());
    if (about.closed_loop[i]) put(cells[6], `${Math.round(now.following_error[i])} inc`);
    else put(cells[6], lag === null ? "–" : Math.abs(lag) < 720 ? `${lag.toFixed(0)}°` : `${(lag / 360).toFixed(0)} turns`);
    const ends = now.margin_band[i];
    put(cells[7], fixed(now.margin[i], 2) + (ends ? ` (${fixed(ends[0], 2)} to ${fixed(ends[1], 2)})` : ""));
    put(cells[8], fixed(now.edge[i], 2));
    cells[8].className = now.edge[i] !== null && now.edge[i] !== undefined && now.edge[i] < 1 ? "lost" : "";
    const error = Math.abs(now.position_error_mm[i] || 0);
    cells[4].className = error >= 0.1 ? "lost" : error >= 0.05 ? "off" : "";
    const off = now.drive_faults[i] && now.drive_faults[i][0] > 0;
    cells[6].className = off || (lag !== null && Math.abs(lag) >= 180) ? "lost" : "";
    cells[6].title = off ? `the drive has switched itself off, times since power-on: ${now.drive_faults[i][0]}, the last: ${now.drive_faults[i][1]}` : "";
    cells[7].className = now.margin[i] !== null && now.margin[i] !== undefined && now.margin[i] < 0.05 ? "lost" : "";
  }));
}

function build_ports() {
  const nodes = new Map();
  $("ports").replaceChildren();
  updates.push((now) => {
    for (const [terminal, level] of Object.entries(now.levels)) {
      if (!nodes.has(terminal)) {
        const names = about.terminals[terminal] || [];
        const name = make("span", { class: "name", title: names.map(plain).join(", ") || "drive" },
          ...(names.length ? names : ["drive"]).map((contact) => make("span", { "data-contact": contact }, plain(contact))));
        const node = make("div", { class: names.length > 1 ? "port wide" : "port", "data-port": terminal },
          make("span", { class: "dot" }), make("code", {}, terminal), name, make("span", { class: "level" }));
        nodes.set(terminal, { node, name });
        $("ports").append(node);
      }
      const { node, name } = nodes.get(terminal);
      mark(node.firstChild, "data-on", level);
      put(node.lastChild, level ? "high" : "low");
      for (const part of name.children) {
        const contact = part.dataset.contact;
        mark(part, "class", contact in now.faults ? "faulty" : now.inputs[contact] === "struck" ? "struck" : "");
      }
    }
  });
}

function build_faults() {
  // Those that nobody operates come first: switches and circuits, whose faults are the ones looked for.
  const all = Object.keys(about.settable).filter((name) => about.settable[name].some(is_fault));
  const contacts = [...all.filter((name) => !own_states(name).length), ...all.filter((name) => own_states(name).length)];
  const wrong = make("div", { id: "wrong" });
  const lines = contacts.map((name) => {
    const states = about.settable[name].filter(is_fault);
    const select = make("select", { "aria-label": `fault of ${plain(name)}`, onchange: (event) => { please({ set: { [name]: event.target.value } }); event.target.blur(); } },
      ...states.map((state) => make("option", { value: state }, plain(state))));
    const line = make("div", { class: "contact", "data-contact": name }, make("span", { title: plain(name) }, plain(name)), select);
    updates.push((now) => {
      const fault = now.faults[name] || states[0];
      line.classList.toggle("faulty", fault !== states[0]);
      if (document.activeElement !== select && select.value !== fault) select.value = fault;
    });
    return line;
  });
  const acts = about.acts.map((act) => form(act, contacts));
  $("faults").replaceChildren(wrong, make("h3", {}, "Contacts and wires"), make("div", { class: "contacts" }, ...lines),
    make("h3", {}, "Machine, drives, controller and line"), ...acts);
  let shown = "";
  updates.push((now) => {
    const entries = Object.entries(now.faults);
    for (const { first, second, time_ns } of now.collisions) entries.push([`${first} hit ${second}`, `at ${(time_ns / 1e9).toFixed(3)} s`]);
    if (now.met > now.collisions.length) entries.push([`${now.met - now.collisions.length} collisions`, "before these"]);
    put($("faulty"), entries.length ? String(entries.length) : "");
    if (shown === (shown = JSON.stringify(entries))) return;
    wrong.replaceChildren(...entries.map(([name, fault]) => {
      const ended = end_of(name), line = make("div", { class: "wrong", "data-fault": name }, `${plain(name)}: ${plain(String(fault))}`);
      if (ended) line.append(make("button", { onclick: () => please(ended) }, "end"));
      return line;
    }));
  });
}

// What ends a fault that the state tells: of a contact, or of an act (`key` or `key.member`).
function end_of(name) {
  if (name in about.settable) return { set: { [name]: about.settable[name].filter(is_fault)[0] } };
  const [key, member] = name.split(/\.(.*)/);
  const act = about.acts.find((one) => one.key === key);
  if (!act || act.off === null) return null;
  return { [key]: act.by ? { [member]: act.off } : act.off };
}

function number_field(limits, first, name) {
  return make("input", { type: "number", step: limits.whole ? 1 : "any", min: limits.low, max: limits.high, value: first, "aria-label": name,
    title: `${limits.low} to ${limits.high} ${limits.unit}`.trim() });
}

function labelled(name, node, unit = "") { return make("label", {}, name, node, unit === "1" ? "" : unit); }
function choice(names, name) { return make("select", { "aria-label": name }, ...names.map((entry) => make("option", { value: entry }, entry || "none"))); }

// A form for one act, from what the table says of it: a member if it is by something, a value, a button to end it.
function form(act, contacts) {
  const parts = [], name = plain(act.key);
  const member = !act.by ? null : choice(act.by === "contact" ? contacts : act.members, `${name}: ${act.by}`);
  if (member) parts.push(labelled(act.by, member));
  let value;
  if (act.form.number) {
    const field = number_field(act.form.number, first_value(act.form.number), `${name}: value`);
    parts.push(labelled("", field, act.form.number.unit));
    value = () => Number(field.value);
  } else if (act.form.words) {
    const field = choice(act.form.words.filter((word) => word !== act.off), `${name}: value`);
    parts.push(labelled("", field));
    value = () => field.value;
  } else if (act.form.name) {
    const field = choice(contacts, `${name}: other`);
    field.selectedIndex = 1;
    parts.push(labelled("with", field));
    value = () => field.value;
  } else if (act.form.table) {
    const fields = act.form.table.map((one) => {
      const field = one.number ? number_field(one.number, one.first, `${name}: ${one.key}`) : make("input", { type: "checkbox", checked: one.first, "aria-label": `${name}: ${one.key}` });
      parts.push(labelled(plain(one.key), field, one.number ? one.number.unit : ""));
      return () => [one.key, !one.number ? field.checked : !one.sourced ? Number(field.value)
        : { value: Number(field.value), unit: one.number.unit, grade: "estimate", source: "panel" }];
    });
    value = () => Object.fromEntries(fields.map((field) => field()));
  } else value = () => true;
  const place = act.key === "force_n" && about.beside.includes("place") ? choice(["", "tool", "table"], `${name}: place`) : null;
  if (place) parts.push(labelled("at", place));
  const lasts = about.beside.includes("for") && act.off !== null ? make("input", { type: "number", min: 0, step: "any", "aria-label": `${name}: for`, placeholder: "ever" }) : null;
  if (lasts) parts.push(labelled("for", lasts, "s"));
  const event = (entry) => ({ [act.key]: member ? { [member.value]: entry } : entry });
  const begin_it = () => please({ ...event(value()), ...(place && place.value ? { place: place.value } : {}), ...(lasts && lasts.value ? { for: Number(lasts.value) } : {}) });
  parts.push(make("button", { class: "do", onclick: begin_it }, act.off === null ? "do" : "begin"));
  if (act.off !== null) parts.push(make("button", { class: "end", onclick: () => please(event(act.off)) }, "end"));
  const useless = act.physical && !about.physics;
  const node = make("details", { class: "act", "data-act": act.key, title: useless ? "does nothing without physics" : "" },
    make("summary", {}, make("b", {}, plain(act.key.replace(/_(n|mm|kg|k)$/, ""))), make("small", {}, act.meaning)),
    make("div", {}, ...parts));
  if (useless) for (const field of node.querySelectorAll("button, input, select")) field.disabled = true;
  updates.push((now) => node.classList.toggle("faulty", Object.keys(now.faults).some((fault) => fault === act.key || fault.startsWith(`${act.key}.`))));
  return node;
}

function first_value(limits) { return limits.high <= 1 ? limits.high / 100 : Math.min(50, limits.high); }

const TABS = [...document.querySelectorAll("[role=tab]")];
function show_tab(tab) {
  for (const other of TABS) {
    mark(other, "aria-selected", other === tab);
    other.tabIndex = other === tab ? 0 : -1;
    $(other.dataset.tab).hidden = other !== tab;
  }
}
for (const [i, tab] of TABS.entries()) {
  tab.addEventListener("click", () => show_tab(tab));
  tab.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    const next = TABS[(i + by + TABS.length) % TABS.length];
    show_tab(next);
    next.focus();
    event.stopPropagation();
  });
}

// ---- the line --------------------------------------------------------------------------------------------------------

// Lines break after a comma rather than within a number.
function breakable(text) { return text.split(",").flatMap((part, i, all) => i < all.length - 1 ? [`${part},`, make("wbr")] : [part]); }

function say(lines) {
  const monitor = $("monitor");
  const at_end = monitor.scrollHeight - monitor.scrollTop - monitor.clientHeight < 30;
  monitor.append(...lines.map((line) => make("div", { class: "message", "data-who": line.who },
    make("time", {}, line.s.toFixed(3)), make("span", { class: "who" }, line.who), make("span", { class: "text" }, ...breakable(line.text)),
    make("span", { class: "means" }, line.means))));
  while (monitor.childElementCount > MESSAGES) monitor.firstChild.remove();
  if (at_end) monitor.scrollTop = monitor.scrollHeight;
}

const typed = [];
let recalled = 0;
$("say").addEventListener("submit", (event) => {
  event.preventDefault();
  const field = $("text"), text = field.value;
  if (!text.trim()) return;
  field.value = ""; // at once: what is typed until the answer is there stays
  const refused = (error) => { tell(error.message); field.value = field.value || text; };
  request({ say: text }).then(() => { typed.push(text); recalled = typed.length; }, refused);
});
$("text").addEventListener("keydown", (event) => {
  const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
  if (!by || !typed.length) return;
  recalled = Math.max(0, Math.min(typed.length, recalled + by));
  $("text").value = typed[recalled] || "";
  event.preventDefault();
});

// ---- plots -----------------------------------------------------------------------------------------------------------

const PLOTS = [["step frequency", "steps/s", [2, 3], 100], ["true minus counter", "mm", [4, 5], 0.02], ["least torque margin", "", [6], 1]]; // columns: least, largest;

function build_plots() {
  $("plots").replaceChildren(...PLOTS.map(([name, unit]) =>
    make("figure", { "data-plot": name }, make("figcaption", {}, make("span", {}, name), make("span", { class: "unit" }, unit)), make("canvas"))));
}

function draw() {
  if (!plots.length || !about) return;
  const end = plots[plots.length - 1][1];
  let first = plots.findIndex((point) => point[1] >= end - SECONDS);
  const shown = plots.slice(Math.max(0, first));
  const begin = Math.min(shown[0][1], end - 1), soft = colour("soft"), line = colour("line"), inks = ["x", "y", "z", "a"].map(colour);
  document.querySelectorAll("#plots figure").forEach((figure, i) => {
    const [, , columns, least] = PLOTS[i];
    const canvas = figure.querySelector("canvas"), ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight, left = 38, top = 6, bottom = height - 14;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const values = shown.flatMap((point) => columns.flatMap((column) => point[column].filter((value) => value !== null)));
    let low = Math.min(0, ...values), high = Math.max(0, ...values);
    if (columns.length === 1) { low = 0; high = 1; } else if (high - low < least) { low = Math.min(low, -least / 2); high = Math.max(high, least / 2); }
    const x = (time) => left + (width - left - 4) * (time - begin) / (end - begin), y = (value) => bottom - (bottom - top) * (value - low) / (high - low);
    pen.font = "10px system-ui, sans-serif"; pen.fillStyle = soft; pen.strokeStyle = line; pen.lineWidth = 1;
    for (const value of low < 0 && high > 0 ? [low, 0, high] : [low, high]) {
      pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width - 4, y(value)); pen.stroke();
      if (value === 0 && Math.min(y(0) - y(high), y(low) - y(0)) < 10 && low < 0 && high > 0) continue; // would lie upon another
      pen.textAlign = "right"; pen.textBaseline = "middle"; pen.fillText(short(value), left - 4, y(value));
    }
    pen.textBaseline = "alphabetic"; pen.textAlign = "left"; pen.fillText(`${begin.toFixed(1)} s`, left, height - 2);
    pen.textAlign = "right"; pen.fillText(`${end.toFixed(1)} s`, width - 4, height - 2);
    const hit_s = frame && frame.trigger ? frame.trigger.hit_s : null;
    if (hit_s !== null && hit_s >= begin && hit_s <= end) { pen.strokeStyle = colour("warned"); pen.beginPath(); pen.moveTo(x(hit_s), top); pen.lineTo(x(hit_s), bottom); pen.stroke(); }
    about.axes.slice(0, 4).forEach((_, axis) => {
      pen.fillStyle = inks[axis];
      let until = null, before = null; // of the point before: where nobody has looked there is nothing
      for (const point of shown) {
        const [low, high = low] = columns.map((column) => point[column][axis]), from = Math.max(left, x(point[0])), wide = Math.max(1.3, x(point[1]) - from);
        if (low !== null && low !== undefined) {
          pen.globalAlpha = wide > 4 && high > low ? 0.45 : 1;
          pen.fillRect(from, y(high) - 0.65, wide, y(low) - y(high) + 1.3);
          if (columns.length === 1 && before !== null && until === point[0]) pen.fillRect(from, Math.min(y(low), y(before)), 1.3, Math.abs(y(low) - y(before)));
          until = point[1];
        }
        before = low ?? null;
      }
      pen.globalAlpha = 1;
    });
  });
}

function short(value) {
  const size = Math.abs(value);
  return size >= 10000 ? `${(value / 1000).toFixed(0)}k` : size >= 1000 ? `${(value / 1000).toFixed(1)}k` : size >= 10 || size === 0 ? value.toFixed(0) : value.toFixed(size >= 1 ? 1 : 3);
}

// ---- time and files --------------------------------------------------------------------------------------------------

$("pause").addEventListener("click", () => please(frame && frame.paused ? { resume: true } : { pause: true }));
$("speed").addEventListener("change", (event) => {
  please({ speed: event.target.value === "max" ? "max" : Number(event.target.value) });
  event.target.blur();
});
$("anew").addEventListener("click", () => please({ watch_margin: true }));
$("snapshot").addEventListener("click", () => ask({ state: true }).then((state) => save(`state-${state.time_s.toFixed(3)}s.json`, JSON.stringify(state, null, 2)), () => {}));

function save(name, text) {
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "application/json" })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

addEventListener("DOMContentLoaded", connect); // all scripts are there
