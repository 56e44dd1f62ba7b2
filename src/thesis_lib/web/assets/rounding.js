// Small experiments on the law of rounding. Front end of thesis_lib.book.explorer.
import { axes } from "./chart.js";
import {
  asked, button, circle, clamp, figure, fill, fixed, followDrag, followWidth, html, keep, lines,
  path, resize, svg, text,
} from "./parts.js";
import { markers, measureDeflections, randomNumber, simulateSetting } from "./physics.js";
import { pixelate, radians } from "./pinhole.js";

// --- shared parts: controls, panels that are redrawn on changes, random draws
const average = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const rms = (values) => Math.sqrt(average(values.map((value) => value * value)));
const action = (words, onClick) => button(words, { class: "tl-play" }, onClick);

// A slider for a key of the state, from a row of an experiment.
function createSlider(state, set, [words, key, , [min, max], step, digits, unit]) {
  const shown = html("b"), box = html("input", { type: "range", min, max, step,
    oninput: () => set({ [key]: Number(box.value) }) });
  const node = html("label", { class: "tl-field tl-demo-slider" },
    html("span", {}, `${words} `, shown), box);
  return { node, key, box, refresh() {
    box.value = state[key];
    shown.textContent = `${fixed(state[key], digits)}${unit}`;
    fill(box, { "aria-valuetext": shown.textContent });
  } };
}

// An experiment: `build` returns its buttons, a `model` for tests, `reset`, called when the state
// changes, and `draw(widths)`, which returns the text below and may `request` one more frame.
function render({ model, el }) {
  const [name, label, letters, build, ...rows] = EXPERIMENTS[model.get("experiment")];
  const status = html("p", { class: "tl-summary", role: "status" });
  const panels = Object.fromEntries(
    letters.map((letter) => [letter, figure(letter, svg("svg", { role: "img" }))]));
  const state = Object.fromEntries(rows.map(([, key, usual]) => [key, usual]));
  let waiting = 0, drawn = 0;
  const request = () => { waiting ||= requestAnimationFrame(refresh); };
  const random = () => randomNumber(drawn += 1); // in [0, 1), the same on every visit
  const set = (changes) => {
    Object.assign(state, changes);
    built.reset?.();
    request();
  };
  const built = build({ ...panels, ...model.get("data"), state, set, request, random });
  const sliders = rows.map((row) => createSlider(state, set, row));
  const remember = () => // in the URL
    keep(Object.fromEntries(rows.map(([, key, usual]) =>
      [`${name}-${key}`, state[key] === usual ? null : state[key]])));
  for (const { key, box } of sliders) { // the browser limits it to the slider's range and steps
    const given = Number(asked(`${name}-${key}`) || NaN);
    box.value = Number.isNaN(given) ? state[key] : given;
    state[key] = Number(box.value);
  }
  const handlers = { onchange: remember, onclick: remember, onpointerup: remember };
  const root = html("section", { class: "tl-viewer tl-demo", "aria-label": label, ...handlers },
    html("div", { class: "tl-controls" }, sliders.map(({ node }) => node), built.buttons),
    html("div", { class: "tl-grid" }, Object.values(panels).map(({ node }) => node)), status);
  function refresh() {
    waiting = 0;
    root.classList.toggle("tl-wide", root.clientWidth > 640);
    sliders.forEach((one) => one.refresh());
    status.textContent = built.draw(Object.fromEntries(
      letters.map((letter) => [letter, panels[letter].canvas.clientWidth || 480])));
  }
  root.demo = { state, set, ...built.model }; // for tests
  el.replaceChildren(root);
  refresh();
  followWidth(root, request);
}

// Text above a panel, also for screen readers, and below it.
function entitlePanel({ canvas, caption, foot }, words, more, below = "") {
  caption.textContent = words;
  fill(canvas, { "aria-label": `${words}. ${more}` });
  foot.textContent = below;
}
const chart = (panel, width, across, up, xTitle, yTitle) =>
  axes(panel, width, across, up, xTitle, yTitle, { columns: width < 420 ? 4 : 7 });

// --- one marker on one pixel grid: its motion after rounding, and the law from random draws
function buildMarker({ a, b, c, state, set, request, random }) {
  const REST = 0.2, MAX_MOTION = 3, DRAWS = 200, found = new Map(); // px, px, draws, errors drawn
  const hundredth = (value) => Math.round(100 * value) / 100;
  const law = (motion) => Math.sqrt((motion % 1) * (1 - (motion % 1)));
  // Images at rest and moved, in whole pixels of a shifted grid, and the error of their difference.
  function measured(motion, shift) {
    const [from, to] = pixelate(Float64Array.of(REST + shift, REST + motion + shift));
    return { from: from - shift, to: to - shift, error: to - from - motion };
  }
  function draws(motion) {
    const errors = Array.from({ length: DRAWS }, () => measured(motion, random() - 0.5).error);
    found.set(motion, [...(found.get(motion) ?? []), ...errors]);
  }
  let sweep = [];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const buttons = [
    action("One random grid", () => set({ shift: hundredth(random() - 0.5) })),
    action(`${DRAWS} random grids`, () => { draws(state.motion); request(); }),
    action("… for every motion", () => {
      sweep = Array.from({ length: 60 }, (_, i) => (i + 1) / 20);
      request();
    }),
  ];

  // (a) the grid: pixels as boxes around their centres, the marker at rest and moved
  let unit = 1;
  const x = (u) => (u + 1) * unit;
  followDrag(a.canvas, ([x0], event) => {
    event.preventDefault();
    const from = { ...state };
    if (Math.abs(x0 - x(REST + state.motion)) < 24) return ([now]) =>
      set({ motion: clamp(hundredth(from.motion + (now - x0) / unit), [0, MAX_MOTION]) });
    return ([now]) => {
      const shift = from.shift - (now - x0) / unit;
      set({ shift: hundredth(shift - Math.round(shift)) });
    };
  });
  function drawGrid(width) {
    unit = width / (MAX_MOTION + 2.5);
    const { motion, shift } = state, { from, to } = measured(motion, shift), middle = 74;
    const cells = Array.from({ length: MAX_MOTION + 5 }, (_, i) => i - 2 - shift);
    const isHit = (cell) => [from, to].some((one) => Math.abs(cell - one) < 1e-6);
    const arrow = (y, one, two, cls) => path(cls, `M${x(one)} ${y - 5}v10M${x(one)} ${y}H${x(two)}` +
      (two > one ? "m-7 -4l7 4l-7 4" : ""));
    resize(a, width, 168).replaceChildren(
      ...cells.map((cell) => svg("rect", { x: x(cell - 0.5), y: middle - 22, width: unit, height: 44,
        class: `tl-demo-pixel${isHit(cell) ? " tl-demo-hit" : ""}` })),
      ...cells.map((cell) => path("tl-axis", `M${x(cell)} ${middle + 18}v8`)),
      circle("tl-demo-rest", x(REST), middle, 8),
      circle("tl-demo-moved", x(REST + motion), middle, 8),
      arrow(30, REST, REST + motion, "tl-demo-true"), arrow(124, from, to, "tl-demo-read"),
      text(x(REST), 18, `moves by ${fixed(motion, 2)} px`, "tl-demo-truth", "start"),
      text(x(from), 146, `measured: ${fixed(to - from, 0)} px`, "tl-demo-reading", "start"));
    entitlePanel(a, "Drag the moved marker, or the grid",
      `It moves by ${fixed(motion, 2)} px and is measured as ${fixed(to - from, 0)} px.`);
  }

  function drawShifts(width) { // (b) the error for every shift of the grid
    const { motion, shift } = state, one = law(motion);
    const at = chart(b, width, [-0.5, 0.5], [-1, 1], "shift of the grid, px", "error, px");
    let d = "", last = null;
    for (let i = 0; i <= 400; i += 1) {
      const s = (i - 200) / 400, { error } = measured(motion, s);
      d += lines([[at.x(s), at.y(error)]]).replace("M", last === error ? "L" : "M");
      last = error;
    }
    b.canvas.append(
      ...[one, -one].map((v) => path("tl-demo-law", `M${at.x(-0.5)} ${at.y(v)}H${at.right}`)),
      path("tl-demo-step", d),
      circle("tl-demo-moved", at.x(shift), at.y(measured(motion, shift).error), 6));
    entitlePanel(b, "Its error on every grid",
      `Two values, one pixel apart; their rms is ${fixed(one, 2)} px.`,
      "dashed: ± rms error by the law");
  }

  function drawCurve(width) { // (c) rms errors of the draws compared with the law
    const at = chart(c, width, [0, MAX_MOTION], [0, 0.6], "motion δ, px", "rms error, px");
    const dot = (cls, motion, error, r) => circle(cls, at.x(motion), at.y(error), r);
    const points = Array.from({ length: 301 }, (_, i) => (i * MAX_MOTION) / 300)
      .map((motion) => [at.x(motion), at.y(law(motion))]);
    c.canvas.append(path("tl-demo-law", lines(points)),
      ...[...found].map(([motion, errors]) => dot("tl-demo-dot", motion, rms(errors), 3)),
      dot("tl-demo-ring", state.motion, law(state.motion), 6));
    entitlePanel(c, "The rms error of every motion",
      "It is zero for whole pixels and half a pixel for half ones.",
      `dashed: the law √(f(1 − f)); dots: rms of ${DRAWS} grids or more`);
  }

  function draw(width) {
    if (sweep.length) {
      sweep.splice(0, still.matches ? sweep.length : 1).forEach(draws);
      if (sweep.length) request();
    }
    drawGrid(width.a);
    drawShifts(width.b);
    drawCurve(width.c);
    const { motion } = state, whole = Math.floor(motion + 1e-9), f = Math.max(0, motion - whole);
    const errors = found.get(motion), share = (part) => `${fixed(100 * part, 0)} of 100 grids`;
    const drawn = errors ? ` Of ${errors.length} draws: ${fixed(rms(errors), 3)} px.` : "";
    if (f < 1e-9) return `A motion of ${whole} px is measured without error on every grid.${drawn}`;
    return `${share(1 - f)} measure ${whole} px, an error of −${fixed(f, 2)} px; ${share(f)} measure ` +
      `${whole + 1} px, an error of +${fixed(1 - f, 2)} px. The rms of all is ` +
      `√(${fixed(f, 2)} · ${fixed(1 - f, 2)}) = ${fixed(law(motion), 3)} px.${drawn}`;
  }
  return { buttons, draw, model: { found, law, measured } };
}

// --- two cameras and a point, in their common plane: pixels are strips; two of them give a height
function buildPoint({ a, b, state, set, request, random }) {
  const DISTANCE = 500, FOCAL = (24 / 36) * 320, SPAN = DISTANCE / FOCAL; // mm, px, mm/px
  const DRAWS = 400, MAX_DEFLECTION = 6; // draws, mm
  let shifts = [0, 0], errors = [];
  // Image coordinates of the camera on each side, in px, increase with X by `along`, with Z by `up`.
  const rows = (phi) => [-1, 1].map((side) =>
    ({ along: (-side * Math.sin(phi)) / SPAN, up: Math.cos(phi) / SPAN }));
  // Motion of both images in px, its fractional part, ∂Z/∂m in mm/px, standard deviation of w in mm.
  function law({ deflection, elevation }) {
    const [phi] = radians([elevation]), delta = deflection * rows(phi)[0].up;
    const f = delta - Math.floor(delta);
    const g = SPAN / (2 * Math.cos(phi));
    return { phi, delta, f, g, sigma: g * Math.sqrt(2 * f * (1 - f)) };
  }
  function measured(cast) { // triangulated points at rest and moved, and the error
    const { phi, g } = law(state), by = rows(phi);
    const rebuild = (z) => {
      const m = by.map(({ up }, i) => pixelate(Float64Array.of(up * z + cast[i]))[0] - cast[i]);
      return { x: (m[0] - m[1]) / (2 * by[0].along), z: g * (m[0] + m[1]), m };
    };
    const rest = rebuild(0), moved = rebuild(state.deflection);
    return { rest, moved, error: moved.z - rest.z - state.deflection };
  }
  const cast = () => [random() - 0.5, random() - 0.5];
  const buttons = [
    action("One random pair of grids", () => { shifts = cast(); request(); }),
    action(`${DRAWS} random pairs`, () => {
      errors.push(...Array.from({ length: DRAWS }, () => measured(cast()).error));
      request();
    }),
  ];

  const height = 300, unit = height / 12;
  followDrag(a.canvas, ([, y0], event) => {
    event.preventDefault();
    const from = state.deflection, twentieth = (mm) => Math.round(mm * 20) / 20;
    return ([, y]) => set({ deflection: clamp(twentieth(from + (y0 - y) / unit), [0, MAX_DEFLECTION]) });
  });
  function drawSection(width) { // around the point, a few mm
    const { rest, moved } = measured(shifts), half = width / 2 / unit, far = half + 12;
    const x = (mm) => width / 2 + mm * unit, y = (mm) => height - 3 * unit - mm * unit;
    const strips = rows(law(state).phi).map(({ along, up }, i) => {
      const size = Math.hypot(along, up), [nx, nz] = [along / size, up / size];
      const pixel = (m, cls) => svg("rect", { class: cls, x: ((m - 0.5) * unit) / size,
        y: -far * unit, width: unit / size, height: 2 * far * unit });
      const many = Math.ceil(far * size), strip = `tl-demo-strip tl-demo-side${i}`;
      return svg("g", { transform: `matrix(${[nx, -nz, nz, nx, x(0), y(0)]})` },
        Array.from({ length: 2 * many + 1 }, (_, k) => pixel(k - many - shifts[i], "tl-gridline")),
        pixel(rest.m[i], strip), pixel(moved.m[i], `${strip} tl-demo-strong`));
    });
    const cross = ({ x: px, z }) =>
      path("tl-demo-cross", `M${x(px) - 7} ${y(z) - 7}l14 14m-14 0l14 -14`);
    resize(a, width, height).replaceChildren(...strips,
      path("tl-demo-true", `M${x(0)} ${y(0)}V${y(state.deflection)}`),
      circle("tl-demo-rest", x(0), y(0), 7), circle("tl-demo-moved", x(0), y(state.deflection), 7),
      cross(rest), cross(moved),
      path("tl-axis", `M12 ${height - 12}h${2 * unit}m0 -4v8m${-2 * unit} 0v-8`),
      text(18 + 2 * unit, height - 8, "2 mm", null, "start"),
      text(6, 16, "↖ camera 1", "tl-note", "start"),
      text(width - 6, 16, "camera 2 ↗", "tl-note", "end"));
    const [got, right] = [moved.z - rest.z, state.deflection].map((mm) => `${fixed(mm, 2)} mm`);
    entitlePanel(a, "The plane of both cameras around the point; drag it up",
      `Measured deflection ${got}, true ${right}.`,
      "circles: true; crosses: where the middle of the strips meets");
  }

  function drawErrors(width) { // histogram of the errors
    const { f, g, sigma } = law(state), most = Math.max(1, 1.3 * 2 * g);
    const { x, y, bottom } = chart(b, width, [-most, most], [0, 1],
      "error of the deflection, mm", "share of the draws");
    const chances = [[-2 * f, (1 - f) ** 2], [1 - 2 * f, 2 * f * (1 - f)], [2 - 2 * f, f * f]];
    b.canvas.append(...chances.flatMap(([gains, chance]) => {
      const middle = x(g * gains), hits = errors.filter((one) => Math.abs(one - g * gains) < 1e-6);
      const top = y(hits.length / (errors.length || 1));
      return [svg("rect", { class: "tl-demo-bar", x: middle - 6, y: top, width: 12,
        height: Math.max(0, bottom - top) }),
      path("tl-demo-expected", `M${middle - 11} ${y(chance)}h22`)];
    }), ...[sigma, -sigma].map((v) => path("tl-demo-law", `M${x(v)} ${bottom}V${y(1)}`)));
    entitlePanel(b, "Errors on random pairs of grids",
      `Standard deviation by the law ${fixed(sigma, 2)} mm.`,
      "lines: expected shares; bars: drawn; dashed: ± one standard deviation by the law");
  }

  function draw(width) {
    drawSection(width.a);
    drawErrors(width.b);
    const { delta, f, g, sigma } = law(state), part = `g² · ${fixed(f * (1 - f), 3)}`;
    return `Both images move by δ = w cos φ · c/R = ${fixed(delta, 2)} px. A pixel more in one of ` +
      `them raises the point by g = ${fixed(g, 2)} mm. So the error is √(${part} + ${part}) = ` +
      `${fixed(sigma, 2)} mm.` +
      (errors.length ? ` Of ${errors.length} draws: ${fixed(rms(errors), 2)} mm.` : "");
  }
  return { buttons, draw, reset() { errors = []; }, model: { law, errors: () => errors } };
}

// --- many cameras and a beam: errors of its markers in trials and by the law, by number of cameras
function buildBeam({ a, b, c, state, set, request, random, structure, sensorWidth }) {
  const SIZE = [320, 180], MAX_COUNT = 24, DRAWS = 400; // px, cameras, draws
  const places = markers(structure)[0].map((x) => 1000 * x), focal = (24 / sensorWidth) * SIZE[0];
  let scene = null;
  function seen(count) { // constant over the draws; cameras are equally spaced, none on an
    const cameras = Array.from({ length: count }, // axis of the beam
      (_, i) => [((i + 0.3) * 360) / count, state.elevation]);
    const setting = { distance: 500, cameras, focal, size: SIZE };
    const shapes = [{ mode: state.mode, peak: state.amplitude / 1000 }];
    const { P, rest, modes: [mode] } = simulateSetting(setting, structure, shapes);
    return { P, rest, ...mode };
  }
  const inMm = (variances) => Array.from(variances, (one) => 1000 * Math.sqrt(one));
  const rise = (variances) => 1000 * Math.sqrt(average(variances)); // over all markers, mm
  const drawn = () => scene.squares.map((sum) => sum / scene.draws);
  function prepare() {
    scene = { ...seen(state.cameras), draws: 0, squares: places.map(() => 0), last: null };
    scene.curve = Array.from({ length: MAX_COUNT - 1 }, (_, i) => [i + 2, rise(seen(i + 2).variance)]);
  }
  function one() { // one more draw
    const { P, rest, deflected, reference, squares } = scene;
    const shifts = Float64Array.from({ length: 2 * state.cameras }, () => random() - 0.5);
    scene.last = measureDeflections(P, rest, deflected, shifts);
    scene.last.forEach((w, i) => { squares[i] += (w - reference[i]) ** 2; });
    scene.draws += 1;
  }
  const buttons = [action("Draw again", () => set({}))];

  function drawAlong(panel, width, up, title, curve, cls, dots, dotCls) { // a curve and dots, in mm
    const { x, y } = chart(panel, width, [0, 1000 * structure.length], up, "along the beam, mm", title);
    panel.canvas.append(path(cls, lines(Array.from(curve, (v, i) => [x(places[i]), y(v)]))),
      ...dots.map((v, i) => circle(dotCls, x(places[i]), y(v), 3)));
  }
  function drawNumber(width) {
    const { curve } = scene, [, first] = curve[0];
    const { x, y } = chart(c, width, [2, MAX_COUNT], [0, 1.1 * first], "cameras",
      "rms error over the markers, mm");
    const trail = (of) => lines(curve.map(([n, s]) => [x(n), y(of(n, s))]));
    c.canvas.append(path("tl-wire", trail((n) => (first * Math.SQRT2) / Math.sqrt(n))),
      path("tl-demo-law", trail((_, s) => s)),
      circle("tl-demo-dot", x(state.cameras), y(rise(drawn())), 5));
    entitlePanel(c, "What more cameras are worth", "",
      "dashed: by the law; faint: as 1/√N; dot: the draws");
  }
  function draw(width) {
    if (!scene) prepare();
    const end = performance.now() + 8; // ms, so that sliders stay responsive
    do one(); while (scene.draws < DRAWS && performance.now() < end);
    if (scene.draws < DRAWS) request();
    const most = state.amplitude * 1.25, law = inMm(scene.variance), [reference, last] =
      [scene.reference, scene.last].map((all) => Array.from(all, (w) => 1000 * w));
    drawAlong(a, width.a, [-most, most], "deflection, mm", reference, "tl-reference", last,
      "tl-demo-moved");
    entitlePanel(a, "The shape, as these cameras measured it last", "",
      "line: the true shape; dots: one draw");
    drawAlong(b, width.b, [0, 1.3 * Math.max(...law)], "rms error, mm", law, "tl-demo-law",
      inMm(drawn()), "tl-demo-dot");
    entitlePanel(b, "The error of every marker",
      `By the law ${fixed(Math.min(...law), 2)} to ${fixed(Math.max(...law), 2)} mm.`,
      `dashed: by the law; dots: of ${scene.draws} draws`);
    drawNumber(width.c);
    const all = rise(scene.variance), got = rise(drawn());
    return `Over all ${places.length} markers the law predicts ${fixed(all, 3)} mm, ` +
      `${fixed((100 * all) / state.amplitude, 2)} % of the amplitude. ` + (scene.draws < DRAWS
      ? "Drawing …" : `${DRAWS} draws give ${fixed(got, 3)} mm, ${fixed(got / all, 3)} of it.`);
  }
  return { buttons, draw, reset() { scene = null; }, model: { scene: () => scene } };
}

// Name in the URL, label, letters of the panels, function that builds it, and its sliders:
// label, key in the state and the URL, default, range, step, digits, unit.
const EXPERIMENTS = {
  rounding_marker: ["marker", "One marker on one pixel grid", [..."abc"], buildMarker,
    ["Motion δ", "motion", 1.3, [0, 3], 0.01, 2, " px"],
    ["Shift of the grid", "shift", 0, [-0.5, 0.5], 0.01, 2, " px"]],
  rounding_point: ["point", "Two cameras and a point", [..."ab"], buildPoint,
    ["Deflection w", "deflection", 2, [0, 6], 0.05, 2, " mm"],
    ["Elevation φ", "elevation", 30, [5, 80], 1, 0, "°"]],
  rounding_beam: ["beam", "Many cameras and a beam", [..."abc"], buildBeam,
    ["Cameras", "cameras", 4, [2, 24], 1, 0, ""],
    ["Mode", "mode", 3, [1, 3], 1, 0, ""],
    ["Amplitude", "amplitude", 5.5, [0.5, 12], 0.5, 1, " mm"],
    ["Elevation", "elevation", 35, [5, 80], 5, 0, "°"]],
};

export default { render };
