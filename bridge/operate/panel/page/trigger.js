// The trigger of the panel: virtual time stops at the instant at which something begins. Loaded behind panel.js.
"use strict";

const WORDS = { "the controller's reply": "replied", "the host's message": "sent", "a remark": "remark" };

// Kinds of signals: names, what each can do, whether it needs a value, and the condition (control.py).
const TRIGGERS = [
  { kind: "level", names: (now) => Object.keys(now.levels), acts: () => ["rises", "falls"], when: (name, act) => ({ level: name, is: act === "rises" ? 1 : 0 }) },
  { kind: "input", names: (now) => [...new Set([...Object.keys(about.settable), ...Object.keys(now.inputs)])],
    acts: (name) => [...new Set([...(about.settable[name] || []), "free", "struck"])].map((state) => `becomes ${state}`), when: (name, act) => ({ input: name, is: act.slice(8) }) },
  { kind: "output", names: (now) => Object.keys(now.outputs).filter((name) => Number.isInteger(now.outputs[name])), acts: () => ["becomes"], unit: "", usual: 1, when: (name, _, value) => ({ output: name, is: value }) },
  { kind: "position", names: () => about.axes.slice(0, 3), acts: () => ["goes above", "goes below"], unit: "mm", usual: 0, when: (name, act, value) => ({ position: name, [act.slice(5)]: value }) },
  { kind: "message", names: () => Object.keys(WORDS), acts: () => ["contains"], text: true, unit: "", usual: "", when: (name, _, value) => ({ [WORDS[name]]: value }) },
  { kind: "machine", names: () => ["collision", "fault"], acts: () => ["happens"], when: (name) => ({ [name]: true }) },
];

function trigger_text(when) {
  const [[kind, name]] = Object.entries(when);
  const who = Object.keys(WORDS).find((one) => WORDS[one] === kind);
  if (who) return `${who} contains ${name}`;
  if (name === true) return kind === "fault" ? "the controller shows an error" : "two bodies meet";
  const does = { above: `goes above ${when.above} mm`, below: `goes below ${when.below} mm` };
  if (kind === "position") return `position ${name} ${"above" in when ? does.above : does.below}`;
  return kind === "level" ? `level ${name} ${when.is ? "rises" : "falls"}` : `${kind} ${plain(name)} becomes ${when.is}`;
}

function build_trigger() {
  const signal = make("select", { id: "triggersignal", "aria-label": "signal" }), act = make("select", { id: "triggeract", "aria-label": "what of it" });
  const value = make("input", { id: "triggervalue", step: "any", "aria-label": "value" }), unit = make("span");
  const arm = make("button", { id: "arm" }, "Arm"), off = make("button", { id: "disarm", type: "button" }, "Off");
  const told = make("output", { id: "triggered" }), scope = make("a", { id: "around", class: "button", target: "_blank", hidden: true }, "Scope there");
  const kind_of = () => TRIGGERS[Number(signal.selectedOptions[0].dataset.kind)];
  const choose = () => {
    const kind = kind_of();
    act.replaceChildren(...kind.acts(signal.value).map((name) => make("option", {}, name)));
    value.type = kind.text ? "text" : "number";
    value.hidden = unit.hidden = kind.unit === undefined;
    value.value = kind.usual ?? "";
    put(unit, kind.unit || "");
  };
  const fill = (now) => {
    signal.replaceChildren(...TRIGGERS.map((kind, i) => make("optgroup", { label: kind.kind }, ...kind.names(now).map((name) =>
      make("option", { value: name, "data-kind": i }, `${["machine", "message"].includes(kind.kind) ? "" : `${kind.kind} `}${plain(name)}`)))));
    choose();
  };
  signal.addEventListener("change", choose);
  $("trigger").onsubmit = (event) => {
    event.preventDefault();
    request({ trigger: kind_of().when(signal.value, act.value, kind_of().text ? value.value : Number(value.value)) }).catch((error) => tell(error.message));
  };
  off.addEventListener("click", () => request({ trigger: false }).catch((error) => tell(error.message)));
  $("trigger").replaceChildren(make("b", {}, "Pause when"), signal, act, value, unit, arm, off, told, scope);
  updates.push((now) => {
    if (!signal.options.length) fill(now);
    const set = now.trigger, hit = set !== null && set.hit_s !== null;
    mark(arm, "aria-pressed", set !== null && !hit);
    off.disabled = set === null;
    put(told, set === null ? "" : hit ? `${set.hit_s.toFixed(9)} s: ${trigger_text(set.when)}` : `armed: ${trigger_text(set.when)}`);
    scope.hidden = !hit || !about.recording;
    if (hit) mark(scope, "href", `/session#t=${set.hit_s}`);
  });
}
