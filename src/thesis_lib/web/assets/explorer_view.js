// The explorer's view: the structure, bent, and cameras around it to be dragged along their
// hemisphere. World coordinates are in units of the cameras' distance and looked at from far away.
// `app` is what explorer.js offers.
import { bent } from "./motion.js";
import { clamp, fill, followDrag, lines, path, svg, text } from "./parts.js";
import { modeShape, towards } from "./physics.js";
import {
  RAD, SQUARE, baseOf, dot, drawAxes, drawClamp, drawHemisphere, edgesOf, orbit, plus, times, trace,
} from "./space.js";

const STEP = 0.5; // degrees, of a dragged camera, and its least elevation
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export function createView(app) {
  const sight = { azimuth: 158, elevation: 33 };
  const scene = svg("g"), shape = path("tl-mesh"), cameras = svg("g");
  const node = svg("svg", { class: "tl-ex-view", role: "group", tabindex: 0,
    "aria-label": "The cameras around the structure; arrow keys turn the view" },
  scene, shape, cameras);
  let curves = [], phase = 0;
  let size = null; // px; asking for it in every frame would lay out the page in between

  function projection() {
    const [width, height] = (size ??= [node.clientWidth || 480, node.clientHeight || 360]);
    const sine = Math.sin(sight.elevation * RAD);
    const unit = Math.min((width - 50) / 2, (height - 44) / (1 + sine));
    const centre = [width / 2, height / 2 + (unit * (1 - sine)) / 2];
    return { width, height, unit, centre, ...orbit(sight, unit, centre) };
  }

  function draw() {
    const { state, structure, sensorWidth } = app, space = projection();
    const { flat, line, unit } = space;
    const sides = [structure.length, structure.width], [long, wide] = times(sides, 1000 / state.d);
    const isBeam = structure.kind === "beam", [along, across] = isBeam ? [24, 1] : [12, 8];
    const rise = 0.06 * long * unit * Math.cos(sight.elevation * RAD); // drawn larger than it is
    const place = (s, t) => [...flat([(s - 0.5) * long, (t - 0.5) * wide, 0]),
      rise * modeShape(structure, state.m, s * sides[0], t * sides[1])];
    fill(node, { viewBox: `0 0 ${space.width} ${space.height}` });
    scene.replaceChildren(
      ...drawHemisphere(space, 1), ...drawAxes(space, [long / 2, wide / 2, 0], 0.16),
      line("tl-ex-rest", SQUARE.map(([u, v]) => [(u * long) / 2, (v * wide) / 2, 0]), "Z"),
      ...(isBeam ? [drawClamp(space, long / 2, 1)] : []));
    curves = [...trace((t) => trace((s) => place(s, t), 24), across),
      ...trace((s) => trace((t) => place(s, t), across), along)];
    move(phase);

    const spread = 2 * Math.min(1.2, sensorWidth / 2 / state.f); // as wide as what they see
    [...cameras.children].forEach((group, i) => {
      const [azimuth, elevation] = state.c[i], tip = towards(state.c[i]);
      const base = baseOf(tip, azimuth, elevation, 0.16, spread, state.w[1] / state.w[0]);
      const paths = [[tip, [0, 0, 0]], [tip, [tip[0], tip[1], 0]], base];
      const [cx, cy] = flat(tip), [x, y] = flat(times(tip, 1.08));
      [...paths.map((points, n) => lines(points.map(flat), n > 1 ? "Z" : "")),
        edgesOf(space, tip, base)].forEach((d, n) => fill(group.children[n], { d }));
      fill(group.children[4], { cx, cy });
      fill(group.children[5], { x, y: y + 4 });
      fill(group, { "aria-valuenow": azimuth,
        "aria-valuetext": `azimuth ${azimuth}°, elevation ${elevation}°` });
    });
  }

  function move(now) { // the phase in rad
    phase = now;
    fill(shape, { d: bent(curves, Math.cos(phase)) });
  }

  function build() { // a drawing for each camera, which keeps the focus while it moves
    const focused = Number(document.activeElement?.dataset.camera);
    cameras.replaceChildren(...app.state.c.map((_, i) => svg("g", {
      class: "tl-camera", role: "slider", tabindex: 0, style: app.tint(i), "data-camera": i,
      "aria-label": `Camera ${i + 1}`, "aria-valuemin": -360, "aria-valuemax": 360,
    }, path("tl-sight"), path("tl-ex-stem"), path("tl-base"), path(),
    svg("circle", { class: "tl-ex-hit" }), text(0, 0, `${i + 1}`, "tl-note"))));
    const next = cameras.children[Math.min(focused, app.state.c.length - 1)];
    if (focused >= 0) next.focus({ preventScroll: true });
  }

  // --- by pointer: a camera follows it on its side of the hemisphere, and changes sides at the rim
  function turn(i, azimuth, elevation) {
    const turned = azimuth > 180 ? azimuth - 360 : azimuth < -180 ? azimuth + 360 : azimuth;
    const pair = [turned, clamp(elevation, [STEP, 90])];
    app.update({ c: app.state.c.with(i, pair) });
  }
  function look(azimuth, elevation) {
    sight.azimuth += azimuth;
    sight.elevation = clamp(sight.elevation + elevation, [0, 90]);
    app.request();
  }
  function place(held, x, y) {
    const { unit, centre, right, up, viewer } = projection();
    const a = (x - centre[0]) / unit, b = (centre[1] - y) / unit, off = Math.hypot(a, b);
    if (off > 1 && !held.beyond) held.side *= -1;
    held.beyond = off > 1;
    const depth = held.side * Math.sqrt(Math.max(0, 1 - off * off)), most = Math.max(1, off);
    const v = plus(plus(times(right, a / most), times(up, b / most)), times(viewer, depth));
    const degrees = (angle) => Math.round(angle / RAD / STEP) * STEP;
    turn(held.camera, degrees(Math.atan2(v[0], v[1])), degrees(Math.asin(clamp(v[2], [0, 1]))));
  }
  function nearest(x, y) { // of cameras whose drawings may lie on each other
    const away = (group) => {
      const { left, top, width, height } = group.querySelector("circle").getBoundingClientRect();
      return Math.hypot(x - left - width / 2, y - top - height / 2);
    };
    return [...cameras.children].reduce((a, b) => (away(b) < away(a) ? b : a));
  }
  followDrag(node, (event) => {
    const { clientX: x, clientY: y } = event;
    const group = event.target.closest("[data-camera]") && nearest(x, y);
    (group ?? node).focus({ preventScroll: true });
    event.preventDefault();
    if (!group) return (now) => {
      look((now.clientX - event.clientX) * 0.5, (now.clientY - event.clientY) * 0.4);
      event = now;
    };
    const { flat, viewer } = projection(), camera = Number(group.dataset.camera);
    const tip = towards(app.state.c[camera]), [tipX, tipY] = flat(tip);
    const held = { camera, side: Math.sign(dot(tip, viewer)) || 1, beyond: false };
    return (now) => place(held, now.clientX - x + tipX, now.clientY - y + tipY);
  });
  node.addEventListener("wheel", (event) => { // once the view has the focus: else the page scrolls
    if (!node.contains(document.activeElement) || !event.deltaY) return;
    event.preventDefault();
    app.update({ d: Math.round((app.state.d * 1.04 ** Math.sign(event.deltaY)) / 5) * 5 });
  }, { passive: false });

  // --- by keyboard
  node.addEventListener("keydown", (event) => {
    const [x, y] = ARROWS[event.key] ?? [0, 0], step = event.shiftKey ? 10 : 1;
    const group = event.target.closest("[data-camera]"), i = Number(group?.dataset.camera);
    if (group && event.key === "Delete") app.remove(i);
    else if (!x && !y) return;
    else if (group) turn(i, app.state.c[i][0] + x * step, app.state.c[i][1] + y * step);
    else look(8 * x, 6 * y);
    event.preventDefault();
  });

  return { node, draw, move, build, remeasure() { size = null; } };
}
