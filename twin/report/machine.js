// The machine of a recording in 3D, in plain WebGL: bodies of its model, moved by its axes, and the trail of the tool.

const TRAIL = 20000; // most points of the trail
const FLOATS = 6; // of a vertex: place and normal
const VERTEX = `attribute vec3 place, normal; attribute vec4 paint; uniform mat4 body, camera; varying vec4 shade;
  void main() {
    vec3 n = mat3(body) * normal;
    float light = dot(n, n) > 0.0 ? 0.55 + 0.30 * max(dot(n, vec3(-0.35, -0.55, 0.76)), 0.0) + 0.15 * n.z : 1.0;
    shade = vec4(paint.rgb * light, paint.a);
    gl_Position = camera * body * vec4(place, 1.0);
  }`;
const FRAGMENT = "precision mediump float; varying vec4 shade; void main() { gl_FragColor = shade; }";
const BAD_MM = 0.1, GREEN = [0, 0.47, 0.12], YELLOW = [0.92, 0.55, 0], RED = [0.78, 0, 0];

// Matrices are 16 numbers, column by column.
const ONE = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const at_place = ([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
const turned_by = ([w, x, y, z]) => [
  1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0, 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
  2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, 0, 0, 0, 1];

function times(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column++) for (let row = 0; row < 4; row++) for (let k = 0; k < 4; k++) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return product;
}
const moved = (m, [x, y, z]) => [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
// Where a point of the world is in a frame that is not scaled.
const inside = (m, point) => { const d = point.map((part, row) => part - m[12 + row]); return [0, 1, 2].map((column) => d[0] * m[4 * column] + d[1] * m[4 * column + 1] + d[2] * m[4 * column + 2]); };

// The frame of each body, with the axes at `places` in metres or radians.
function frames(bodies, places) {
  const found = [];
  for (const body of bodies) {
    let frame = times(at_place(body.position), turned_by(body.wxyz));
    for (const joint of body.joints) {
      const q = places[joint.axis], [x, y, z] = joint.along;
      if (joint.slides) frame = times(frame, at_place([x * q, y * q, z * q]));
      else {
        const sine = Math.sin(q / 2), turn = turned_by([Math.cos(q / 2), x * sine, y * sine, z * sine]);
        frame = times(frame, times(at_place(joint.at), times(turn, at_place(joint.at.map((part) => -part)))));
      }
    }
    found.push(found.length ? times(found[body.parent], frame) : frame);
  }
  return found;
}

function places_at(session, t) {
  const i = last_before(session.times, t), after = Math.min(i + 1, session.times.length - 1), from = Math.max(i, 0);
  const span = session.times[after] - session.times[from], share = span > 0 ? Math.min(1, (t - session.times[from]) / span) : 0;
  return session.places.map((values) => values[from] + share * (values[after] - values[from]));
}

function corners(mesh) {
  const out = [], point = (number) => mesh.vertices.slice(3 * number, 3 * number + 3);
  for (let i = 0; i < mesh.faces.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => point(mesh.faces[i + k]));
    const u = b.map((part, k) => part - a[k]), v = c.map((part, k) => part - a[k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], size = Math.hypot(...n) || 1;
    for (const corner of [a, b, c]) out.push(...corner, ...n.map((part) => part / size));
  }
  return new Float32Array(out);
}

// Indices of at most `most` of the values of curves: of each stretch the first, least and largest of each, and the last one.
function extremes(curves, most) {
  const count = curves[0].length, size = count > most ? Math.ceil(count * (2 * curves.length + 1) / (most - 8)) : 1, kept = [];
  for (let from = 0; from < count; from += size) {
    const found = [from];
    for (const values of size > 1 ? curves : []) {
      let low = from, high = from;
      for (let i = from; i < Math.min(from + size, count); i++) { if (values[i] < values[low]) low = i; if (values[i] > values[high]) high = i; }
      found.push(low, high);
    }
    kept.push(...[...new Set(found)].sort((a, b) => a - b));
  }
  if (size > 1 && kept.at(-1) !== count - 1) kept.push(count - 1);
  return kept;
}

// The path of the tool over the table: places in the frame of the table and colours, one point a sample or, in a long session, its extremes.
function trail(session) {
  const { bodies, tool, table } = session.machine, error = session.samples.find((one) => one.name === "position_error_mm");
  const kept = extremes(session.places, TRAIL), times_s = Float64Array.from(kept, (i) => session.times[i]);
  const places = new Float32Array(3 * kept.length), paints = new Float32Array(4 * kept.length);
  kept.forEach((i, point) => {
    const all = frames(bodies, session.places.map((values) => values[i]));
    places.set(inside(all[table], moved(all[tool.body], tool.at)), 3 * point);
    const off = Math.min(error ? Math.hypot(...error.values.map((values) => values[i])) / BAD_MM : 0, 1);
    const [low, high, share] = off < 0.5 ? [GREEN, YELLOW, 2 * off] : [YELLOW, RED, 2 * off - 1];
    paints.set([...low.map((part, k) => part + share * (high[k] - part)), 1], 4 * point);
  });
  return { times: times_s, places, paints };
}

function camera_of(view, width, height) {
  const { yaw, pitch, distance, centre } = view, near = distance / 50, far = distance * 10, f = 1 / Math.tan(0.36);
  const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)], right = [-Math.sin(yaw), Math.cos(yaw), 0];
  const up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]];
  const eye = centre.map((part, k) => part + distance * back[k]), dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
  const look = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, dot(right), dot(up), dot(back), 1];
  const lens = [f * height / width, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, 2 * near * far / (near - far), 0];
  return times(lens, look);
}

function build_machine(session) {
  const canvas = make("canvas", { role: "img", tabindex: 0, "aria-label": "the machine in 3D: drag or arrow keys turn it, the wheel comes nearer" });
  const stage = make("div", { id: "stage" }, canvas);
  const gl = session.machine && canvas.getContext("webgl", { antialias: true });
  if (!gl) {
    stage.replaceChildren(make("p", {}, session.machine ? "This browser has no WebGL, so the machine is not drawn." : "This recording does not say where the machine was, so it is not drawn."));
    return stage;
  }
  stage.append(make("span", { class: "legend" }, make("i"), "tool off by 0 to 0.1 mm"));
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); gl.useProgram(program); gl.enable(gl.DEPTH_TEST); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  const [place, normal, paint] = ["place", "normal", "paint"].map((name) => gl.getAttribLocation(program, name));
  const [body, camera] = ["body", "camera"].map((name) => gl.getUniformLocation(program, name));
  const buffer = (numbers) => { const made = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, made); gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW); return made; };
  const meshes = session.machine.meshes.map((mesh) => { const numbers = corners(mesh); return { ...mesh, count: numbers.length / FLOATS, buffer: buffer(numbers) }; });
  meshes.sort((a, b) => b.rgba[3] - a.rgba[3]);
  const path = trail(session), path_places = buffer(path.places), path_paints = buffer(path.paints);
  const start = Math.hypot(0.6, 0.86, 0.55), view = { yaw: Math.atan2(-0.86, -0.6), pitch: Math.asin(0.55 / start), distance: 1.3 * start * session.machine.extent, centre: session.machine.centre };
  let t = 0;
  const draw = () => {
    const ratio = devicePixelRatio || 1, width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height); gl.clearColor(0, 0, 0, 0); gl.depthMask(true); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(camera, false, camera_of(view, width, height));
    const all = frames(session.machine.bodies, places_at(session, t));
    gl.enableVertexAttribArray(place);
    gl.disableVertexAttribArray(normal); gl.vertexAttrib3f(normal, 0, 0, 0);
    gl.enableVertexAttribArray(paint);
    gl.bindBuffer(gl.ARRAY_BUFFER, path_places); gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, path_paints); gl.vertexAttribPointer(paint, 4, gl.FLOAT, false, 0, 0);
    gl.uniformMatrix4fv(body, false, all[session.machine.table]);
    gl.drawArrays(gl.LINE_STRIP, 0, last_before(path.times, t) + 1);
    gl.disableVertexAttribArray(paint); gl.enableVertexAttribArray(normal);
    for (const mesh of meshes) {
      const clear = mesh.rgba[3] < 1;
      clear ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
      gl.depthMask(!clear);
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 4 * FLOATS, 0); gl.vertexAttribPointer(normal, 3, gl.FLOAT, false, 4 * FLOATS, 12);
      gl.vertexAttrib4f(paint, ...mesh.rgba); gl.uniformMatrix4fv(body, false, all[mesh.body]);
      gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
    }
  };
  const turn = (right, up) => { view.yaw -= right; view.pitch = Math.min(1.55, Math.max(-0.3, view.pitch + up)); draw(); };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => { if (canvas.hasPointerCapture(event.pointerId)) turn(event.movementX / 150, event.movementY / 150); });
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); view.distance *= Math.exp(event.deltaY / 900); draw(); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (way) { event.preventDefault(); event.stopPropagation(); turn(...way); }
  });
  showing.push((at) => { t = at; draw(); });
  new ResizeObserver(draw).observe(canvas);
  return stage;
}
