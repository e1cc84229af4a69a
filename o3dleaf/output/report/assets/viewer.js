// The interactive view of the report: plain WebGL 2, no library, no network.
"use strict";
(async function view() {
  const root = document.getElementById("viewer");
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const canvas = root.querySelector("canvas");
  const say = (text) => {
    root.querySelector(".message").textContent = text;
    root.classList.toggle("broken", Boolean(text));
  };
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: false });
  if (!gl) return say("This browser has no WebGL 2, so there is no interactive view; the pictures above show the same.");
  if (!window.DecompressionStream) return say("This browser is too old for the interactive view (no DecompressionStream); the pictures above show the same.");

  // --- the data: base64 of deflated little-endian arrays ---

  async function unpack(text, Kind) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Kind(await new Response(stream).arrayBuffer());
  }
  const places = await unpack(data.vertices, Uint16Array);
  const triangles = await unpack(data.triangles, Uint32Array);
  for (let i = 3; i < triangles.length; i++) triangles[i] = (triangles[i] + triangles[i - 3]) >>> 0;
  for (let i = 3; i < places.length; i++) places[i] = places[i] + places[i - 3]; // both are stored as differences
  for (const layer of data.layers) layer.codes = await unpack(layer.values, Uint8Array);
  for (const kind of data.defects) kind.soup = await unpack(kind.soup, Float32Array);

  // --- vectors and matrices, column by column ---

  const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((x) => x / (Math.hypot(...a) || 1));
  const turn = (v, axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), k = dot(v, axis) * (1 - c), w = cross(axis, v);
    return v.map((x, i) => x * c + w[i] * s + axis[i] * k);
  };

  // --- shaders ---

  const SURFACE_VERTEX = `#version 300 es
    in vec3 place; in float value; uniform vec3 low, extent; uniform mat4 motion; uniform vec3 eye;
    out vec3 from; out float shade; void main() {
      vec3 at = low + place * extent; from = at - eye; shade = value;
      gl_Position = motion * vec4(at, 1.0); }`;
  const SURFACE_COLOR = `#version 300 es
    precision highp float; in vec3 from; in float shade; uniform sampler2D map; uniform vec4 plain; uniform int mode; uniform float under;
    uniform vec3 sun; out vec4 color; void main() {
      vec3 normal = normalize(cross(dFdx(from), dFdy(from)));
      float light = 0.34 + 0.62 * max(dot(normal, sun), 0.0) + 0.10 * max(dot(normal, -normalize(from)), 0.0);
      vec3 base = plain.rgb * (gl_FrontFacing ? 1.0 : under);
      float code = shade * 255.0;
      if (mode == 1) light = 0.45 + 0.55 * light;
      if (mode == 1) base = code > 254.5 ? vec3(0.62) : texture(map, vec2((code + 0.5) / 255.0, 0.5)).rgb;
      color = mode == 2 ? plain : vec4(min(base * light * 1.08, 1.0), 1.0); }`;
  const POINT_VERTEX = `#version 300 es
    in vec3 place; uniform mat4 motion; uniform float size; void main() {
      gl_Position = motion * vec4(place, 1.0); gl_PointSize = size; }`;
  const POINT_COLOR = `#version 300 es
    precision highp float; uniform vec4 plain; out vec4 color; void main() {
      float r = length(gl_PointCoord - 0.5); if (r > 0.5 || r < 0.36) discard; color = plain; }`;

  function program(vertex, fragment) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.bindAttribLocation(made, 0, "place");
    gl.bindAttribLocation(made, 1, "value");
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    const names = ["low", "extent", "motion", "eye", "map", "plain", "mode", "sun", "size", "under"];
    return { made, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
  }
  const surface = program(SURFACE_VERTEX, SURFACE_COLOR), point = program(POINT_VERTEX, POINT_COLOR);

  function buffer(target, array) {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, array, gl.STATIC_DRAW);
    return made;
  }
  const placeBuffer = buffer(gl.ARRAY_BUFFER, places);
  const triangleBuffer = buffer(gl.ELEMENT_ARRAY_BUFFER, triangles);
  for (const layer of data.layers) layer.buffer = buffer(gl.ARRAY_BUFFER, layer.codes);
  for (const kind of data.defects) {
    kind.buffer = buffer(gl.ARRAY_BUFFER, kind.soup);
    kind.points = buffer(gl.ARRAY_BUFFER, new Float32Array(kind.places.flat()));
  }
  let edgeBuffer = null; // made when the wire frame is first asked for
  function edges() {
    const pairs = new Uint32Array(2 * triangles.length);
    for (let i = 0; i < triangles.length; i++) {
      pairs[2 * i] = triangles[i];
      pairs[2 * i + 1] = triangles[i % 3 === 2 ? i - 2 : i + 1];
    }
    return buffer(gl.ELEMENT_ARRAY_BUFFER, pairs);
  }
  const texture = gl.createTexture();
  function setMap(layer) {
    const pixels = Uint8Array.from(atob(layer.map), (letter) => letter.charCodeAt(0));
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, pixels);
    for (const name of ["WRAP_S", "WRAP_T"]) gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], gl.CLAMP_TO_EDGE);
    for (const name of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}_FILTER`], gl.LINEAR);
  }

  // --- the camera: a frame about a target, seen from `distance` ---

  const home = data.camera, FIELD = 0.5; // of view, tangent of half the angle
  let camera;
  const reset = () => { camera = { ...home, distance: (0.56 * Math.max(home.width / aspect(), home.height)) / FIELD + home.depth / 4 }; };
  const aspect = () => canvas.clientWidth / canvas.clientHeight || 1.6;
  const toward = () => cross(camera.right, camera.up);
  const eye = () => add(camera.target, toward(), camera.distance);
  function motion() {
    const t = toward(), e = eye(), a = aspect();
    const reach = camera.distance + data.radius * 2.2 + Math.hypot(...add(camera.target, data.middle, -1));
    const far = reach, near = Math.max(camera.distance * 0.02, far * 1e-5);
    const z = (far + near) / (near - far), w = (2 * far * near) / (near - far);
    const rows = [camera.right, camera.up, t].map((axis) => [...axis, -dot(axis, e)]);
    const out = [];
    for (let c = 0; c < 4; c++) {
      out.push(rows[0][c] / FIELD / a, rows[1][c] / FIELD, z * rows[2][c] + (c === 3 ? w : 0), -rows[2][c]);
    }
    return new Float32Array(out);
  }

  // --- drawing ---

  const state = { layer: -1, wire: false, hidden: new Set(data.defects.filter((kind) => !kind.shown).map((kind) => kind.name)) };
  let asked = false;
  const ask = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };
  function draw() {
    asked = false;
    const ratio = window.devicePixelRatio || 1, size = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    gl.viewport(0, 0, ...size);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const matrix = motion(), layer = data.layers[state.layer];
    gl.useProgram(surface.made);
    gl.uniformMatrix4fv(surface.at.motion, false, matrix);
    gl.uniform3fv(surface.at.eye, eye());
    gl.uniform3fv(surface.at.sun, unit(add(add(toward(), camera.up, 0.6), camera.right, -0.7)));
    gl.uniform3fv(surface.at.low, data.low);
    gl.uniform3fv(surface.at.extent, data.extent);
    gl.bindBuffer(gl.ARRAY_BUFFER, placeBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 0, 0);
    if (layer) {
      gl.bindBuffer(gl.ARRAY_BUFFER, layer.buffer);
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 1, gl.UNSIGNED_BYTE, true, 0, 0);
    } else gl.disableVertexAttribArray(1);
    gl.uniform1i(surface.at.mode, layer ? 1 : 0);
    gl.uniform4f(surface.at.plain, 0.52, 0.66, 0.44, 1);
    gl.uniform1f(surface.at.under, data.reduced ? 1 : 0.72); // two thin faces that became one face either way
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 2);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, triangleBuffer);
    gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.uniform1i(surface.at.mode, 2);
    if (state.wire) {
      edgeBuffer = edgeBuffer || edges();
      gl.uniform4f(surface.at.plain, 0.08, 0.12, 0.09, 1);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, edgeBuffer);
      gl.drawElements(gl.LINES, 2 * triangles.length, gl.UNSIGNED_INT, 0);
    }
    drawDefects(matrix, ratio);
  }
  function drawDefects(matrix, ratio) {
    const shown = data.defects.filter((kind) => !state.hidden.has(kind.name));
    gl.disableVertexAttribArray(1);
    gl.uniform3f(surface.at.low, 0, 0, 0);
    gl.uniform3f(surface.at.extent, 1, 1, 1);
    for (const kind of shown) {
      gl.bindBuffer(gl.ARRAY_BUFFER, kind.buffer);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.uniform4f(surface.at.plain, ...kind.color, 1);
      gl.polygonOffset(-1, -2);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.drawArrays(gl.TRIANGLES, 0, kind.soup.length / 3);
      gl.disable(gl.POLYGON_OFFSET_FILL);
    }
    gl.useProgram(point.made);
    gl.uniformMatrix4fv(point.at.motion, false, matrix);
    gl.uniform1f(point.at.size, 22 * ratio);
    gl.disable(gl.DEPTH_TEST); // a defect is found wherever it hides
    for (const kind of shown) {
      gl.bindBuffer(gl.ARRAY_BUFFER, kind.points);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.uniform4f(point.at.plain, ...kind.color, 1);
      gl.drawArrays(gl.POINTS, 0, kind.places.length);
    }
    gl.enable(gl.DEPTH_TEST);
  }

  // --- what the reader does ---

  const perPixel = () => (2 * FIELD * camera.distance) / canvas.clientHeight;
  function orbit(dx, dy) {
    const up = camera.up, right = camera.right;
    camera.right = unit(turn(right, up, -dx * 0.008));
    const tilted = turn(up, camera.right, -dy * 0.008);
    camera.up = unit(add(tilted, camera.right, -dot(tilted, camera.right)));
  }
  function pan(dx, dy) {
    camera.target = add(add(camera.target, camera.right, -dx * perPixel()), camera.up, dy * perPixel());
  }
  function zoom(factor, x = 0, y = 0) {
    const distance = Math.min(Math.max(camera.distance * factor, data.radius * 1e-4), data.radius * 20);
    const moved = (1 - distance / camera.distance) * perPixel();
    camera.target = add(add(camera.target, camera.right, x * moved), camera.up, -y * moved); // what is under the pointer stays
    camera.distance = distance;
  }
  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
    const other = [...held].find(([id]) => id !== event.pointerId);
    held.set(event.pointerId, now);
    if (other) {
      const apart = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]) || 1;
      zoom(apart(before) / apart(now));
      pan(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons & 6) pan(dx, dy);
    else orbit(dx, dy);
    ask();
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = canvas.getBoundingClientRect();
    zoom(Math.exp(event.deltaY * 0.0015), event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2);
    ask();
  }, { passive: false });
  const KEYS = {
    ArrowLeft: () => orbit(-12, 0), ArrowRight: () => orbit(12, 0), ArrowUp: () => orbit(0, -12), ArrowDown: () => orbit(0, 12),
    "+": () => zoom(0.85), "-": () => zoom(1 / 0.85), w: () => root.querySelector("[name=wire]").click(), 0: reset,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
    ask();
  });

  const select = root.querySelector("[name=color]");
  select.addEventListener("change", () => {
    state.layer = Number(select.value);
    const layer = data.layers[state.layer], legend = root.querySelector(".legend");
    legend.hidden = !layer;
    if (layer) {
      setMap(layer);
      legend.querySelector("i").style.background = layer.css;
      [".low", ".high", ".what"].forEach((name, i) => { legend.querySelector(name).textContent = [layer.low, layer.high, layer.label][i]; });
    }
    ask();
  });
  root.querySelector("[name=wire]").addEventListener("change", (event) => { state.wire = event.target.checked; ask(); });
  root.querySelector("[name=reset]").addEventListener("click", () => { reset(); ask(); });
  for (const box of root.querySelectorAll("[name=defect]")) {
    box.addEventListener("change", () => { state.hidden[box.checked ? "delete" : "add"](box.value); ask(); });
  }
  for (const link of document.querySelectorAll("[data-place]")) {
    link.addEventListener("click", () => {
      const [target, t, radius] = JSON.parse(link.dataset.place);
      const side = Math.abs(dot(t, home.right)) < 0.9 ? home.right : home.up, right = unit(add(side, t, -dot(side, t)));
      camera = { ...home, target, right, up: cross(t, right), distance: (1.3 * radius) / FIELD };
      ask();
    });
  }
  canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); say("The graphics driver gave up; load the page again."); });
  new ResizeObserver(ask).observe(canvas);
  reset();
  draw();
  root.dataset.drawn = String(triangles.length / 3);
})().catch((error) => {
  const root = document.getElementById("viewer");
  root.classList.add("broken");
  root.querySelector(".message").textContent = "The interactive view failed (" + error.message + "); the pictures above show the same.";
  console.error(error);
});
