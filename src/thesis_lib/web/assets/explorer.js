// The explorer: cameras to drag around a beam or a plate, and at once the accuracy that they give.
// Front end of thesis_lib.book.explorer.Explorer in the form anywidget expects; static_html runs it without a kernel. Each
// module of the explorer is one expression, so that its names stay apart from the viewer's, whose parts it shares.
import model from "./explorer_model.js";
import states from "./explorer_state.js";
import createView from "./explorer_view.js";
import createShapes from "./explorer_shapes.js";
import { keep } from "./address.js";
import { copyButton, linkButton } from "./copy.js";
import { createImage, createMotion } from "./motion.js";
import { button, field, fill, html, isNumber, options, select, show } from "./parts.js";

export default (() => {
  const { KEYS, MOST, TRIALS, apart, band, compute, fromAddress, isLayout, limits, refused, setupOf, sixteenToNine,
    toAddress, toCommand, within } = states;
  const WIDTHS = [320, 640, 1280, 1920], ERRORS = [["mean_error", "Mean error"], ["max_point_error", "Largest error"]];
  const HINT = matchMedia("(pointer: coarse)").matches
    ? "Drag a camera with a finger, or empty space sideways to turn."
    : "Drag a camera, or empty space to turn; or arrow keys, Delete. After a click the wheel changes the distance.";
  const percent = (value) => (isNumber(value) ? `${show(value)}\u00a0%` : "–");
  const bandText = ([median, low, high]) =>
    (isNumber(median) ? `${show(median)} (${show(low)}–${show(high)})\u00a0%` : "–");

  function render({ model: traits, el }) {
    const { structures, colors, colormap, sensor_width_mm: sensorWidth } = traits.get("data");
    const onPage = Boolean(traits.get("page")), uid = `tl-${Math.random().toString(36).slice(2, 10)}`, fields = [];
    const linked = onPage && KEYS.some((key) => new URLSearchParams(location.search).has(key));
    let setup, built = {}, frame = 0, timer = 0, free = false;
    const app = { colormap, sensorWidth, update, remove, request, result: null, // what the view and the shapes need
      state: fromAddress(linked ? location.search : traits.get("address"), structures, traits.get("address")),
      get structure() { return structures[app.state.s]; }, tint: (i) => `--c: ${colors[i % colors.length]}` };
    const view = createView(app), shapes = createShapes(app), image = createImage(), compact = traits.get("compact");
    const motion = createMotion((phase) => {
      view.move(phase);
      image.show(phase);
    });

    // --- elements
    const controls = html("div", { class: "tl-controls" }), code = html("code");
    const list = html("div", { class: "tl-ex-cameras", role: "group", "aria-label": "Cameras" });
    const status = html("p", { class: "tl-ex-status", role: "status" });
    const refusal = html("p", { class: "tl-ex-refused", role: "alert" }), facts = html("p", { class: "tl-ex-facts" });
    const bottom = html("div", { class: "tl-ex-export" }, html("span", {}, "Run it:"), code);
    const head = [["", ""], ["nominal", "run"], ["random pixel grids", "median (5–95\u00a0%)"],
      ["predicted", "by the law"]];
    const cells = ERRORS.map(() => ["literal", "band", "predicted", "published", "spread", "stated"].map((name) =>
      html("td", { class: `tl-ex-${name}`, colspan: name === "stated" ? 3 : null })));
    const row = (words, ...those) => html("tr", {}, html("th", { scope: "row" }, words), ...those);
    const table = html("table", {}, html("caption", {}, "Errors of the markers in % of their largest deflection"),
      html("thead", {}, html("tr", {}, ...head.map(([words, more]) =>
        html(words ? "th" : "td", words ? { scope: "col" } : {}, words, html("small", {}, ` ${more}`))))),
      ...ERRORS.map(([, words], i) => html("tbody", {}, row(words, ...cells[i].slice(0, 3)),
        row("published", ...cells[i].slice(3, 5), html("td")), row("thesis states", cells[i][5]))));
    const root = html("section", { class: "tl-viewer tl-explorer", "aria-label": "Explorer of camera layouts" }, controls,
      refusal, status, html("div", { class: "tl-ex-columns" },
        html("div", {}, view.node, motion.node, html("p", { class: "tl-ex-hint", id: `${uid}-hint` }, HINT),
          html("div", { class: "tl-ex-beside" }, ...(compact ? [] : [image.node]), html("div", {},
            html("p", { class: "tl-ex-legend" }, "Azimuth and elevation of the cameras (°)"), list))),
        html("div", {}, shapes.node, ...(compact ? [image.node] : []), table, facts)), bottom);
    fill(view.node, { "aria-describedby": `${uid}-hint` });
    bottom.append(copyButton("Copy command", null, () => toCommand(app.state, app.structure), code));
    if (compact) {
      root.classList.add("tl-ex-compact");
      const whole = html("a", {}, "All its controls and numbers");
      bottom.replaceChildren(whole);
      fields.push(() => { whole.href = `explorer.html?${toAddress(app.state, app.structure)}`; });
    } else if (onPage) bottom.append(...linkButton(settle));

    // --- controls
    const add = (label, node, cls = "") => controls.append(field(label, node, { class: `tl-field ${cls}` }));
    function choice(legend, key, options, write) { // one of a few, side by side
      const group = html("div", { class: "tl-modes" }, ...options.map(([value, words]) => {
        const input = html("input", { type: "radio", name: `${uid}-${key}`, value });
        input.addEventListener("change", () => write(value));
        return html("label", {}, input, html("span", {}, words, html("small")));
      }));
      controls.append(html("fieldset", { class: "tl-field" }, html("legend", {}, legend), group));
      fields.push(() => { group.querySelector(`[value="${app.state[key]}"]`).checked = true; });
      return group;
    }
    function choose(label, pairs, read, write, cls) {
      const box = select(pairs, {}, write);
      add(label, box, cls);
      fields.push(() => { box.value = read(); });
      return box;
    }
    // Taken while it is typed; refused when it is left, or at once if no further digit could make it right.
    function numeric(what, unit, read, range, write, attributes) {
      const box = html("input", { type: "number", step: "any", ...attributes });
      const take = (last) => {
        const value = box.value === "" ? NaN : Math.round(1000 * box.value) / 1000, allowed = value === within(value, range());
        const [low, high] = range(), hopeless = value > high || value < Math.min(low, 0) || (value === 0 && low > 0);
        if (allowed) value === read() ? refuse("") : write(value);
        else if (last || hopeless) refuse(refused(what, box.value || "nothing", range(), unit, read()));
        if (last) box.value = read();
      };
      box.addEventListener("input", () => take(false));
      box.addEventListener("change", () => take(true));
      return [box, () => { if (box !== document.activeElement) box.value = read(); }];
    }
    function number(what, unit, read, key, write, cls) {
      const [box, refresh] = numeric(what, unit, read, () => limits(app.state, app.structure)[key], write, { min: 0 });
      add(`${what} (${unit.trim()})`, box, cls);
      fields.push(refresh);
    }
    choice("Structure", "s", [["beam", "Beam"], ["plate", "Plate"]], (s) => {
      const other = structures[s], { d, w, c } = other.setups.find(({ id }) => id === setup?.id) ?? app.state;
      update({ s, d, w, c, ...(app.state.a === app.structure.reading.a ? { a: other.reading.a } : {}) });
    });
    const modes = choice("Mode", "m", [[1, "1"], [2, "2"], [3, "3"]], (m) => update({ m }));
    const setupBox = choose("Setup of the thesis", [], () => setup?.id ?? "", (t) => {
      const { d, w, c } = app.structure.setups.find(({ id }) => id === t) ?? app.state;
      update({ d, w, c, ...(t ? { t, ...app.structure.reading } : {}) });
    });
    const common = () => WIDTHS.find((width) => `${sixteenToNine(width)}` === `${app.state.w}`);
    choose("Pixels", [...WIDTHS.map((width) => [width, sixteenToNine(width).join(" × ")]), ["", "other"]],
      () => (!free && common()) || "",
      (width) => { free = !width; update(width ? { w: sixteenToNine(Number(width)) } : {}); });
    ["Width", "Height"].forEach((label, i) => number(label, " px", () => app.state.w[i], "w",
      (value) => update({ w: app.state.w.map((old, n) => (n === i ? Math.round(value) : old)) }), "tl-ex-size"));
    for (const [label, key] of [["Focal length", "f"], ["Distance", "d"], ["Amplitude", "a"]])
      number(label, " mm", () => app.state[key], key, (value) => update({ [key]: value }), "tl-ex-more");
    choose("Rest position", [["rebuilt", "rebuilt too"], ["known", "known"]], () => app.state.r, (r) => update({ r }), "tl-ex-more");

    // --- cameras by number
    function buildList() {
      const { c } = app.state, here = list.contains(document.activeElement), refreshers = [];
      const angle = (i, n) => {
        const put = (value) => update({ c: app.state.c.map((pair, k) => (k === i ? pair.with(n, value) : pair)) });
        const what = `${["Azimuth", "Elevation"][n]} of camera ${i + 1}`, label = `${what} in degrees`;
        const range = [[-360, 360], [0.5, 90]][n], [box, refresh] = numeric(what, "°", () => app.state.c[i][n], () => range, put, { "aria-label": label });
        refreshers.push(refresh);
        return box;
      };
      const rows = c.map((_, i) => html("div", { class: "tl-ex-camera", style: app.tint(i) }, html("b", {}, `${i + 1}`),
        angle(i, 0), angle(i, 1), button("×", { "aria-label": `Remove camera ${i + 1}` }, () => remove(i))));
      list.replaceChildren(...rows, button("+ camera", { "aria-label": "Add a camera" }, addCamera));
      list.querySelectorAll("button").forEach((node, i) => {
        node.disabled = i < c.length ? c.length <= 2 : c.length >= MOST;
      });
      if (here) list.lastChild.focus({ preventScroll: true });
      return () => refreshers.forEach((refresh) => refresh());
    }
    function addCamera() { // where there is most room
      const places = [10, 30, 55, 80].flatMap((e) => Array.from({ length: 24 }, (_, i) => [15 * i - 180, e]));
      const room = (one) => Math.min(...app.state.c.map((two) => apart(one, two)));
      update({ c: [...app.state.c, places.reduce((best, one) => (room(one) > room(best) + 1e-9 ? one : best))] });
    }
    function remove(i) { update({ c: app.state.c.filter((_, n) => n !== i) }); }

    // --- showing it all
    function buildStructure() { // what depends on beam or plate
      const { setups, hertz } = app.structure, cases = [...new Set(setups.map((one) => one.case))];
      setupBox.replaceChildren(html("option", { value: "" }, "own layout"), ...cases.map((name) => {
        const those = setups.filter((one) => one.case === name);
        return html("optgroup", { label: `${name} – ${those[0].title}` },
          ...options(those.map(({ id, label }) => [id, `${name}: ${label}`])));
      }));
      modes.querySelectorAll("small").forEach((note, i) => { note.textContent = ` ${show(hertz[i])} Hz`; });
      shapes.build();
    }
    function drawNumbers() {
      const { errors, predicted, means, peaks, inView, groundSampleDistance, moved } = app.result, few = means.length < 20;
      const bands = [means, peaks].map((values) => (few ? [] : band(values))), [[, low, high]] = bands;
      [errors.mean, errors.largest].forEach((literal, i) => {
        const [name] = ERRORS[i], published = setup?.errors[name][app.state.m - 1] ?? [];
        const words = [percent(literal), few ? "…" : bandText(bands[i]), i ? "" : percent(predicted),
          percent(published[0]), bandText(published.slice(1)), setup?.stated[name][app.state.m - 1] || "–"];
        cells[i].forEach((cell, n) => { cell.textContent = words[n]; });
      });
      const told = `ean error ${percent(errors.mean)}${few ? "" : ` (${show(low)}–${show(high)} % over random pixel grids)`}; ` +
        `predicted ${percent(predicted)}`;
      root.dataset.cut = inView < 1; // what cameras do not see they do not measure
      status.replaceChildren(...(!isNumber(errors.mean) ? ["These cameras cannot tell where the markers are."]
        : inView === 1 ? [`M${told}; all markers in view.`]
          : [`Only ${show(Math.floor(1000 * inView) / 10)} % of marker images are in view: move back or shorten the lens. `,
            html("span", {}, `Sensors large enough for all would give: m${told}.`)]));
      fill(status, { "aria-busy": means.length < TRIALS });
      const counts = [["markers in view", `${show(100 * inView)} %`], ["one pixel spans", `${show(1000 * groundSampleDistance)} mm`],
        ["largest motion in an image", `${show(moved)} px`]];
      facts.replaceChildren(...counts.flatMap(([words, value]) => [html("span", {}, `${words} `, html("b", {}, value)), " "]));
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
      [...fields, built.list].forEach((one) => one());
      controls.dataset.free = free || !common();
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
      const end = performance.now() + 9; // ms, so that dragging stays fluid
      if (app.result) view.draw(); else refresh();
      while (app.result.means.length < TRIALS && performance.now() < end) app.result.tryOne();
      drawNumbers();
      if (app.result.means.length < TRIALS) request();
    }
    function request() { frame ||= requestAnimationFrame(tick); }
    function update(changes) { // by the reader; the next frame shows it
      const next = { ...app.state, ...changes };
      if (!isLayout(next.c)) return refuse("No two cameras may stand in one place.");
      const range = limits(next, structures[next.s]).d, given = next.d;
      next.d = within(given, range);
      refuse(next.d === given ? "" :
        `Distance: ${given} mm is out of range, ${range[0]} to ${range[1]} mm; it is now ${next.d} mm.`);
      Object.assign(app, { state: next, result: null });
      request();
    }
    function refuse(words) { if (refusal.textContent !== words) refusal.textContent = words; }
    function settle() { // the address follows when the reader pauses
      const address = toAddress(app.state, app.structure);
      if (!onPage) {
        traits.set("address", address);
        return traits.save_changes();
      }
      keep(KEYS, address);
    }
    function follow() { // the address of a live notebook, set from Python
      if (traits.get("address") !== toAddress(app.state, app.structure))
        update(fromAddress(traits.get("address"), structures));
    }

    root.explorer = { model, structures, app, shiftsOf: states.shiftsOf, compute: () => compute(app.state, app.structure, sensorWidth) }; // for tests
    root.moving = { motion, image }; // too
    el.replaceChildren(root);
    tick();
    motion.watch(view.node, image.node);
    let width = root.clientWidth;
    const observer = new ResizeObserver(() => {
      if (root.clientWidth === width) return;
      width = root.clientWidth;
      [view, shapes].forEach((one) => one.remeasure());
      app.result = null; // draws all again
      request();
    });
    observer.observe(root);
    if (!onPage) traits.on("change:address", follow);
    return () => {
      observer.disconnect();
      cancelAnimationFrame(frame);
      motion.stop();
      clearTimeout(timer);
      traits.off("change:address", follow);
    };
  }
  return { render };
})();
