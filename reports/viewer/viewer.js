// Films drawn in WebGL as the stills are: parallel projection, unlit colours of values, the net of
// the flat film, its two axes, hatches where tension is lost.
"use strict";
// Answers what shows a record of films in a viewer's element; of no record it forgets what was shown.
function filmViewer(root) {
const part = (name) => root.querySelector(name), canvas = part("canvas");
const gl = canvas.getContext("webgl2", {antialias: true, alpha: true});
if (!gl) return () => {};  // the still says everything
root.hidden = false;

const VERTEX = `#version 300 es
in vec2 mounted; in vec3 displaced; in float value, tension;
uniform vec2 steps, nudge; uniform float depth, lift; uniform mat3 turn; uniform vec3 shrink;
out vec2 flat_mm; out float share, state;
void main() {
  vec3 moved = displaced * steps.y;
  vec3 place = vec3(mounted * steps.x + moved.xy * min(depth, 1.0), lift - moved.z * depth);
  gl_Position = vec4(turn * place * shrink + vec3(nudge, 0.0), 1.0);
  flat_mm = mounted * steps.x; share = value; state = tension;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec2 flat_mm; in float share, state; out vec4 colour;
uniform sampler2D colours; uniform vec2 range, centre, hatch; uniform float net, plain;
uniform vec3 ink, lines[2];
float on(float coordinate, float width) {  // coverage of a line at whole numbers, in pixels
  float away = abs(fract(coordinate - 0.5) - 0.5) / fwidth(coordinate);
  return 1.0 - smoothstep(width - 0.5, width + 0.5, away);
}
float axis(float away) { return 1.0 - smoothstep(0.8, 1.8, abs(away) / fwidth(away)); }
void main() {
  if (plain > 0.5) { colour = vec4(ink, 1.0); return; }
  float place = clamp(range.x + share * range.y, 0.0, 1.0);
  vec3 shade = texture(colours, vec2((place * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  vec2 squares = flat_mm / net;
  shade = mix(shade, vec3(1.0), 0.35 * max(on(squares.x, 0.5), on(squares.y, 0.5)));
  float stripe = dot(flat_mm, hatch), cross = dot(flat_mm, vec2(-hatch.y, hatch.x));
  float black = state > 0.5 ? on(stripe, 0.6) : 0.0, white = state > 0.5 ? on(stripe, 1.3) : 0.0;
  if (state > 1.5) { black = max(black, on(cross, 0.6)); white = max(white, on(cross, 1.3)); }
  shade = mix(mix(shade, vec3(1.0), white), vec3(0.0), black);
  shade = mix(shade, lines[0], axis(flat_mm.x - centre.x));
  colour = vec4(mix(shade, lines[1], axis(flat_mm.y - centre.y)), 1.0);
}`;
const TYPES = {uint8: Uint8Array, int16: Int16Array, uint16: Uint16Array, uint32: Uint32Array};
const decoded = (item) => new TYPES[item.type](
  Uint8Array.from(atob(item.data), (letter) => letter.charCodeAt(0)).buffer);
const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);

const program = gl.createProgram();
for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
}
gl.linkProgram(program); gl.useProgram(program);
const at = (name) => gl.getUniformLocation(program, name);
const buffers = {};
const filled = (name, values, target) => {
  buffers[name] ??= gl.createBuffer();
  gl.bindBuffer(target, buffers[name]); gl.bufferData(target, values, gl.STATIC_DRAW);
  return values;
};
const attribute = (name, values, size, kind, scaled = false) => {
  filled(name, values, gl.ARRAY_BUFFER);
  const place = gl.getAttribLocation(program, name);
  gl.enableVertexAttribArray(place); gl.vertexAttribPointer(place, size, kind, scaled, 0, 0);
};
gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
  gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
for (const size of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
  gl.texParameteri(gl.TEXTURE_2D, size, gl.LINEAR);
gl.enable(gl.DEPTH_TEST); gl.clearColor(0, 0, 0, 0);

const choices = Object.fromEntries(["film", "quantity", "depth"].map(
  (name) => [name, part(`[name=${name}]`)]));
const looks = [...root.querySelectorAll("[data-elevation]")];
let data, eye, film, indices, reach = 0, waiting = false;

function loadFilm() {
  film = data.films[choices.film.value];
  attribute("mounted", decoded(film.mounted), 2, gl.SHORT);
  attribute("displaced", decoded(film.displaced), 3, gl.SHORT);
  attribute("tension", decoded(film.tension), 1, gl.UNSIGNED_BYTE);
  indices = Object.fromEntries(["triangles", "plate", "edges"].map((name) => [name, filled(
    name, decoded(film[name]), gl.ELEMENT_ARRAY_BUFFER)]));
  film.segments.forEach((lines, number) => {
    indices[`segment ${number}`] = filled(`segment ${number}`, decoded(lines),
                                          gl.ELEMENT_ARRAY_BUFFER);
  });
  loadQuantity();
}

function loadQuantity() {
  const key = choices.quantity.value, quantity = data.quantities[key], values = film.values[key];
  attribute("value", decoded(values), 1, gl.UNSIGNED_SHORT, true);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE,
                decoded(quantity.colours));
  const span = quantity.high - quantity.low;
  gl.uniform2f(at("range"), (values.low - quantity.low) / span, (values.high - values.low) / span);
  part(".words").textContent = quantity.words;
  part(".bar").style.background = quantity.gradient;
  part(".ticks").replaceChildren(...quantity.ticks.map((tick) => {
    const mark = document.createElement("span");
    mark.style.left = tick.left; mark.textContent = tick.text;
    return mark;
  }));
  const unit = quantity.unit && ` ${quantity.unit}`;
  part("output").textContent =
    `${film.name}: ${quantity.label} ${values.from} to ${values.to}${unit}`;
  canvas.setAttribute("aria-label", `The film of ${film.name} in three dimensions, coloured by ` +
    `${quantity.label}. Arrow keys turn it, plus and minus zoom, 0 resets.`);
  show();
}

function drawElements(name, kind) {
  const numbers = indices[name];
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[name]);
  gl.drawElements(kind, numbers.length,
                  numbers.BYTES_PER_ELEMENT === 2 ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT, 0);
}

function draw() {
  waiting = false;
  const pixel = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) =>
    Math.max(1, Math.round(size * pixel)));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
  gl.viewport(0, 0, width, height); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  if (!film) return;
  const depth = Number(choices.depth.value);
  const angle = eye.azimuth - (film.turned ? Math.PI / 2 : 0);
  const [c, s, up, back] = [Math.cos(angle), Math.sin(angle), Math.cos(eye.elevation),
                            Math.sin(eye.elevation)];
  // Columns: where x, y and z of the film go, across, up and away from the eye.
  gl.uniformMatrix3fv(at("turn"), false, [c, s * back, s * up, -s, c * back, c * up, 0, up, -back]);
  const scale = eye.zoom * 0.94 * Math.min(width, 1.2 * height) / reach;
  const sag = depth * 32767 * film.displaced.step;  // about, and kept in the middle
  gl.uniform3f(at("shrink"), scale / width, scale / height, 0.9 / (reach + sag));
  gl.uniform2f(at("steps"), film.mounted.step, film.displaced.step);
  gl.uniform1f(at("depth"), depth); gl.uniform1f(at("lift"), sag / 2);
  gl.uniform1f(at("net"), data.net);
  gl.uniform2f(at("centre"), ...film.centre); gl.uniform2f(at("hatch"), 2 / data.net, 2 / data.net);
  const [x, y] = film.turned ? [1, 0] : [0, 1];  // the short axis, as in the still
  gl.uniform3fv(at("lines"), [...rgb(data.lines[x]), ...rgb(data.lines[y])]);
  gl.uniform2f(at("nudge"), 0, 0);
  gl.uniform1f(at("plain"), 0); drawElements("triangles", gl.TRIANGLES);
  gl.uniform1f(at("plain"), 1); gl.uniform3f(at("ink"), 0.835, 0.843, 0.855);
  drawElements("plate", gl.TRIANGLES);
  gl.depthFunc(gl.LEQUAL);
  const AROUND = [[-1, 0], [1, 0], [0, -1], [0, 1]];
  const outline = (name, ink, thick) => {  // lines are a pixel wide
    gl.uniform3f(at("ink"), ...ink);
    for (const [across, high] of AROUND) {
      gl.uniform2f(at("nudge"), thick * across * pixel / width, thick * high * pixel / height);
      drawElements(name, gl.LINES);
    }
  };
  outline("edges", [0.1, 0.1, 0.12], 1);
  film.segments.forEach((lines, number) => {
    for (const thick of [1, 2, 3]) outline(`segment ${number}`, rgb(lines.colour), thick);
  });
}

const show = () => { if (!waiting) { waiting = true; requestAnimationFrame(draw); } };
function turn(azimuth, elevation, zoom = 1) {
  eye.azimuth += azimuth;
  eye.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, eye.elevation + elevation));
  eye.zoom = Math.max(0.5, Math.min(12, eye.zoom * zoom));
  show();
}
function lookFrom(button) {
  eye = {azimuth: 0, elevation: button.dataset.elevation * Math.PI / 180, zoom: 1};
  show();
}
const KEYS = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1],
              "+": [0, 0, 1.2], "=": [0, 0, 1.2], "-": [0, 0, 1 / 1.2]};
canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "0") lookFrom(looks[0]); else if (KEYS[event.key]) turn(...KEYS[event.key]); else return;
  event.preventDefault();
});
const fingers = new Map();
const apart = () => { const [a, b] = fingers.values(); return Math.hypot(a.x - b.x, a.y - b.y); };
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, {x: event.x, y: event.y});
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const gap = fingers.size === 2 && apart();
  fingers.set(event.pointerId, {x: event.x, y: event.y});
  if (gap) turn(0, 0, apart() / gap);
  else turn((event.x - before.x) * 0.01, (event.y - before.y) * 0.01);
});
for (const end of ["pointerup", "pointercancel"])
  canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
canvas.addEventListener("wheel", (event) => {  // else the page scrolls
  if (document.activeElement !== canvas) return;
  event.preventDefault(); turn(0, 0, Math.exp(-event.deltaY * 0.001));
}, {passive: false});
canvas.addEventListener("webglcontextlost", () => { root.hidden = true; });
for (const button of looks) button.addEventListener("click", () => lookFrom(button));
choices.film.addEventListener("change", loadFilm);
choices.quantity.addEventListener("change", loadQuantity);
choices.depth.addEventListener("change", show);
new ResizeObserver(show).observe(canvas);
lookFrom(looks[0]);

function offer(select, texts, values) {  // a list that is open stays so
  if (select.length !== texts.length)
    select.replaceChildren(...texts.map((text, number) => new Option(text, values[number])));
}

function begin() {  // what does not follow a film that changes
  lookFrom(looks[0]);
  choices.depth.value = data.depth;
  for (const item of data.films) {
    const flat = decoded(item.mounted);
    for (let point = 0; point < flat.length; point += 2)
      reach = Math.max(reach, item.mounted.step * Math.hypot(flat[point], flat[point + 1]));
  }
}

return (record) => {
  if (!record) { film = null; reach = 0; show(); return; }
  data = record;
  offer(choices.film, data.films.map((item) => item.name), Object.keys(data.films));
  offer(choices.quantity, Object.values(data.quantities).map((item) => item.label),
        Object.keys(data.quantities));
  offer(choices.depth, data.depths.map((factor) => ({0: "flat, as mounted", 1: "true to scale"}[
    factor] ?? `depth drawn ${factor} times`)), data.depths);
  choices.film.closest("label").hidden = data.films.length < 2;
  if (!reach) begin();
  loadFilm();
};
}
