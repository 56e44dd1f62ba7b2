// Viewer of one parametric study: linked panels (a) cameras, (b) and (c) measurements, (d) mean
// errors. Front end of thesis_lib.web.viewer.Viewer, as anywidget or static_html runs it.
import { createBars } from "./bars.js";
import { createImage, createMotion } from "./motion.js";
import {
  KINDS, asked, field, figure, fill, followWidth, html, icon, isNumber, keep,
  mark, path, percentInView, radios, range, select, show, svg, swatch,
} from "./parts.js";
import { hemisphereCameras, radians } from "./pinhole.js";
import { createSketch } from "./sketch.js";
import "./beam.js";
import "./plate.js";
import "./sound.js";

// State of a viewer: the chosen case and mode, the highlighted setting, and their labels.
function createStudy(model) {
  const study = {
    data: model.get("data"), compare: "extremes", hovered: null, focused: null, pinned: null,

    case: () => study.data.cases.find((one) => one.name === model.get("case")) ?? study.data.cases[0],
    modeIndex: () => Math.max(0, study.data.modes.findIndex((one) => one.mode === model.get("mode"))),
    mode: () => study.data.modes[study.modeIndex()],
    settings: () => study.case().settings,
    results: () => study.settings().map((one) => one.modes[study.modeIndex()]),
    tint: (i) => `--c:${study.data.colors[i % study.data.colors.length]}`,
    active: () => study.hovered ?? study.focused ?? study.pinned,

    // Errors of a setting: one, or one per plane of the sound, without a mean on a nodal plane.
    errors(i) {
      const result = study.results()[i];
      return study.data.planes?.map(({ name }) => ({ name, ...result.planes[name] })) ?? [result];
    },
    // Settings are ranked by this: the median over the trials, or the single run.
    typical: (result) => result?.median ?? result?.mean,
    extremes() { // the best and the worst setting
      const stored = study.case().extremes?.[study.mode().mode];
      if (stored) return [stored.best.index, stored.worst.index];
      const errors = study.results().map((r) => study.typical(r) ?? r.deflection?.mean);
      const known = errors.filter(isNumber);
      return [errors.indexOf(Math.min(...known)), errors.indexOf(Math.max(...known))];
    },
    extremeWord(i) {
      const [best, worst] = study.extremes();
      return best === worst ? "" : i === best ? "best" : i === worst ? "worst" : "";
    },
    stateOf(i) { // "on": in full colour, "dim": in the background, "off": not drawn
      const chosen = study.compare === "all" || study.extremes().includes(i);
      return i === study.active() || (study.active() === null && chosen) ? "on" : chosen ? "dim" : "off";
    },

    nameOf(i) {
      const { label } = study.settings()[i];
      return (/^[\d.]+$/.test(label) ? `${study.data.parameter.label} = ` : "") + label;
    },
    heading: (i, note) => html("span", { style: study.tint(i), "data-setting": i },
      swatch(i), study.nameOf(i), html("em", {}, note)),
    markers() { // [X, Y, deflection] of each, mm from the structure's centre
      const { x_mm: xs, y_mm: ys, grid: [columns] = [xs.length], structure } = study.data;
      return study.mode().reference_mm.map((w, n) => [xs[n % columns] - structure.length_mm / 2,
        ys ? ys[Math.floor(n / columns)] - structure.width_mm / 2 : 0, w]);
    },
    nodalWords: ({ name, mean }) =>
      (name && !isNumber(mean) ? `${name}: ${study.data.nodal_note}` : ""),
    inView: ({ in_view: share }) => (!isNumber(share) ? null : share >= 1 ? "all markers in view"
      : `${percentInView(share)} % of marker images on the sensor`),
    describe(i) {
      const { deflection } = study.results()[i];
      const parts = study.errors(i).flatMap((error) => study.nodalWords(error) || [
        `${error.name ? `${error.name}: ` : ""}mean error ${show(error.mean)} % ` +
          `(5–95 % band ${range(error.low, error.high)})`,
        isNumber(error.predicted) && `predicted ${show(error.predicted)} %`,
        error.stated && `claimed in the thesis ${range(...error.stated)}`]);
      parts.push(deflection && `deflection: mean error ${show(deflection.mean)} %`,
        study.inView(study.settings()[i]));
      return `${study.nameOf(i)}: ${parts.filter(Boolean).join(", ")}`;
    },
    summarise() {
      const place = `Mode ${study.mode().mode}, case ${study.case().name}`;
      const active = study.active(), every = study.settings(), [best, worst] = study.extremes();
      const pin = active !== null && active === study.pinned ? "Pinned: " : "";
      if (active !== null) return `${pin}${place}, ${study.describe(active)}.`;
      if (best < 0) return `${place}: no errors known.`;
      const what = study.results()[best].deflection ? " shape" : "";
      const name = (i) => `${study.extremeWord(i) || "only"}${what}, ${study.nameOf(i)}`;
      const error = (one, i) => `${show(study.typical(one))} % (${name(i)})`;
      const lows = study.errors(best), highs = study.errors(worst);
      const parts = lows.map((low, n) => study.nodalWords(low) ||
        (low.name ? `${low.name} ` : "") + (what ? "" : "from ") + error(low, best) +
        (what ? ", " : " to ") + error(highs[n], worst));
      const drawn = lows.some((one) => isNumber(one.median));
      const cut = every.filter((one) => one.in_view < 1).length;
      return `${place}: mean error ${parts.join("; ")}` +
        `${drawn ? ", by the median over the trials" : ""}. ` +
        (cut ? `Markers leave the image in ${cut} of ${every.length} settings.` : "All markers in view.");
    },
  };
  return study;
}

function render({ model, el }) {
  const uid = `tl-${Math.random().toString(36).slice(2, 10)}`; // several viewers share one page
  const study = createStudy(model), onPage = model.get("page");
  const controls = html("div", { class: "tl-controls" }), title = html("p", { class: "tl-title" });
  const key = html("ul", { class: "tl-key" }), grid = html("div", { class: "tl-grid" });
  const summary = html("p",
    { class: "tl-summary", "aria-live": "polite", "data-testid": "summary" });
  const names = { "data-testid": "viewer", "aria-label": "Results by case and mode" };
  const root = html("section", { class: "tl-viewer", ...names });
  const [a, d] = ["a", "d"].map((letter) => figure(letter, svg("svg")));
  const sketch = createSketch(a, study), bars = createBars(d, study, uid, highlight, remember);
  const image = createImage(), motion = createMotion([sketch.move, image.show]);
  let panels = null; // those of the kind of structure

  // --- controls
  const choose = (name) => (value) => { model.set(name, value); model.save_changes(); remember(); };
  const choice = (label, pairs, value, onChange) =>
    field(label, select(pairs, { "data-testid": label.toLowerCase() }, onChange, value));
  function buildControls() {
    const { cases, modes } = study.data;
    const names = cases.map(({ name, title: words }) => [name, `${name} – ${words}`]);
    const ways = [["extremes", "best and worst by median"], ["all", "all settings"]];
    const frequency = ({ frequency_hz: hertz }) => (isNumber(hertz) ? ` ${show(hertz)} Hz` : "");
    controls.replaceChildren(
      ...(names.length > 1 ? [choice("Case", names, study.case().name, choose("case"))] : []),
      radios("Mode", uid, modes.map((one) => [one.mode, `${one.mode}`, frequency(one)]), choose("mode")),
      choice("Compare", ways, study.compare, (value) => {
        study.compare = value;
        highlight();
        remember();
      }));
  }

  // --- the URL of a page: ?case=2a&mode=3, and the compared or pinned settings
  function remember() {
    if (!onPage) return;
    keep({ case: study.case().name, mode: study.mode().mode,
      compare: study.compare === "all" ? "all" : null,
      setting: study.pinned === null ? null : study.pinned + 1 });
  }
  function recall() { // unknown and invalid values are ignored
    const named = study.data.cases.find(({ name }) => name === asked("case"));
    const mode = study.data.modes.find((one) => `${one.mode}` === asked("mode"));
    if (named) model.set("case", named.name);
    if (mode) model.set("mode", mode.mode);
    if (asked("compare") === "all") study.compare = "all";
    const i = study.settings().findIndex((_, n) => `${n + 1}` === asked("setting"));
    return i < 0 ? null : i;
  }

  // --- updating
  function highlight() { // keeps the elements of the bars: a redraw would move the focus
    panels.highlight?.();
    for (const node of root.querySelectorAll("[data-setting]")) {
      const i = Number(node.dataset.setting);
      const tabindex = i === (study.focused ?? study.pinned ?? 0) ? 0 : -1;
      node.dataset.state = study.stateOf(i);
      if (node.matches(".tl-bar")) fill(node, { "aria-pressed": i === study.pinned, tabindex });
      if (node.matches("li"))
        node.querySelector("em").textContent = ` ${study.extremeWord(i)}`.trimEnd();
    }
    summary.textContent = study.summarise();
    sketch.draw();
    film();
    motion.redraw();
  }
  function film() { // images of the cameras of the highlighted setting, or of the best
    const { lens } = study.data;
    const i = study.active() ?? Math.max(0, study.extremes()[0]);
    if (!lens) return;
    const { cameras, resolution } = study.settings()[i];
    const focal = (lens.focal_length_mm * resolution[0]) / lens.sensor_width_mm;
    const P = Float64Array.from(cameras.flatMap(([distance, ...angles]) =>
      [...hemisphereCameras(distance / 1000, [radians(angles)], focal, resolution)]));
    const markers = study.markers().filter(([, , w]) => isNumber(w));
    const points = (share) => Float64Array.from(
      markers.flatMap(([x, y, w]) => [x / 1000, y / 1000, (share * w) / 1000]));
    image.load(P, resolution, points(0), points(1), lens.principal_offset_px, study.nameOf(i));
  }
  function update() {
    const one = study.case(), { mode } = study.mode(), number = one.figures?.[mode];
    const box = controls.querySelector("[data-testid=case]");
    if (box) box.value = one.name;
    controls.querySelector(`[data-testid=mode-${mode}]`).checked = true;
    title.replaceChildren(html("strong", {}, one.title),
      html("span", {}, number ? ` · figure ${number} of the thesis` : ""));
    motion.at(study.mode().frequency_hz);
    panels.draw();
    bars.draw();
    highlight();
  }
  function changeCase(pinned = null) {
    study.hovered = study.focused = null;
    study.pinned = pinned;
    const curves = study.data.structure.kind === "beam"; // a curve has a line through the marks
    const reference = html("li", {}, icon(26, path("tl-reference", "M2 7H24")),
      html("span", {}, "reference"));
    const sample = (i) => icon(26, path("tl-line", "M1 7H25"), path("tl-mark", mark(i, 13, 7, 3)));
    key.replaceChildren(...(curves ? [reference] : []), ...study.settings().map(({ label }, i) =>
      html("li", { style: study.tint(i), "data-setting": i },
        curves ? sample(i) : swatch(i), html("span", {}, label, html("em")))));
    update();
  }
  const outline = (data) => JSON.stringify(data, ["structure", "kind", "length_mm", "width_mm", "grid",
    "modes", "mode", "cases", "name", "title", "settings", "label"]);
  function changeData() {
    const before = study.data, data = study.data = model.get("data") ?? {};
    if (panels && outline(before) === outline(data)) return update(); // only numbers differ
    panels?.stop?.();
    panels = null;
    const kind = data.structure?.kind, known = data.cases?.length && KINDS[kind];
    const all = known ? [controls, title, key, summary, grid] : ["No results to show."];
    root.replaceChildren(...all);
    if (!known) return;
    panels = KINDS[kind](study);
    root.dataset.kind = kind;
    grid.replaceChildren(a.node, ...(data.lens ? [image.node] : []), ...panels.figures, d.node);
    if (data.x_mm) a.node.append(motion.node); else motion.node.remove(); // a sound has its own
    const pinned = onPage ? recall() : null;
    buildControls();
    fit();
    changeCase(pinned);
  }
  function fit() { // widths in px of a column, the whole viewer, panel (d)
    const before = study.width;
    study.wide = root.classList.toggle("tl-wide", root.clientWidth >= 660);
    study.width = a.node.clientWidth || 480;
    study.full = grid.clientWidth || 480;
    study.ofBars = study.wide && study.data.lens ? study.full : study.width;
    return study.width !== before;
  }

  root.moving = { motion, image }; // for tests
  el.replaceChildren(root);
  changeData();
  motion.watch(a.node, image.node);
  const handlers = Object.entries({
    "change:case": () => changeCase(), "change:mode": update, "change:data": changeData });
  handlers.forEach((one) => model.on(...one));
  const unfollow = followWidth(root, () => { if (root.contains(grid) && fit()) update(); });
  return () => {
    unfollow();
    panels?.stop?.();
    motion.stop();
    handlers.forEach((one) => model.off(...one));
  };
}

export default { render };
