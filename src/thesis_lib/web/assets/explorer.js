// The explorer: cameras to drag around a beam or a plate, and the accuracy that they give.
import { createShapes, createView } from "./explorer_view.js";
import { createImage, createMotion } from "./motion.js";
import {
  asked, button, clamp, copyButton, field, fill, followWidth, html, isNumber, keep,
  options, percentInView, radios, select, show,
} from "./parts.js";
import { MAX_CAMERAS, bandOf, simulateSetting } from "./physics.js";
import { apart, rint } from "./pinhole.js";
import { formatCommand } from "./request.js";

// --- state: s structure, m mode, w [width, height] in px, f focal length, d distance and
// a amplitude in mm, r rest position, c directions of the cameras in degrees, t setup last chosen
const TRIALS = 100;
const NO_STATE = Object.fromEntries([..."smtwfdarc"].map((key) => [key, null]));
const FIRST_SETUP = "4a-4";
const sixteenToNine = (width) => [width, rint((width * 9) / 16)];

// As in `thesis run`, the structure is in front of the cameras, and no two cameras coincide.
const limits = ({ a }, { length, width }) => ({
  d: [Math.floor(500 * Math.hypot(length, width) + a) + 1, 10000],
  f: [1, 1000], a: [0.01, 100], w: [16, 8192],
});
const isLayout = (cameras) => cameras.length >= 2 && cameras.length <= MAX_CAMERAS &&
  cameras.every(([azimuth, elevation], i) =>
    Math.abs(azimuth) <= 360 && elevation > 0 && elevation <= 90 &&
    cameras.slice(0, i).every((other) => apart(cameras[i], other) > 1e-5));

function setupOf(state, { setups, reading }) { // the thesis's setup that equals a state, if any
  const known = Object.keys(reading).every((key) => state[key] === reading[key]);
  const same = setups.filter((one) => known &&
    ["d", "w", "c"].every((key) => `${one[key]}` === `${state[key]}`));
  return same.find(({ id }) => id === state.t) ?? same[0];
}

// --- as query: ?s=beam&m=3&w=320&f=24&d=500&c=7,15;-7,15, or ?s=beam&m=1&t=4a-6 for a setup of the
// thesis; unknown and invalid values are ignored
function fromAddress(query, structures) {
  const given = new URLSearchParams(query);
  const among = (key, choices) => choices[Math.max(0, choices.indexOf(given.get(key)))];
  const number = (words) =>
    (/^-?\d+(\.\d+)?$/.test(words) ? Math.round(1000 * words) / 1000 : NaN);
  const s = among("s", ["beam", "plate"]), { setups, reading } = structures[s];
  const named = (name) => setups.find(({ id }) => id === name?.replace("′", "'"));
  const { id: t, d, w, c } = named(given.get("t")) ?? named(FIRST_SETUP);
  const state = { s, m: Number(among("m", ["1", "2", "3"])), d, w, c, ...reading, t };
  state.r = among("r", [reading.r, "rebuilt", "known"]);
  for (const key of ["a", "f", "d"]) {
    const value = number(given.get(key)), range = limits(state, structures[s])[key];
    state[key] = value === clamp(value, range) ? value : clamp(state[key], range);
  }
  const size = (given.get("w") ?? "").split("x").map(number);
  const range = limits(state, structures[s]).w;
  if (size.length < 3 && size.every((n) => Number.isInteger(n) && n === clamp(n, range)))
    state.w = size.length === 2 ? size : sixteenToNine(size[0]);
  const cameras = (given.get("c") ?? "").split(";").map((pair) => pair.split(",").map(number));
  if (cameras.every((pair) => pair.length === 2) && isLayout(cameras)) state.c = cameras;
  return state;
}
function toAddress(state, structure) {
  const { s, m, w, f, d, a, r, c } = state, { reading } = structure;
  const setup = setupOf(state, structure);
  if (setup) return `s=${s}&m=${m}&t=${setup.id}`;
  const size = `${w}` === `${sixteenToNine(w[0])}` ? w[0] : w.join("x");
  const rare = (a === reading.a ? "" : `&a=${a}`) + (r === reading.r ? "" : `&r=${r}`);
  return `s=${s}&m=${m}&w=${size}&f=${f}&d=${d}${rare}&c=${c.join(";")}`;
}
function toCommand({ s, w, f, d, a, r, c }, { reading }) {
  const values = { cases: [], layouts: { mine: [c] }, distance_mm: d, resolution_px: w };
  if (f !== reading.f) values.focal_length_mm = f;
  if (a !== reading.a) values.amplitude_mm = a;
  if (r !== reading.r) values.rest = r;
  return formatCommand(`${s}-arrays`, Object.entries(values));
}

// Simulated measurement: the nominal run and the prediction, then one trial after the other.
function compute({ m, w, f, d, a, r, c }, structure, sensorWidth) {
  const focal = (f * w[0]) / sensorWidth;
  const setting = { distance: d, cameras: c, focal, size: w, known: r === "known" };
  const shapes = [{ mode: m, peak: a / 1000 }];
  const { P, rest, modes: [one], draw } = simulateSetting(setting, structure, shapes);
  return { P, rest, ...one, groundSampleDistance: d / 1000 / focal, tryOne: draw };
}

// --- elements of the page
const ERRORS = [["mean_error", "Mean error"], ["max_point_error", "Largest error"]];
const HINT = "Drag a camera, or empty space sideways to turn; or press arrow keys, Delete.";
const percent = (value) => (isNumber(value) ? `${show(value)}\u00a0%` : "–");
const bandText = ([median, low, high]) =>
  (isNumber(median) ? `${show(median)} (${show(low)}–${show(high)})\u00a0%` : "–");

const HEADS = [["nominal", "run"], ["random pixel grids", "median (5–95\u00a0%)"],
  ["predicted", "by the law"]];
const createHead = () => [
  html("caption", {}, "Errors of the markers in % of their largest deflection"),
  html("thead", {}, html("tr", {}, html("td"), HEADS.map(([words, more]) =>
    html("th", { scope: "col" }, words, html("small", {}, ` ${more}`)))))];
const createRow = (words, cells) => html("tr", {}, html("th", { scope: "row" }, words),
  Object.entries(cells).map(([name, value]) =>
    html("td", { class: `tl-ex-${name}`, colspan: name === "stated" ? 3 : null }, value)));

function render({ model, el }) {
  const { structures, colors, colormap, sensor_width_mm: sensorWidth } = model.get("data");
  const compact = model.get("compact");
  const uid = `tl-${Math.random().toString(36).slice(2, 10)}`, refreshers = [];
  const linked = Object.keys(NO_STATE).some((key) => asked(key) !== null);
  const query = linked ? location.search : model.get("address");
  let setup, built = {}, frame = 0, timer = 0;
  const app = { // shared with the view and the shapes
    colormap, sensorWidth, update, remove, request, result: null,
    state: fromAddress(query, structures),
    get structure() { return structures[app.state.s]; },
    tint: (i) => `--c: ${colors[i % colors.length]}`,
  };
  const view = createView(app), shapes = createShapes(app), image = createImage();
  const motion = createMotion([view.move, image.show]);

  // --- elements
  const controls = html("div", { class: "tl-controls" }), code = html("code");
  const head = createHead(), table = html("table");
  const list = html("div", { class: "tl-ex-cameras", role: "group", "aria-label": "Cameras" });
  const status = html("p", { class: "tl-ex-status", role: "status" });
  const refusal = html("p", { class: "tl-ex-refused", role: "alert" });
  const facts = html("p", { class: "tl-ex-facts" });
  const bottom = html("div", { class: "tl-ex-export" }, html("span", {}, "Run it:"), code,
    copyButton("Copy command", null, () => toCommand(app.state, app.structure), code));
  const legend = html("p", { class: "tl-ex-legend" }, "Azimuth and elevation of the cameras (°)");
  const columns = html("div", { class: "tl-ex-columns" },
    html("div", {}, view.node, motion.node, html("p", { class: "tl-ex-hint", id: uid }, HINT),
      html("div", { class: "tl-ex-beside" }, compact ? "" : image.node,
        html("div", {}, legend, list))),
    html("div", {}, shapes.node, compact ? image.node : "", table, facts));
  const root = html("section", { class: `tl-viewer tl-explorer${compact ? " tl-ex-compact" : ""}`,
    "aria-label": "Explorer of camera layouts" }, controls, refusal, status, columns, bottom);
  fill(view.node, { "aria-describedby": uid });
  if (compact) {
    const whole = html("a", {}, "All its controls and numbers");
    bottom.replaceChildren(whole);
    refreshers.push(() => {
      whole.href = `explorer.html?${toAddress(app.state, app.structure)}`;
    });
  }

  // --- controls
  function add(label, node, refresh, cls = "") {
    controls.append(field(label, node, { class: `tl-field ${cls}` }));
    refreshers.push(refresh);
    return node;
  }
  function choice(words, key, choices, write) {
    const node = radios(words, `${uid}-${key}`, choices, write);
    controls.append(node);
    refreshers.push(() => { node.querySelector(`[value="${app.state[key]}"]`).checked = true; });
    return node;
  }
  function choose(label, pairs, read, write, cls) {
    const box = select(pairs, {}, write);
    return add(label, box, () => { box.value = read(); }, cls);
  }
  // A value applies once it is within its bounds; on leaving the field, the applied one is shown.
  function numeric(what, read, range, write, attributes = {}) {
    const box = html("input", { type: "number", step: "any", required: "", ...attributes,
      oninput() { if (box.checkValidity()) write(Math.round(1000 * box.value) / 1000); },
      onchange() {
        const given = box.value || "nothing";
        if (!box.checkValidity()) refuse(`${what}: given ${given}, allowed: ${box.title}`);
        box.value = read();
      } });
    return [box, () => {
      const [min, max] = range();
      Object.assign(box, { min, max, title: `${min} to ${max}` });
      if (box !== document.activeElement) box.value = read();
    }];
  }
  function number(label, read, key, write, cls) {
    add(label, ...numeric(label, read, () => limits(app.state, app.structure)[key], write), cls);
  }
  const named = ({ setups }, name) => setups.find(({ id }) => id === name) ?? app.state;
  choice("Structure", "s", [["beam", "Beam"], ["plate", "Plate"]], (s) => {
    const other = structures[s], { a } = app.state;
    const { d, w, c } = named(other, setup?.id);
    update({ s, d, w, c, a: a === app.structure.reading.a ? other.reading.a : a });
  });
  const modes = choice("Mode", "m", [1, 2, 3].map((m) => [m, `${m}`]), (m) => update({ m }));
  const setupBox = choose("Setup of the thesis", [], () => setup?.id ?? "", (t) => {
    const { d, w, c } = named(app.structure, t);
    update({ d, w, c, ...(t ? { t, ...app.structure.reading } : {}) });
  });
  number("Width (px)", () => app.state.w[0], "w",
    (w) => update({ w: sixteenToNine(Math.round(w)) }));
  number("Height (px)", () => app.state.w[1], "w",
    (h) => update({ w: app.state.w.with(1, Math.round(h)) }), "tl-ex-more");
  for (const [label, key] of [["Focal length", "f"], ["Distance", "d"], ["Amplitude", "a"]])
    number(`${label} (mm)`, () => app.state[key], key, (value) => update({ [key]: value }),
      "tl-ex-more");
  choose("Rest position", [["rebuilt", "rebuilt too"], ["known", "known"]], () => app.state.r,
    (r) => update({ r }), "tl-ex-more");

  // --- list of cameras
  function buildList() {
    const { c } = app.state, here = list.contains(document.activeElement);
    const angles = [["Azimuth", [-360, 360]], ["Elevation", [0.5, 90]]];
    const boxes = c.map((_, i) => angles.map(([name, range], n) => {
      const put = (value) => update({ c: app.state.c.with(i, app.state.c[i].with(n, value)) });
      const label = `${name} of camera ${i + 1} in degrees`;
      return numeric(label, () => app.state.c[i][n], () => range, put, { "aria-label": label });
    }));
    const off = (isOff) => ({ disabled: isOff ? "" : null });
    list.replaceChildren(...boxes.map((pair, i) =>
      html("div", { class: "tl-ex-camera", style: app.tint(i) },
        html("b", {}, `${i + 1}`), pair.map(([box]) => box), button("×",
          { "aria-label": `Remove camera ${i + 1}`, ...off(c.length <= 2) }, () => remove(i)))),
    button("+ camera", { "aria-label": "Add a camera", ...off(c.length >= MAX_CAMERAS) },
      addCamera));
    if (here) list.lastChild.focus({ preventScroll: true });
    return () => boxes.flat().forEach(([, refresh]) => refresh());
  }
  function addCamera() { // in the largest gap
    const places = [10, 30, 55, 80].flatMap((elevation) =>
      Array.from({ length: 24 }, (_, i) => [15 * i - 180, elevation]));
    const room = (one) => Math.min(...app.state.c.map((two) => apart(one, two)));
    const best = places.reduce((one, two) => (room(two) > room(one) + 1e-9 ? two : one));
    update({ c: [...app.state.c, best] });
  }
  function remove(i) { update({ c: app.state.c.filter((_, n) => n !== i) }); }

  // --- drawing
  function buildStructure() { // the parts that depend on beam or plate
    const { setups, hertz } = app.structure;
    const cases = [...Map.groupBy(setups, (one) => one.case)];
    setupBox.replaceChildren(html("option", { value: "" }, "own layout"),
      ...cases.map(([name, those]) => html("optgroup", { label: `${name} – ${those[0].title}` },
        ...options(those.map(({ id, label }) => [id, `${name}: ${label}`])))));
    modes.querySelectorAll("small").forEach((note, i) => {
      note.textContent = ` ${show(hertz[i])} Hz`;
    });
    shapes.build();
  }
  function drawNumbers() {
    const { errors, predicted, means, peaks, inView, groundSampleDistance, moved } = app.result;
    const few = means.length < 20, bands = few ? [] : [means, peaks].map(bandOf);
    table.replaceChildren(...head, ...[errors.mean, errors.largest].map((literal, i) => {
      const [name, words] = ERRORS[i], published = setup?.errors[name][app.state.m - 1] ?? [];
      return html("tbody", {}, createRow(words, { literal: percent(literal),
        band: few ? "…" : bandText(bands[i]), predicted: i ? "" : percent(predicted) }),
      createRow("published", { published: percent(published[0]),
        spread: bandText(published.slice(1)), none: "" }),
      createRow("thesis claims", { stated: setup?.stated[name][app.state.m - 1] || "–" }));
    }));
    const spread = few ? ""
      : ` (${show(bands[0][1])}–${show(bands[0][2])} % over random pixel grids)`;
    const words = `ean error ${percent(errors.mean)}${spread}; predicted ${percent(predicted)}`;
    const seen = percentInView(inView);
    const cut = [`Only ${seen} % of marker images are in view: move back or shorten the lens. `,
      html("span", {}, `Sensors large enough for all would give: m${words}.`)];
    status.replaceChildren(
      ...(!isNumber(errors.mean) ? ["These cameras do not determine where the markers are."]
        : inView === 1 ? [`M${words}; all markers in view.`] : cut));
    fill(status, { "aria-busy": means.length < TRIALS });
    const counts = { "markers in view": `${seen} %`,
      "one pixel spans": `${show(1000 * groundSampleDistance)} mm`,
      "largest motion in an image": `${show(moved)} px` };
    facts.replaceChildren(...Object.entries(counts).flatMap(([name, value]) =>
      [html("span", {}, `${name} `, html("b", {}, value)), " "]));
  }
  function refresh() { // the nominal run and the prediction; the trials follow
    const { state, structure } = app;
    setup = setupOf(state, structure);
    app.result = compute(state, structure, sensorWidth);
    if (built.structure !== structure) buildStructure();
    if (built.count !== state.c.length) {
      view.build();
      built.list = buildList();
    }
    Object.assign(built, { structure, count: state.c.length });
    [...refreshers, built.list].forEach((one) => one());
    code.textContent = toCommand(state, structure);
    view.draw();
    shapes.draw();
    image.load(app.result.P, state.w, app.result.rest, app.result.deflected);
    motion.at(structure.hertz[state.m - 1]);
    clearTimeout(timer);
    timer = setTimeout(settle, 300);
  }
  function tick() {
    frame = 0;
    const end = performance.now() + 9; // ms, so that dragging stays responsive
    if (app.result) view.draw(); else refresh();
    while (app.result.means.length < TRIALS && performance.now() < end) app.result.tryOne();
    drawNumbers();
    if (app.result.means.length < TRIALS) request();
  }
  function request() { frame ||= requestAnimationFrame(tick); }
  function update(changes) { // by the user; the next frame shows it
    const next = { ...app.state, ...changes };
    if (!isLayout(next.c)) return refuse("No two cameras may stand in one place.");
    const [low, high] = limits(next, structures[next.s]).d, given = next.d;
    next.d = clamp(given, [low, high]);
    refuse(next.d === given ? "" : `Distance (mm): given ${given}, allowed: ${low} to ${high}`);
    Object.assign(app, { state: next, result: null });
    request();
  }
  function refuse(words) { refusal.textContent = words; }
  // The URL is updated when the user pauses.
  function settle() { keep(NO_STATE, location.hash, toAddress(app.state, app.structure)); }

  Object.assign(root, { explorer: { structures, app }, moving: { motion, image } }); // for tests
  el.replaceChildren(root);
  tick();
  motion.watch(view.node, image.node);
  followWidth(root, () => {
    [view, shapes].forEach((one) => one.remeasure());
    app.result = null; // draws all again
    request();
  });
}

export default { render };
