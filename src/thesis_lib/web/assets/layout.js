// Planned cameras around a structure, to be turned; options of one or more plans to choose from.
// Front end of thesis_lib.planning.layout_view in the form that static_html runs.
import { asked, keep } from "./address.js";
import { linkButton } from "./copy.js";
import {
  field, figure, fill, followWidth, heightOf, html, options, path, resize, select, svg, text,
} from "./parts.js";
import {
  RAD, baseOf, dot, drawAxes, drawCamera, drawRing, orbit, plus, times, turnable,
} from "./space.js";

const SHOWN = ["azimuth", "elevation", "distance", "focal length", "pixels"];
// Rows of a CSV with a header, as objects.
function rowsOf(text) {
  const [header, ...rows] = text.trim().split("\n").map((line) => line.split(","));
  return rows.map((row) => Object.fromEntries(row.map((value, i) => [header[i], value])));
}

function render({ model, el }) {
  const { plans, tints } = model.get("data"), view = { azimuth: 155, elevation: 28 };
  const panel = figure("a", svg("svg"), ""), words = html("p", { class: "tl-summary", "aria-live": "polite" });
  const controls = html("div", { class: "tl-controls" }), table = html("table", { class: "tl-cameras" });
  const link = html("a", { "data-testid": "csv" }, "These cameras as CSV");
  const root = html("section", { class: "tl-viewer tl-layouts", "aria-label": "Planned cameras", "data-testid": "layouts" },
    controls, words, panel.node, html("div", { class: "tl-scroll", tabindex: 0 }, table), link);
  let width = 480, plan, option;

  const choice = (testid, choose) => select([], { "data-testid": testid }, (value) => {
    choose(Number(value));
    remember();
  });
  function put(box, names, value) {
    box.replaceChildren(...options(Object.entries(names)));
    box.value = value;
  }
  const which = choice("plan", choosePlan), of = choice("option", chooseOption);
  put(which, plans.map(({ name }) => name), 0);
  const known = plans.length > 1 ? [field("Plan", which)] : [];
  controls.append(...known, field("Cameras", of), ...linkButton(remember));

  function remember() {
    keep(["plan", "option"], new URLSearchParams({ plan: plans.indexOf(plan) + 1, option: plan.options.indexOf(option) + 1 }));
  }

  function choosePlan(i, first = plans[i].chosen) {
    plan = plans[i];
    put(of, plan.options.map(({ label }) => label), first);
    chooseOption(first);
  }
  function chooseOption(i) {
    option = plan.options[i];
    words.textContent = option.words;
    fill(panel.canvas, { role: "img", "aria-label": `Cameras of the plan: ${option.label}. Arrow keys rotate.` });
    const caption = html("caption", {}, `${plan.name}: ${option.label}`);
    const head = ["camera", ...SHOWN].map((name) => html("th", { scope: "col" }, name));
    const body = rowsOf(option.table).map((row) => [`${Number(row.azimuth_deg)}°`, `${Number(row.elevation_deg)}°`, `${Number(row.distance_mm)} mm`,
      `${row.focal_length_mm} mm`, `${row.width_px} × ${row.height_px}`].map((value) => html("td", {}, value)));
    table.replaceChildren(caption, html("thead", {}, html("tr", {}, ...head)), html("tbody", {}, ...body.map((cells, n) =>
      html("tr", {}, html("th", { scope: "row" }, `${n + 1}`), ...cells))));
    fill(link, { href: `data:text/csv;charset=utf-8,${encodeURIComponent(option.table)}`,
      download: `cameras-${plan.name}-${option.label}.csv`.replace(/[^\w.]+/g, "-") });
    draw();
  }

  function draw() { // the scale is that of the whole plan, so that its options compare
    const height = heightOf(width) * (width < 420 ? 0.85 : 1.1), { centre, outline, markers } = plan;
    const away = ([x, y, z]) => [x - centre[0], y - centre[1], z - centre[2]];
    const placesOf = (one) => rowsOf(one.table).map(({ x_mm: x, y_mm: y, z_mm: z }) => away([x / 1000, y / 1000, z / 1000]));
    const every = plan.options.flatMap(placesOf);
    const all = [...every, ...outline.map(away)], heights = [0, ...all.map((v) => v[2])];
    const radius = Math.max(...all.map(([x, y]) => Math.hypot(x, y))), [low, high] = [Math.min(...heights), Math.max(...heights)];
    const sine = Math.abs(Math.sin(view.elevation * RAD)), cosine = Math.cos(view.elevation * RAD);
    const tall = 2 * radius * sine + (high - low) * cosine; // of the upright cylinder around all
    const unit = Math.min((width - 70) / (2 * radius), (height - 60) / tall);
    const middle = height / 2 + (unit * cosine * (high + low)) / 2;
    const space = orbit(view, unit, [width / 2, middle]), { viewer, flat, line } = space;
    const known = outline.length === 4; // else the box around markers, corner by corner
    const dots = markers.map(away).map(flat).map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`);
    const drawn = placesOf(option).map((tip, i) => {
      const style = `--c: ${tints[i % tints.length]}`, distance = Math.hypot(...tip);
      const azimuth = Math.atan2(tip[0], tip[1]) / RAD, elevation = Math.asin(tip[2] / distance) / RAD;
      const base = baseOf(tip, azimuth, elevation, 0.1 * radius);
      const [x, y] = flat(plus(tip, times(tip, 0.07)));
      const sight = [line("tl-sight", [tip, [0, 0, 0]], "", style),
        line("tl-wire", [tip, [tip[0], tip[1], 0]])];
      return [dot(tip, viewer), sight, svg("g", { class: "tl-camera", style },
        ...drawCamera(space, tip, base), text(x, y + 4, String(i + 1), "tl-note"))];
    }).sort(([one], [two]) => one - two);
    resize(panel, width, height).replaceChildren(
      ...[0.5, 1].map((r) => drawRing(space, r * radius)), ...drawAxes(space, [0, 0, 0], 0.3 * radius),
      line(known ? "tl-plate" : "tl-wire", outline.map(away), known ? "Z" : ""),
      path("tl-places", dots.join("")), ...drawn.flatMap(([, sight]) => sight),
      ...drawn.map(([, , group]) => group));
  }

  turnable(panel.canvas, view, -90, draw);
  panel.foot.append("Drag, or focus and press the arrow keys, to turn. Numbers are those of the table below.");
  el.replaceChildren(root);
  const given = (name, count) => [...Array(count).keys()].findIndex((i) => `${i + 1}` === asked(name));
  const first = Math.max(0, given("plan", plans.length)), chosen = given("option", plans[first].options.length);
  choosePlan(first, chosen < 0 ? undefined : chosen);
  which.value = first;
  return followWidth(root, panel.node, width, (now) => { width = now; draw(); });
}

export default { render };
