// Viewer of one parametric study: four linked panels (a) cameras, (b) shapes, (c) point errors, (d) mean errors.
// Front end of thesis_lib.widgets.Viewer in the form anywidget expects; static_html runs the same file without a kernel.

// Attributes and text only, never markup: strings of the data cannot become elements.
function fill(node, attributes, children = []) {
  for (const [name, value] of Object.entries(attributes)) if (value != null) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
const html = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
const svg = (tag, attributes = {}, ...children) =>
  fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
const path = (cls, d, extra = {}) => svg("path", { class: cls, d, ...extra });
const text = (x, y, words, cls, anchor = "middle") => svg("text", { x, y, class: cls, "text-anchor": anchor }, words);

const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const fixed = (value, digits) => value.toFixed(digits).replace("-", "−");
const digitsOf = (value) => (Math.abs(value) >= 99.5 ? 0 : Math.abs(value) >= 0.995 ? 1 : 2);
const show = (value) => (isNumber(value) ? fixed(value, digitsOf(value)) : "–");
function range(low, high) {
  if (isNumber(low) && isNumber(high) && low !== high) return `${fixed(low, digitsOf(high))}–${show(high)} %`;
  return isNumber(high) ? `${isNumber(low) ? "" : "up to "}${show(high)} %` : `at least ${show(low)} %`;
}
function ticks(low, high, count) {
  const rough = (high - low || 1) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power > rough * 0.999);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: last - first + 1 }, (_, i) => [(first + i) * step, fixed((first + i) * step || 0, digits)]);
}

// One marker shape per setting (null: a circle), so that colour is never the only difference.
const SHAPES = [null, [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]], [[0, -1.2], [1.1, 0.8], [-1.1, 0.8]],
  [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]], [[0, 1.2], [1.1, -0.8], [-1.1, -0.8]],
  [[-1.4, -0.5], [1.4, -0.5], [1.4, 0.5], [-1.4, 0.5]]];
const lines = (points, end = "") => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") + end;
function mark(index, x, y, r) {
  const shape = SHAPES[index % SHAPES.length];
  if (shape) return lines(shape.map(([u, v]) => [x + u * r, y + v * r]), "Z");
  return `M${(x - r).toFixed(1)} ${y.toFixed(1)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
}
const icon = (width, ...parts) => svg("svg", { width, height: 14, viewBox: `0 0 ${width} 14`, "aria-hidden": "true" }, ...parts);

// World frame: X along the structure, Y across, Z up; azimuth from +Y towards +X, elevation from the XY plane.
const RAD = Math.PI / 180;
const direction = (azimuth, elevation) => [Math.cos(elevation * RAD) * Math.sin(azimuth * RAD),
  Math.cos(elevation * RAD) * Math.cos(azimuth * RAD), Math.sin(elevation * RAD)];
const sideways = (azimuth) => [-Math.cos(azimuth * RAD), Math.sin(azimuth * RAD), 0];
const times = (v, k) => v.map((c) => c * k);
const plus = (u, v) => u.map((c, i) => c + v[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const trace = (point, steps = 72) => Array.from({ length: steps + 1 }, (_, i) => point(i / steps));
const MARGIN = { left: 46, right: 14, top: 30, bottom: 44 };
const ALONG = "distance from the clamp (mm)", ERROR = "error (% of the largest deflection)";

function render({ model, el }) {
  const uid = `tl-${Math.random().toString(36).slice(2, 10)}`; // several viewers share one page
  const view = { azimuth: 158, elevation: 33 };
  let data, width = 0, compare = "extremes", hovered = null, focused = null, pinned = null, dragged;
  const controls = html("div", { class: "tl-controls" }), title = html("p", { class: "tl-title" });
  const key = html("ul", { class: "tl-key" }), grid = html("div", { class: "tl-grid" });
  const summary = html("p", { class: "tl-summary", "aria-live": "polite", "data-testid": "summary" });
  const root = html("section", { class: "tl-viewer", "data-testid": "viewer", "aria-label": "Results by case and mode" });
  const [a, b, c, d] = ["a", "b", "c", "d"].map((letter) => {
    const canvas = svg("svg", { "data-testid": `panel-${letter}`, tabindex: letter === "a" ? 0 : null });
    const panel = { canvas, caption: html("span"), foot: html("div", { class: "tl-foot" }) };
    grid.append(html("figure", {}, html("figcaption", {}, html("b", {}, letter), panel.caption), canvas, panel.foot));
    return panel;
  });
  a.foot.append("Drag, or focus and press the arrow keys, to rotate.");
  c.foot.append("In (d), point at a bar to show its setting; click or press Enter to keep it.");

  // --- what is shown
  const currentCase = () => data.cases.find((one) => one.name === model.get("case")) ?? data.cases[0];
  const modeIndex = () => Math.max(0, data.modes.findIndex((one) => one.mode === model.get("mode")));
  const settings = () => currentCase().settings;
  const results = () => settings().map((one) => one.modes[modeIndex()]);
  const tint = (i) => `--c:${data.colors[i % data.colors.length]}`;
  const active = () => hovered ?? focused ?? pinned;
  function extremes() {
    const errors = results().map((r) => r.mean), known = errors.filter(isNumber);
    return [errors.indexOf(Math.min(...known)), errors.indexOf(Math.max(...known))];
  }
  function stateOf(i) { // "on": in full colour, "dim": in the background, "off": no curve
    const chosen = compare === "all" || extremes().includes(i);
    return i === active() || (active() === null && chosen) ? "on" : chosen ? "dim" : "off";
  }
  const nameOf = (i) => (/^[\d.]+$/.test(settings()[i].label) ? `${data.parameter.label} = ` : "") + settings()[i].label;
  const inView = ({ in_view: share }) => (!isNumber(share) ? null : share >= 1 ? "all markers in view"
    : `${fixed(Math.floor(share * 1000) / 10, 1)} % of marker images on the sensor`);
  function describe(i) {
    const r = results()[i];
    return `${nameOf(i)}: ` + [`mean error ${show(r.mean)} % (5–95 % band ${range(r.low, r.high)})`,
      isNumber(r.predicted) ? `predicted ${show(r.predicted)} %` : null,
      r.stated ? `stated in the thesis ${range(...r.stated)}` : null, inView(settings()[i])].filter(Boolean).join(", ");
  }
  function summarise() {
    const place = `Mode ${data.modes[modeIndex()].mode}, case ${currentCase().name}`, [best, worst] = extremes();
    if (active() !== null) return `${active() === pinned ? "Pinned: " : ""}${place}, ${describe(active())}.`;
    if (best < 0) return `${place}: no errors known.`;
    const cut = settings().filter((one) => one.in_view < 1).length, error = (i) => `${show(results()[i].mean)} %`;
    return `${place}: mean error from ${error(best)} (best, ${nameOf(best)}) to ${error(worst)} (worst, ${nameOf(worst)}). ` +
      (cut ? `Markers leave the image in ${cut} of ${settings().length} settings.` : "All markers in view.");
  }

  // --- controls
  const choose = (name, value) => { model.set(name, value); model.save_changes(); };
  function select(label, options, value, testid, onChange) {
    const box = html("select", { "data-testid": testid }, ...options.map(([id, words]) => html("option", { value: id }, words)));
    box.value = value;
    box.addEventListener("change", () => onChange(box.value));
    controls.append(html("label", { class: "tl-field" }, html("span", {}, label), box));
  }
  function buildControls() {
    controls.replaceChildren();
    const names = data.cases.map((one) => [one.name, `${one.name} – ${one.title}`]);
    if (names.length > 1) select("Case", names, currentCase().name, "case", (value) => choose("case", value));
    const buttons = data.modes.map(({ mode, frequency_hz: frequency }) => {
      const hertz = isNumber(frequency) ? ` ${show(frequency)} Hz` : "";
      const names = { "data-testid": `mode-${mode}`, "aria-label": `Mode ${mode}${hertz}` };
      const input = html("input", { type: "radio", name: uid, ...names });
      input.addEventListener("change", () => choose("mode", mode));
      return html("label", {}, input, html("span", {}, `${mode}`, html("small", {}, hertz)));
    });
    const group = html("div", { class: "tl-modes" }, ...buttons);
    controls.append(html("fieldset", { class: "tl-field" }, html("legend", {}, "Mode"), group));
    const change = (value) => { compare = value; highlight(); };
    select("Compare", [["extremes", "best and worst"], ["all", "all settings"]], compare, "compare", change);
  }

  // --- (a) the cameras
  function drawCameras() {
    const height = heightOf(), every = settings(), shown = every.map((_, i) => i).filter((i) => stateOf(i) === "on");
    const distances = [...new Set(every.flatMap((one) => one.cameras.map((camera) => camera[0])))];
    const half = data.structure.length_mm / 2, across = (data.structure.width_mm ?? 30) / 2;
    const radius = Math.max(...distances, half * 1.1), parameter = data.parameter.name, scene = [], notes = [];
    const viewer = direction(view.azimuth, view.elevation), right = sideways(view.azimuth), up = cross(viewer, right);
    const sine = Math.sin(view.elevation * RAD), unit = Math.min((width - 70) / 2, (height - 44) / (1 + sine)) / radius;
    const flat = (v) => [width / 2 + unit * dot(v, right), height / 2 + unit * ((radius * (1 - sine)) / 2 - dot(v, up))];
    const draw = (cls, points, end, style) => path(cls, lines(points.map(flat), end), { style });
    const ring = (r, elevation) => draw("tl-wire", trace((t) => times(direction(360 * t, elevation), r)));
    scene.push(...distances.map((r) => ring(r, 0)), ...[0, 30, 60].map((elevation) => ring(radius, elevation)),
      ...[0, 45, 90, 135].map((azimuth) => draw("tl-wire", trace((t) => times(direction(azimuth, 180 * t), radius)))));
    for (const [name, axis, from] of [["X", [1, 0, 0], half], ["Y", [0, 1, 0], 0], ["Z", [0, 0, 1], 0]]) {
      const [x, y] = flat(times(axis, from + 0.22 * radius));
      scene.push(draw("tl-axis", [times(axis, from), times(axis, from + 0.16 * radius)]), text(x, y + 4, name, "tl-muted"));
    }
    const square = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    scene.push(draw("tl-beam", square.map(([u, v]) => [u * half, v * across, 0]), "Z"),
      draw("tl-clamp", square.map(([u, v]) => [-half, u * 0.07 * radius, v * 0.05 * radius]), "Z"));
    // Cameras: pyramids with the tip at the centre of projection and the base towards the origin. One that several
    // highlighted settings share is drawn in the first one's colour; larger for the next, if there are but few.
    const seen = new Map(), pyramids = [];
    const nested = shown.length < 3 || new Set(shown.map((i) => String(every[i].cameras))).size === 1;
    function pyramid(camera, style = null) {
      const [distance, azimuth, elevation] = camera, copies = seen.get(String(camera)) ?? 0;
      if (copies && !(nested && style)) return;
      seen.set(String(camera), copies + 1);
      const tip = times(direction(azimuth, elevation), distance), size = 0.12 * radius * (1 + 0.4 * copies);
      const side = times(sideways(azimuth), size * 0.5), over = times(cross(side, direction(azimuth, elevation)), 0.56);
      const base = square.map(([u, v]) => plus(times(tip, 1 - size / distance), plus(times(side, u), times(over, v))));
      if (style && !copies) scene.push(draw("tl-sight", [tip, [0, 0, 0]], "", style));
      pyramids.push([dot(tip, viewer), svg("g", { class: `tl-camera${style ? "" : " tl-faint"}`, style },
        draw("tl-base", base, "Z"), ...base.map((corner) => draw("", [tip, corner])))]);
    }
    for (const i of shown) for (const camera of every[i].cameras) pyramid(camera, tint(i));
    for (const one of every) for (const camera of one.cameras) pyramid(camera);
    scene.push(...pyramids.sort(([one], [two]) => one - two).map(([, group]) => group));
    // The varied parameter, where it has a place in the sketch.
    const isAperture = parameter.startsWith("aperture"), isDistance = parameter.startsWith("distance");
    if (isDistance || parameter.startsWith("width") || (isAperture && shown.length < 3)) shown.forEach((i, n) => {
      const [one, two] = every[i].cameras.map(([, azimuth, elevation]) => direction(azimuth, elevation));
      const [[distance]] = every[i].cameras, pixels = every[i].resolution;
      let at = flat(times(one, distance)).map((value, axis) => value + [44, 10][axis]); // beside the first camera
      if (isAperture && two) { // the angle between the first two optical axes
        const angle = Math.acos(dot(one, two) * 0.99999), size = (distance * (0.66 - 0.2 * n)) / Math.sin(angle);
        const arc = trace((t) => plus(times(one, size * Math.sin((1 - t) * angle)), times(two, size * Math.sin(t * angle))), 32);
        scene.push(draw("tl-arc", arc, "", tint(i)));
        at = flat(arc[16]);
      } else if (isDistance) scene.push(draw("tl-arc", [[0, 0, 0], times(one, distance)], "", tint(i)));
      notes.push([...at, isAperture || isDistance || !pixels ? every[i].label : `${pixels.join(" × ")} px`]);
    });
    notes.sort((one, two) => two[1] - one[1]).forEach((note, n) => {
      if (n && Math.abs(note[0] - notes[n - 1][0]) < 100) note[1] = Math.min(note[1], notes[n - 1][1] - 15);
      scene.push(text(Math.max(50, Math.min(width - 50, note[0])), note[1] - 5, note[2], "tl-note"));
    });
    resize(a, height).replaceChildren(...scene);
  }
  function rotate(event, azimuth, elevation) {
    Object.assign(view, { azimuth: view.azimuth + azimuth, elevation: Math.max(0, Math.min(90, view.elevation + elevation)) });
    event.preventDefault();
    drawCameras();
  }
  a.canvas.addEventListener("pointerdown", (event) => { dragged = event; a.canvas.setPointerCapture(event.pointerId); });
  a.canvas.addEventListener("pointermove", (event) => {
    if (!a.canvas.hasPointerCapture(event.pointerId)) return;
    rotate(event, (event.clientX - dragged.clientX) * 0.5, (event.clientY - dragged.clientY) * 0.4);
    dragged = event;
  });
  a.canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, 6], ArrowDown: [0, -6] }[event.key];
    if (step) rotate(event, ...step);
  });

  // --- (b) shapes and (c) errors of points
  const heightOf = () => (width < 420 ? 270 : 310);
  const resize = (panel, height) => fill(panel.canvas, { viewBox: `0 0 ${width} ${height}`, height });
  // Over all settings, so that the scale stays while settings are compared.
  const extent = (rows) => [[0, 1e-6], ...rows].flat().filter(isNumber).reduce(
    ([low, high], value) => [Math.min(low, value), Math.max(high, value)], [0, 0]);

  function frame(panel, [left, right], [low, high], xTitle, yTitle, room = 0) { // returns the scales
    const height = heightOf() + room, bottom = height - MARGIN.bottom - room;
    const top = high + (high - low) * 0.05, base = low < 0 ? low - (high - low) * 0.05 : 0;
    const x = (v) => MARGIN.left + ((v - left) / (right - left)) * (width - MARGIN.left - MARGIN.right);
    const y = (v) => bottom - ((v - base) / (top - base)) * (bottom - MARGIN.top);
    resize(panel, height).replaceChildren(text(2, 14, yTitle, "tl-muted", "start"),
      text(width - MARGIN.right, height - 6, xTitle, "tl-muted", "end"));
    ticks(base, top, 6).forEach(([value, words]) => panel.canvas.append(text(MARGIN.left - 7, y(value) + 4, words, null, "end"),
      path(value ? "tl-gridline" : "tl-axis", `M${MARGIN.left} ${y(value)}H${width - MARGIN.right}`)));
    return { x, y, bottom };
  }
  function drawCurves(panel, yTitle, curves, reference) {
    const { x, y, bottom } = frame(panel, [0, data.structure.length_mm], extent([...curves, reference]), ALONG, yTitle);
    const place = (values) => values.map((v, n) => [x(data.x_mm[n]), y(v)]).filter((_, n) => isNumber(values[n]));
    ticks(0, data.structure.length_mm, 6).forEach(([value, words]) =>
      panel.canvas.append(path("tl-axis", `M${x(value)} ${bottom}v4`), text(x(value), bottom + 17, words)));
    panel.canvas.append(path("tl-reference", lines(place(reference))));
    curves.forEach((values, i) => panel.canvas.append(svg("g", { class: "tl-series", "data-setting": i, style: tint(i) },
      path("tl-line", lines(place(values))), path("tl-mark", place(values).map((point) => mark(i, ...point, 2.4)).join("")))));
  }

  // --- (d) errors of settings
  function drawBars() {
    const every = results(), { label, unit } = data.parameter, had = d.canvas.contains(document.activeElement) ? focused : null;
    const [, most] = extent(every.map((r) => [r.mean, r.high, r.median, r.predicted, ...(r.stated ?? [])]));
    const slotWidth = (width - MARGIN.left - MARGIN.right) / every.length;
    const staggered = settings().some((one) => one.label.length * 7 > slotWidth), room = staggered ? 15 : 0;
    const { x, y, bottom } = frame(d, [0, every.length], [0, most], unit ? `${label} (${unit})` : label, ERROR, room);
    const wide = Math.min(44, slotWidth * 0.46), stub = Math.min(14, slotWidth / 4);
    const tile = { width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" };
    d.canvas.append(svg("pattern", { id: `${uid}-hatch`, ...tile }, path("tl-hatch", "M0 0V6")));
    const hatched = (box, ...more) => svg("rect", { ...box, fill: `url(#${uid}-hatch)` }, ...more);
    const bars = settings().map((setting, i) => {
      const r = every[i], middle = x(i + 0.5), left = middle - wide / 2, drop = staggered && i % 2 ? 15 : 0;
      const area = { x: x(i) + 2, y: MARGIN.top - 12, width: slotWidth - 4, height: bottom - MARGIN.top + 36 + drop, rx: 4 };
      const box = { x: left, y: y(r.mean ?? 0), width: wide, height: y(0) - y(r.mean ?? 0) };
      const bar = svg("g", { class: "tl-bar", role: "button", "data-setting": i, "aria-label": describe(i), style: tint(i) },
        svg("rect", { class: "tl-hit", ...area }), svg("rect", { class: "tl-box", ...box }));
      if (setting.in_view < 1) bar.append(hatched(box, svg("title", {}, inView(setting))));
      const add = (values, cls, line) => { if (values.every(isNumber)) bar.append(path(cls, line(...values.map(y)))); };
      add([r.low, r.high], "tl-band", (low, high) => `M${middle} ${low}V${high}m-4 0h8M${middle - 4} ${low}h8`);
      add([r.median], "tl-median", (at) => mark(0, middle, at, 3));
      add([r.predicted], "tl-predicted", (at) => `M${left + wide - 5} ${at}h${stub}`);
      if (r.stated) add([r.stated[0] ?? 0, r.stated[1] ?? most], "tl-stated",
        (low, high) => (low === high ? mark(3, left - 5, low, 4) : `M${left - 1} ${low}h-4V${high}h4`));
      bar.append(text(middle, y(Math.max(...[0, r.mean, r.high].filter(isNumber))) - 6, show(r.mean)),
        text(middle, bottom + 17 + drop, setting.label));
      const on = (name, handler) => bar.addEventListener(name, (event) => { handler(event); highlight(); });
      on("pointerenter", (event) => { if (event.pointerType === "mouse") hovered = i; });
      on("pointerleave", () => { hovered = null; });
      on("focus", () => { focused = bar.matches(":focus-visible") ? i : null; });
      on("blur", () => { focused = null; });
      on("click", () => { pinned = pinned === i ? null : i; });
      on("keydown", (event) => {
        const next = { ArrowRight: i + 1, ArrowDown: i + 1, ArrowLeft: i - 1, ArrowUp: i - 1, Home: 0, End: -1 }[event.key];
        if (next !== undefined) bars.at(next % every.length).focus();
        else if (event.key === "Enter" || event.key === " ") bar.dispatchEvent(new Event("click"));
        else if (event.key === "Escape") pinned = null;
        else return;
        event.preventDefault();
      });
      return bar;
    });
    d.canvas.append(...bars);
    if (had !== null) bars[had]?.focus();
    const box = { x: 4, y: 2, width: 10, height: 10 }, grey = () => svg("rect", { class: "tl-box", ...box });
    const entry = (words, ...parts) => d.foot.append(html("span", {}, icon(18, ...parts), words));
    d.foot.replaceChildren();
    entry("mean (rms)", grey());
    entry("5–95 % over pixel-grid shifts", path("tl-band", "M9 1V13M5 1h8M5 13h8"));
    entry("their median", path("tl-median", mark(0, 9, 7, 3)));
    entry("first-order prediction", path("tl-predicted", "M2 7h14"));
    if (every.some((r) => r.stated)) entry("stated in the thesis", path("tl-stated", mark(3, 5, 7, 4) + "M17 2h-4V12h4"));
    if (settings().some((one) => one.in_view < 1)) entry("markers leave the image", grey(), hatched(box));
  }

  // --- updating
  function highlight() { // touches attributes only: a redraw would move the focus
    const [best, worst] = extremes(), words = { [worst]: " worst", [best]: best === worst ? "" : " best" };
    for (const node of root.querySelectorAll("[data-setting]")) {
      const i = Number(node.dataset.setting), state = stateOf(i), tabindex = i === (focused ?? pinned ?? 0) ? 0 : -1;
      node.dataset.state = state;
      if (node.matches(".tl-series") && state === "on") node.parentNode.append(node); // to the front
      if (node.matches(".tl-bar")) fill(node, { "aria-pressed": i === pinned, tabindex });
      if (node.matches("li")) node.querySelector("em").textContent = words[i] ?? "";
    }
    summary.textContent = summarise();
    drawCameras();
  }
  function update() {
    const one = currentCase(), { mode, reference_mm: reference } = data.modes[modeIndex()], figure = one.figures?.[mode];
    const varied = data.parameter.label, [box] = controls.querySelectorAll("[data-testid=case]");
    if (box) box.value = one.name;
    controls.querySelector(`[data-testid=mode-${mode}]`).checked = true;
    title.replaceChildren(html("strong", {}, one.title), html("span", {}, figure ? ` · figure ${figure} of the thesis` : ""));
    for (const [panel, role, words, strong, help] of [[a, "img", "Cameras; varied: ", varied, "Arrow keys rotate."],
      [b, "img", "Reference and measured shapes", "", ""], [c, "img", "Error of each marker", "", ""],
      [d, "group", "Mean error of each setting", "", "Arrow keys move, Enter pins, Escape releases."]]) {
      panel.caption.replaceChildren(words, html("strong", {}, strong));
      fill(panel.canvas, { role, "aria-label": `${words}${strong}, case ${one.name}, mode ${mode}. ${help}` });
    }
    drawCurves(b, "deflection (mm)", results().map((r) => r.measured_mm), reference);
    drawCurves(c, ERROR, results().map((r) => r.point_error), []);
    drawBars();
    highlight();
  }
  function changeCase() {
    pinned = hovered = focused = null;
    const swatch = (i) => icon(26, path("tl-line", "M1 7H25"), path("tl-mark", mark(i, 13, 7, 3)));
    key.replaceChildren(html("li", {}, icon(26, path("tl-reference", "M2 7H24")), html("span", {}, "reference")));
    settings().forEach(({ label }, i) => key.append(
      html("li", { style: tint(i), "data-setting": i }, swatch(i), html("span", {}, label, html("em")))));
    update();
  }
  function changeData() {
    data = model.get("data");
    root.replaceChildren(...(data.cases?.length ? [controls, title, key, summary, grid] : ["No results to show."]));
    if (data.cases?.length) buildControls(), fit(), changeCase();
  }
  function fit() {
    root.classList.toggle("tl-wide", root.clientWidth >= 660);
    const before = width;
    return (width = Math.round(grid.firstChild.clientWidth) || 480) !== before;
  }

  el.replaceChildren(root);
  changeData();
  const handlers = { "change:case": changeCase, "change:mode": update, "change:data": changeData };
  Object.entries(handlers).forEach(([name, handler]) => model.on(name, handler));
  const observer = new ResizeObserver(() => requestAnimationFrame(() => { if (root.contains(grid) && fit()) update(); }));
  observer.observe(root);
  return () => {
    observer.disconnect();
    Object.entries(handlers).forEach(([name, handler]) => model.off(name, handler));
  };
}

export default { render };
