// The explorer's view: the structure, bent, and cameras around it to be dragged along their hemisphere. World
// coordinates are in units of the cameras' distance and looked at from far away. `app` is what explorer.js offers.
import model from "./explorer_model.js";
import states from "./explorer_state.js";
import { bent } from "./motion.js";
import { fill, lines, path, svg, text } from "./parts.js";
import { SQUARE, dot, plus, times, trace } from "./space.js";

export default (app) => {
  const STEP = 0.5; // degrees, of a dragged camera, and its least elevation
  const { toward, radians, within } = states, sight = { azimuth: 158, elevation: 33 };
  const moved = (v, k, u) => plus(v, times(u, k));
  const scene = svg("g"), shape = path("tl-mesh"), cameras = svg("g");
  const node = svg("svg", { class: "tl-ex-view", role: "group", tabindex: 0,
    "aria-label": "The cameras around the structure; arrow keys turn the view" }, scene, shape, cameras);
  let curves = [], phase = 0, drag = null, size = null; // px; asking for it in every frame would lay out the page in between

  function projection() {
    const [right, down, forward] = model.hemisphereRotation(...radians([sight.azimuth, sight.elevation]));
    const [width, height] = (size ??= [node.clientWidth || 480, node.clientHeight || 360]);
    const sine = Math.sin(radians([sight.elevation])[0]), unit = Math.min((width - 50) / 2, (height - 44) / (1 + sine));
    const centre = [width / 2, height / 2 + (unit * (1 - sine)) / 2];
    return { width, height, right, down, forward, unit, centre,
      flat: (v) => [centre[0] + unit * dot(v, right), centre[1] + unit * dot(v, down)] };
  }

  function draw() {
    const { state, structure, sensorWidth } = app, { width, height, unit, flat } = projection();
    const line = (cls, points, end) => path(cls, lines(points.map(flat), end));
    const sides = [structure.length, structure.width], [long, wide] = times(sides, 1000 / state.d);
    const isBeam = structure.kind === "beam", [along, across] = isBeam ? [24, 1] : [12, 8];
    const rise = 0.06 * long * unit * Math.cos(radians([sight.elevation])[0]); // drawn larger than it is
    const place = (s, t) => [...flat([(s - 0.5) * long, (t - 0.5) * wide, 0]),
      rise * model.modeShape(structure, state.m, s * sides[0], t * sides[1])];
    const axes = [["X", [1, 0, 0], long / 2], ["Y", [0, 1, 0], wide / 2], ["Z", [0, 0, 1], 0]];
    fill(node, { viewBox: `0 0 ${width} ${height}` });
    scene.replaceChildren(
      ...[0, 30, 60].map((elevation) => line("tl-wire", trace((t) => toward([360 * t, elevation]), 48))),
      ...[0, 45, 90, 135].map((azimuth) => line("tl-wire", trace((t) => toward([azimuth, 180 * t]), 48))),
      ...axes.flatMap(([name, axis, from]) => [line("tl-axis", [times(axis, from), times(axis, from + 0.16)]),
        text(...flat(times(axis, from + 0.21)), name, "tl-muted")]),
      line("tl-ex-rest", SQUARE.map(([u, v]) => [(u * long) / 2, (v * wide) / 2, 0]), "Z"),
      ...(isBeam ? [line("tl-clamp", SQUARE.map(([u, v]) => [-long / 2, u * 0.07, v * 0.05]), "Z")] : []));
    curves = [...trace((t) => trace((s) => place(s, t), 24), across),
      ...trace((s) => trace((t) => place(s, t), across), along)];
    move(phase);

    const depth = 0.16, spread = depth * Math.min(1.2, sensorWidth / 2 / state.f); // pyramids as wide as what they see
    [...cameras.children].forEach((group, i) => {
      const tip = toward(state.c[i]), [x, y] = model.hemisphereRotation(...radians(state.c[i]));
      const base = SQUARE.map(([u, v]) =>
        moved(moved(times(tip, 1 - depth), spread * u, x), (spread * v * state.w[1]) / state.w[0], y));
      const ray = [tip, [0, 0, 0]], stem = [tip, [tip[0], tip[1], 0]];
      const edges = base.map((corner) => lines([tip, corner].map(flat))).join("");
      [lines(ray.map(flat)), lines(stem.map(flat)), lines(base.map(flat), "Z"), edges].forEach((d, n) =>
        fill(group.children[n], { d }));
      const [cx, cy] = flat(tip), [labelX, labelY] = flat(times(tip, 1.08)), [azimuth, elevation] = state.c[i];
      fill(group.children[4], { cx, cy });
      fill(group.children[5], { x: labelX, y: labelY + 4 });
      fill(group, { "aria-valuenow": azimuth, "aria-valuetext": `azimuth ${azimuth}°, elevation ${elevation}°` });
    });
  }

  function move(now) { // the phase in rad
    phase = now;
    fill(shape, { d: bent(curves, Math.cos(phase)) });
  }

  function build() { // a drawing for each camera, which keeps the focus while it moves
    const focused = Number(document.activeElement?.dataset.camera);
    cameras.replaceChildren(...app.state.c.map((_, i) => svg("g", { class: "tl-camera", role: "slider", tabindex: 0,
      style: app.tint(i), "data-camera": i, "aria-label": `Camera ${i + 1}`, "aria-valuemin": -360, "aria-valuemax": 360 },
    path("tl-sight"), path("tl-ex-stem"), path("tl-base"), path(), svg("circle", { class: "tl-ex-hit" }),
    text(0, 0, `${i + 1}`, "tl-note"))));
    if (focused >= 0) cameras.children[Math.min(focused, app.state.c.length - 1)].focus({ preventScroll: true });
  }

  // --- by pointer: a camera follows it on its side of the hemisphere, and changes sides at the rim
  function turn(i, azimuth, elevation) {
    const turned = azimuth > 180 ? azimuth - 360 : azimuth < -180 ? azimuth + 360 : azimuth;
    app.update({ c: app.state.c.map((old, n) => (n === i ? [turned, within(elevation, [STEP, 90])] : old)) });
  }
  function look(azimuth, elevation) {
    sight.azimuth += azimuth;
    sight.elevation = within(sight.elevation + elevation, [0, 90]);
    app.request();
  }
  function place(x, y) {
    const { unit, centre, right, down, forward } = projection(), a = (x - centre[0]) / unit, b = (y - centre[1]) / unit;
    const off = Math.hypot(a, b), depth = Math.sqrt(Math.max(0, 1 - off * off));
    if (off > 1 && !drag.beyond) drag.side *= -1;
    drag.beyond = off > 1;
    const v = moved(moved(times(right, a / Math.max(1, off)), b / Math.max(1, off), down), drag.side * depth, forward);
    const degrees = (angle) => Math.round((angle * 180) / Math.PI / STEP) * STEP;
    turn(drag.camera, degrees(Math.atan2(v[0], v[1])), degrees(Math.asin(within(v[2], [0, 1]))));
  }
  function nearest(x, y) { // of cameras whose drawings may lie on each other
    const away = (group) => {
      const { left, top, width, height } = group.querySelector("circle").getBoundingClientRect();
      return Math.hypot(x - left - width / 2, y - top - height / 2);
    };
    return [...cameras.children].reduce((a, b) => (away(b) < away(a) ? b : a));
  }
  node.addEventListener("pointerdown", (event) => {
    if (drag || event.button) return;
    const { clientX: x, clientY: y } = event, on = event.target.closest("[data-camera]");
    const group = on && nearest(x, y);
    node.setPointerCapture(event.pointerId);
    (group ?? node).focus({ preventScroll: true });
    event.preventDefault();
    drag = { x, y };
    if (!group) return;
    const { flat, forward } = projection(), camera = Number(group.dataset.camera);
    const tip = toward(app.state.c[camera]), [tipX, tipY] = flat(tip); // where it is, beside where it was taken
    drag = { camera, side: Math.sign(dot(tip, forward)) || 1, x: x - tipX, y: y - tipY };
  });
  node.addEventListener("pointermove", ({ pointerId, clientX: x, clientY: y }) => {
    if (!drag || !node.hasPointerCapture(pointerId)) return;
    if (drag.camera !== undefined) return place(x - drag.x, y - drag.y);
    look((x - drag.x) * 0.5, (y - drag.y) * 0.4);
    Object.assign(drag, { x, y });
  });
  ["pointerup", "pointercancel"].forEach((name) => node.addEventListener(name, () => { drag = null; }));
  node.addEventListener("wheel", (event) => { // once the view has the focus: else the page scrolls
    if (!node.contains(document.activeElement) || !event.deltaY) return;
    event.preventDefault();
    app.update({ d: Math.round((app.state.d * 1.04 ** Math.sign(event.deltaY)) / 5) * 5 });
  }, { passive: false });

  // --- by keyboard
  const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  node.addEventListener("keydown", (event) => {
    const [x, y] = KEYS[event.key] ?? [0, 0], step = event.shiftKey ? 10 : 1;
    const group = event.target.closest("[data-camera]"), i = Number(group?.dataset.camera);
    if (group && event.key === "Delete") app.remove(i);
    else if (!x && !y) return;
    else if (group) turn(i, app.state.c[i][0] + x * step, app.state.c[i][1] + y * step);
    else look(8 * x, 6 * y);
    event.preventDefault();
  });

  return { node, draw, move, build, remeasure() { size = null; } };
};
