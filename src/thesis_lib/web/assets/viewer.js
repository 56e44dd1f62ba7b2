// Viewer of one parametric study: linked panels (a) cameras, (b) and (c) what was measured, (d) mean errors.
// Front end of thesis_lib.web.viewer.Viewer in the form anywidget expects; static_html runs it without a kernel.
import { asked, keep } from "./address.js";
import { createBars } from "./bars.js";
import { linkButton } from "./copy.js";
import { createImage, createMotion } from "./motion.js";
import {
  KINDS, field, figure, fill, followWidth, html, icon, isNumber, mark, path, radios, select, show,
  svg, swatch,
} from "./parts.js";
import { hemisphereCameras } from "./pinhole.js";
import { RAD } from "./space.js";
import { createSketch } from "./sketch.js";
import { createStudy } from "./study.js";
import "./beam.js";
import "./plate.js";
import "./sound.js";

const KEYS = ["case", "mode", "compare", "setting"]; // of the address

function render({ model, el }) {
  const uid = `tl-${Math.random().toString(36).slice(2, 10)}`; // several viewers share one page
  const study = createStudy(model);
  const controls = html("div", { class: "tl-controls" }), title = html("p", { class: "tl-title" });
  const key = html("ul", { class: "tl-key" }), grid = html("div", { class: "tl-grid" });
  const summary = html("p", { class: "tl-summary", "aria-live": "polite", "data-testid": "summary" });
  const names = { "data-testid": "viewer", "aria-label": "Results by case and mode" };
  const root = html("section", { class: "tl-viewer", ...names });
  const [a, d] = [figure("a", svg("svg")), figure("d", svg("svg"))];
  const sketch = createSketch(a, study), bars = createBars(d, study, uid, highlight, remember);
  const image = createImage(), motion = createMotion((phase) => {
    sketch.move(phase);
    image.show(phase);
  });
  const link = model.get("page") && !model.get("form") ? linkButton(remember) : []; // else the form has it
  let panels = null, imaged = ""; // panels of the kind of structure; what the image shows

  // --- controls
  const choose = (name, value) => { model.set(name, value); model.save_changes(); remember(); };
  function add(label, pairs, value, testid, onChange) {
    const box = select(pairs, { "data-testid": testid }, onChange);
    box.value = value;
    controls.append(field(label, box));
  }
  function buildControls() {
    const { cases, modes } = study.data, names = cases.map((one) => [one.name, `${one.name} – ${one.title}`]);
    controls.replaceChildren();
    if (names.length > 1) add("Case", names, study.case().name, "case", (value) => choose("case", value));
    controls.append(radios("Mode", uid, modes.map(({ mode, frequency_hz: frequency }) =>
      [mode, `${mode}`, isNumber(frequency) ? ` ${show(frequency)} Hz` : ""]),
    (mode) => choose("mode", mode)));
    add("Compare", [["extremes", "best and worst by median"], ["all", "all settings"]], study.compare, "compare",
      (value) => { study.compare = value; highlight(); remember(); });
    controls.append(...link);
  }

  // --- the address of a page: ?case=2a&mode=3, and what is compared or pinned
  function remember() {
    if (!model.get("page")) return;
    const { compare, pinned } = study, shown = new URLSearchParams({ case: study.case().name, mode: study.mode().mode });
    if (compare !== "extremes") shown.set("compare", compare);
    if (pinned !== null) shown.set("setting", pinned + 1);
    keep(KEYS, shown);
  }
  function recall() { // what is unknown or makes no sense is ignored
    const { cases, modes } = study.data, named = cases.find(({ name }) => name === asked("case"));
    const mode = modes.find((one) => `${one.mode}` === asked("mode"));
    if (named) model.set("case", named.name);
    if (mode) model.set("mode", mode.mode);
    if (asked("compare") === "all") study.compare = "all";
    const i = study.settings().findIndex((_, n) => `${n + 1}` === asked("setting"));
    return i < 0 ? null : i;
  }

  // --- updating
  function highlight() { // the bars keep their elements: a redraw would move the focus
    panels.highlight();
    for (const node of root.querySelectorAll("[data-setting]")) {
      const i = Number(node.dataset.setting), tabindex = i === (study.focused ?? study.pinned ?? 0) ? 0 : -1;
      node.dataset.state = study.stateOf(i);
      if (node.matches(".tl-bar")) fill(node, { "aria-pressed": i === study.pinned, tabindex });
      if (node.matches("li")) node.querySelector("em").textContent = ` ${study.extremeWord(i)}`.trimEnd();
    }
    summary.textContent = study.summarise();
    sketch.draw();
    film();
    motion.redraw();
  }
  function film() { // what the cameras of a setting see: the highlighted one, or the best
    const { lens, structure, x_mm: xs, y_mm: ys, grid } = study.data, i = study.active() ?? Math.max(0, study.extremes()[0]);
    const key = [study.case().name, study.mode().mode, i].join();
    if (!lens || key === imaged) return;
    imaged = key;
    const { cameras, resolution } = study.settings()[i], focal = (lens.focal_length_mm * resolution[0]) / lens.sensor_width_mm;
    const P = cameras.flatMap(([distance, ...angles]) =>
      [...hemisphereCameras(distance / 1000, [angles.map((angle) => angle * RAD)], focal, resolution)]);
    const [half, across] = [structure.length_mm / 2, structure.width_mm / 2];
    const markers = study.mode().reference_mm.flatMap((w, n) => (isNumber(w)
      ? [[xs[grid ? n % grid[0] : n] - half, grid ? ys[Math.floor(n / grid[0])] - across : 0, w]] : []));
    const points = (share) => Float64Array.from(markers.flatMap(([x, y, w]) => [x / 1000, y / 1000, (share * w) / 1000]));
    image.load(Float64Array.from(P), resolution, points(0), points(1), lens.principal_offset_px, study.nameOf(i));
  }
  function update() {
    const one = study.case(), { mode } = study.mode(), number = one.figures?.[mode];
    const [box] = controls.querySelectorAll("[data-testid=case]");
    if (box) box.value = one.name;
    controls.querySelector(`[data-testid=mode-${mode}]`).checked = true;
    title.replaceChildren(html("strong", {}, one.title),
      html("span", {}, number ? ` · figure ${number} of the thesis` : ""));
    sketch.label();
    motion.at(study.mode().frequency_hz);
    bars.label();
    panels.draw();
    bars.draw();
    highlight();
  }
  function changeCase(pinned = null) {
    study.hovered = study.focused = null;
    study.pinned = pinned;
    imaged = "";
    const curves = study.data.structure.kind === "beam"; // a curve has a line through its marks
    const sample = (i) => icon(26, path("tl-line", "M1 7H25"), path("tl-mark", mark(i, 13, 7, 3)));
    key.replaceChildren();
    const reference = icon(26, path("tl-reference", "M2 7H24"));
    if (curves) key.append(html("li", {}, reference, html("span", {}, "reference")));
    study.settings().forEach(({ label }, i) => key.append(
      html("li", { style: study.tint(i), "data-setting": i },
        curves ? sample(i) : swatch(i), html("span", {}, label, html("em")))));
    update();
  }
  const outline = ({ structure, grid: cells, modes, cases }) => JSON.stringify([structure, cells, modes?.map(({ mode }) => mode),
    cases?.map(({ name, title: words, settings }) => [name, words, settings.map(({ label }) => label)])]);
  function changeData() {
    const before = study.data, data = model.get("data") ?? {};
    study.data = data;
    imaged = "";
    if (panels && outline(before) === outline(data)) { // other numbers alone
      update();
      return;
    }
    panels?.stop();
    panels = null;
    const { cases, structure } = study.data, kind = structure?.kind, known = cases?.length && KINDS[kind];
    root.replaceChildren(...(known ? [controls, title, key, summary, grid] : ["No results to show."]));
    if (!known) return;
    panels = KINDS[kind](study, uid);
    root.dataset.kind = kind;
    grid.replaceChildren(a.node, ...(study.data.lens ? [image.node] : []), ...panels.figures, d.node);
    root.classList.toggle("tl-imaged", Boolean(study.data.lens));
    if (study.data.x_mm) a.node.append(motion.node); else motion.node.remove(); // a sound has its own
    const pinned = model.get("page") ? recall() : null;
    buildControls();
    fit();
    changeCase(pinned);
  }
  function fit() {
    const before = study.width;
    study.wide = root.classList.toggle("tl-wide", root.clientWidth >= 660);
    study.width = Math.round(a.node.clientWidth) || 480;
    study.full = grid.clientWidth || 480;
    study.ofBars = study.wide && study.data.lens ? study.full : study.width;
    return study.width !== before;
  }

  root.moving = { motion, image }; // for tests
  el.replaceChildren(root);
  changeData();
  motion.watch(a.node, image.node);
  const handlers = { "change:case": () => changeCase(), "change:mode": update, "change:data": changeData };
  Object.entries(handlers).forEach(([name, handler]) => model.on(name, handler));
  const unfollow = followWidth(root, root, 0, () => {
    if (root.contains(grid) && fit()) update();
  });
  return () => {
    unfollow();
    panels?.stop();
    motion.stop();
    Object.entries(handlers).forEach(([name, handler]) => model.off(name, handler));
  };
}

export default { render };
