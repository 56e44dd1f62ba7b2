// Drawings of the explorer: the bent structure with cameras that can be dragged along their
// hemisphere, and its shapes, curves along a beam or maps of a plate; `app` comes from explorer.js.
import { axes } from "./chart.js";
import { colourBar, colourOf } from "./maps.js";
import { ARROWS, circle, clamp, fill, html, lines, mark, path, svg, text } from "./parts.js";
import { markers, modeShape } from "./physics.js";
import { towards } from "./pinhole.js";
import {
  RAD, SQUARE, bent, dot, drawAxes, drawCamera, drawClamp, drawHemisphere, orbitHemisphere, plus,
  times, trace, turnable,
} from "./space.js";

const STEP = 0.5; // degrees, of a dragged camera, and its least elevation
const PERCENT = [10, 20, 50, 100, 200, 500, 1000, 1e4, 1e5];
const above = (value, steps) => steps.find((step) => step >= value) ?? value; // changes seldom
const SMALL = { left: 47, right: 8, top: 22, bottom: 20, title: 14 }; // margins of a chart

// --- the view; world coordinates are in units of the cameras' distance, in parallel projection
export function createView(app) {
  const sight = { azimuth: 158, elevation: 33 };
  const scene = svg("g"), shape = path("tl-mesh"), cameras = svg("g");
  const node = svg("svg", { class: "tl-ex-view", role: "group",
    "aria-label": "The cameras around the structure; arrow keys turn the view" },
  scene, shape, cameras);
  let curves = [], phase = 0;
  let size = null; // px; reading it in every frame would force a layout of the page

  function orbitCameras() {
    size ??= [node.clientWidth || 480, node.clientHeight || 360];
    return orbitHemisphere(sight, 1, ...size, 50);
  }
  function draw() {
    const { state, structure, sensorWidth } = app, space = orbitCameras();
    const { flat, line, unit } = space;
    const sides = [structure.length, structure.width], [long, wide] = times(sides, 1000 / state.d);
    const isBeam = structure.kind === "beam", [along, across] = isBeam ? [24, 1] : [12, 8];
    const rise = 0.06 * long * unit * Math.cos(sight.elevation * RAD); // exaggerated
    const place = (s, t) => [...flat([(s - 0.5) * long, (t - 0.5) * wide, 0]),
      rise * modeShape(structure, state.m, s * sides[0], t * sides[1])];
    fill(node, { viewBox: `0 0 ${size.join(" ")}` });
    scene.replaceChildren(
      ...drawHemisphere(space, 1), ...drawAxes(space, [long / 2, wide / 2, 0], 0.16),
      line("tl-ex-rest", SQUARE.map(([u, v]) => [(u * long) / 2, (v * wide) / 2, 0]), "Z"),
      ...(isBeam ? [drawClamp(space, long / 2, 1)] : []));
    curves = [...trace((t) => trace((s) => place(s, t), 24), across),
      ...trace((s) => trace((t) => place(s, t), across), along)];
    move(phase);

    const spread = 2 * Math.min(1.2, sensorWidth / 2 / state.f); // the width of their field of view
    [...cameras.children].forEach((group, i) => {
      const [azimuth, elevation] = state.c[i], tip = towards(state.c[i]);
      const [cx, cy] = flat(tip), [x, y] = flat(times(tip, 1.08));
      group.replaceChildren(line("tl-sight", [tip, [0, 0, 0]]),
        line("tl-ex-stem", [tip, [tip[0], tip[1], 0]]),
        ...drawCamera(space, tip, 0.16, spread, state.w[1] / state.w[0]),
        circle("tl-ex-hit", cx, cy), text(x, y + 4, `${i + 1}`, "tl-note"));
      fill(group, { "aria-valuenow": azimuth,
        "aria-valuetext": `azimuth ${azimuth}°, elevation ${elevation}°` });
    });
  }
  function move(now) { // the phase in rad
    phase = now;
    fill(shape, { d: bent(curves, Math.cos(phase)) });
  }
  function build() { // a group per camera, which keeps the focus while it moves
    const focused = Number(document.activeElement?.dataset.camera);
    cameras.replaceChildren(...app.state.c.map((_, i) => svg("g", {
      class: "tl-camera", role: "slider", tabindex: 0, style: app.tint(i), "data-camera": i,
      "aria-label": `Camera ${i + 1}`, "aria-valuemin": -360, "aria-valuemax": 360 })));
    const next = cameras.children[Math.min(focused, app.state.c.length - 1)];
    if (focused >= 0) next.focus({ preventScroll: true });
  }

  // --- by pointer: a camera follows it on its side of the hemisphere, and changes sides at the rim
  function turn(i, azimuth, elevation) {
    const turned = azimuth > 180 ? azimuth - 360 : azimuth < -180 ? azimuth + 360 : azimuth;
    app.update({ c: app.state.c.with(i, [turned, clamp(elevation, [STEP, 90])]) });
  }
  function place(held, x, y) {
    const { unit, centre, right, up, viewer } = orbitCameras();
    const a = (x - centre[0]) / unit, b = (centre[1] - y) / unit, off = Math.hypot(a, b);
    if (off > 1 && !held.beyond) held.side *= -1;
    held.beyond = off > 1;
    const depth = held.side * Math.sqrt(Math.max(0, 1 - off * off)), most = Math.max(1, off);
    const v = plus(plus(times(right, a / most), times(up, b / most)), times(viewer, depth));
    const degrees = (angle) => Math.round(angle / RAD / STEP) * STEP;
    turn(held.camera, degrees(Math.atan2(v[0], v[1])), degrees(Math.asin(clamp(v[2], [0, 1]))));
  }
  turnable(node, sight, 0, app.request, ([x, y], event) => {
    const isCamera = event.target.closest("[data-camera]"), { flat, viewer } = orbitCameras();
    const tips = app.state.c.map(towards), places = tips.map(flat);
    const away = places.map(([u, v]) => Math.hypot(x - u, y - v)); // drawings may overlap
    const camera = away.indexOf(Math.min(...away)), [tipX, tipY] = places[camera];
    event.preventDefault();
    (isCamera ? cameras.children[camera] : node).focus({ preventScroll: true });
    if (!isCamera) return null;
    const held = { camera, side: Math.sign(dot(tips[camera], viewer)) || 1, beyond: false };
    return ([nowX, nowY]) => place(held, nowX - x + tipX, nowY - y + tipY);
  });
  cameras.addEventListener("keydown", (event) => {
    const i = Number(event.target.dataset.camera), [x, y] = ARROWS[event.key] ?? [];
    const step = event.shiftKey ? 10 : 1, [azimuth, elevation] = app.state.c[i];
    if (event.key === "Delete") app.remove(i);
    else if (x === undefined) return;
    else turn(i, azimuth + x * step, elevation + y * step);
    event.preventDefault();
  });

  return { node, draw, move, build, remeasure() { size = null; } };
}

// --- the shapes: reference, measured, errors
export function createShapes(app) {
  const node = html("div", { class: "tl-ex-shapes" });
  const drawing = (name, more) => svg("svg", { role: "img", "aria-label": name, ...more });
  let draw, width = 0; // of a chart in px

  function curves() {
    const sample = (cls, words, d = "M1 6H21") => html("span", { style: app.tint(0) },
      svg("svg", { width: 22, height: 12, "aria-hidden": "true" }, path(cls, d)), words);
    const shape = drawing("Deflection of the beam"), bars = drawing("Error of each marker");
    node.replaceChildren(html("p", { class: "tl-ex-key" }, sample("tl-reference", "reference"),
      sample("tl-mark", "measured, pixels as in the thesis", mark(0, 11, 6, 3)),
      sample("tl-ex-band", "expected: ± 2 σ by the law of rounding")), shape, bars);
    const chart = (canvas, height, range, words, title = "") => axes({ canvas }, width,
      [0, 1000 * app.structure.length], range, title, words, { height, margin: SMALL, rows: height / 40 });
    return ({ reference, measured, variance, errors: { point } }, amplitude) => {
      width ||= shape.clientWidth || 380;
      const at = markers(app.structure)[0].map((x) => 1000 * x), style = app.tint(0);
      const [low, high] = [-2, 2].map((k) =>
        reference.map((w, i) => w + k * Math.sqrt(variance[i])));
      const most = (1000 * Math.max(...[...measured, ...low, ...high].map(Math.abs))) / amplitude;
      const limit = amplitude * above(most, [1.25, 1.5, 2, 3, 5, 10, 30, 100, 1000]);
      const upper = chart(shape, width < 480 ? 150 : 200, [-limit, limit], "deflection (mm)");
      const trail = (values) => at.map((x, i) => [upper.x(x), upper.y(1000 * values[i])]);
      shape.append(path("tl-ex-band", lines([...trail(high), ...trail(low).reverse()], "Z")),
        path("tl-reference", lines(trail(reference))),
        svg("g", { style }, path("tl-line", lines(trail(measured))),
          path("tl-mark", trail(measured).map((one) => mark(0, ...one, 2.6)).join(""))));
      const { x, y } = chart(bars, 130, [0, above(Math.max(...point), PERCENT)],
        "error of each marker (%)", `${width < 360 ? "" : "distance "}from the clamp (mm)`);
      const columns = at.map((v, i) => `M${x(v)} ${y(0)}V${y(point[i])}`).join("");
      bars.append(path("tl-ex-bars", columns, { style }));
    };
  }

  function maps() {
    const [nx, ny] = app.structure.grid;
    const shown = ["reference", "measured", "marker errors"].map((name, n) => {
      const cells = Array.from({ length: nx * ny }, (_, i) => // a little wider, to avoid gaps
        svg("rect", { x: i % nx, y: ny - 1 - Math.floor(i / nx), width: 1.03, height: 1.03 }));
      const canvas = drawing(`Map: ${name}`,
        { viewBox: `0 0 ${nx} ${ny}`, preserveAspectRatio: "none" });
      canvas.append(...cells);
      const colors = app.colormap.slice(n < 2 ? 0 : app.colormap.length >> 1); // errors: from zero
      const scale = html("div");
      return { cells, colors, scale,
        node: html("figure", {}, html("figcaption", {}, name), canvas, scale) };
    });
    node.replaceChildren(...shown.map((map) => map.node));
    return ({ reference, measured, errors: { point, largest } }) => {
      const most = Math.max(...reference.map(Math.abs)), limit = above(largest, PERCENT);
      [reference, measured, point].forEach((values, n) => {
        const { cells, colors, scale } = shown[n], full = n < 2 ? most : limit;
        cells.forEach((cell, i) =>
          fill(cell, { fill: colourOf(app.colormap, values[i] || 0, full) }));
        scale.replaceChildren(n < 2 ? colourBar(colors, 1000 * most, "mm")
          : colourBar(colors, limit, "%", "", 0));
      });
    };
  }

  return {
    node,
    remeasure() { width = 0; },
    build() {
      node.dataset.kind = app.structure.kind;
      draw = app.structure.kind === "beam" ? curves() : maps();
    },
    draw: () => draw(app.result, app.state.a),
  };
}
