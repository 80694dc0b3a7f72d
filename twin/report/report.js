// Zoom of the time plots: buttons, keys (+ - 0, arrows), Ctrl and wheel, or a span chosen by dragging.
(() => {
  "use strict";
  const svg = document.getElementById("times");
  if (!svg) return;
  const group = document.getElementById("zoom"), ticks = document.getElementById("ticks");
  const choice = document.getElementById("choice"), cursor = document.getElementById("cursor");
  const told = document.getElementById("told"), marks = svg.querySelectorAll("[data-x]");
  const left = +svg.dataset.left, width = +svg.dataset.width, bottom = +svg.dataset.bottom;
  const t0 = +svg.dataset.first, t1 = +svg.dataset.last;
  let a = t0, b = t1;
  const element = (name, attributes, text) => {
    const made = document.createElementNS(svg.namespaceURI, name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    if (text !== undefined) made.textContent = text;
    return made;
  };
  const steps = (span) => {
    const rough = span / 8, power = 10 ** Math.floor(Math.log10(rough));
    return power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  };
  const draw = () => {
    const k = (t1 - t0) / (b - a), shift = (-(a - t0) / (t1 - t0)) * k * width;
    group.setAttribute("transform", `matrix(${k} 0 0 1 ${shift} 0)`);
    const step = steps(b - a), digits = Math.max(0, -Math.floor(Math.log10(step)));
    ticks.replaceChildren();
    for (let n = Math.ceil(a / step - 1e-9); n * step <= b + 1e-9 * step; n++) {
      const x = left + ((n * step - a) / (b - a)) * width;
      ticks.append(element("line", { x1: x, x2: x, y1: bottom, y2: bottom + 5, class: "frame" }));
      ticks.append(element("text", { x, y: bottom + 19, "text-anchor": "middle" }, (n * step).toFixed(digits)));
    }
    for (const mark of marks) {
      const x = left + shift + k * mark.dataset.x;
      mark.setAttribute("transform", `translate(${x} 0)`);
      mark.setAttribute("visibility", x < left - 1 || x > left + width + 1 ? "hidden" : "visible");
    }
    told.textContent = a === t0 && b === t1 ? "" : `${a.toFixed(3)} s to ${b.toFixed(3)} s`;
  };
  const show = (from, to) => {
    const least = (t1 - t0) / 5000, span = Math.min(Math.max(to - from, least), t1 - t0);
    a = Math.min(Math.max((from + to - span) / 2, t0), t1 - span);
    b = a + span;
    draw();
  };
  const scale = (factor, at) => show(at - (at - a) * factor, at + (b - at) * factor);
  const move = (part) => show(a + (b - a) * part, b + (b - a) * part);
  const acts = {
    "+": () => scale(0.5, (a + b) / 2), "-": () => scale(2, (a + b) / 2), 0: () => show(t0, t1),
    ArrowLeft: () => move(-0.25), ArrowRight: () => move(0.25),
  };
  for (const button of document.querySelectorAll("button[data-act]"))
    button.addEventListener("click", () => acts[button.dataset.act]());
  for (const button of document.querySelectorAll("button[data-from]"))
    button.addEventListener("click", () => {
      show(+button.dataset.from, +button.dataset.to);
      svg.scrollIntoView({ block: "center" });
      svg.focus({ preventScroll: true });
    });
  svg.addEventListener("keydown", (event) => {
    const act = acts[event.key === "=" ? "+" : event.key];
    if (act && !event.ctrlKey && !event.metaKey && !event.altKey) { event.preventDefault(); act(); }
  });
  const place = (event) => {
    const box = svg.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * svg.viewBox.baseVal.width - left;
    return Math.min(Math.max(x, 0), width);
  };
  const time = (x) => a + (x / width) * (b - a);
  let began = null;
  svg.addEventListener("pointerdown", (event) => {
    if (event.button || event.pointerType === "touch") return;
    began = place(event);
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    const x = place(event);
    cursor.setAttribute("transform", `translate(${left + x} 0)`);
    cursor.setAttribute("visibility", "visible");
    cursor.lastElementChild.textContent = `${time(x).toFixed(3)} s`;
    if (began === null) return;
    choice.setAttribute("x", left + Math.min(began, x));
    choice.setAttribute("width", Math.abs(x - began));
  });
  svg.addEventListener("pointerleave", () => cursor.setAttribute("visibility", "hidden"));
  svg.addEventListener("pointerup", (event) => {
    const x = place(event), from = began;
    began = null;
    choice.setAttribute("width", 0);
    if (from !== null && Math.abs(x - from) > 5) show(time(Math.min(from, x)), time(Math.max(from, x)));
  });
  svg.addEventListener("dblclick", () => show(t0, t1));
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    scale(2 ** (event.deltaY / 300), time(place(event)));
  }, { passive: false });
  draw();
})();
