// Planned cameras around a structure, in a rotatable view. Front end of thesis_lib.planning.report.
import {
  asked, field, figure, fill, followWidth, heightOf, html, keep, options, path, resize,
  select, svg, text, xy,
} from "./parts.js";
import { RAD, dot, drawAxes, drawCamera, drawRing, orbit, plus, times, turnable } from "./space.js";

const COLUMNS = [ // of the table, with the text of their cells
  ["azimuth", (row) => `${Number(row.azimuth_deg)}°`],
  ["elevation", (row) => `${Number(row.elevation_deg)}°`],
  ["distance", (row) => `${Number(row.distance_mm)} mm`],
  ["focal length", (row) => `${row.focal_length_mm} mm`],
  ["pixels", (row) => `${row.width_px} × ${row.height_px}`],
];
function rowsOf(csv) { // rows as objects, by the header
  const [header, ...rows] = csv.trim().split("\n").map((line) => line.split(","));
  return rows.map((row) => Object.fromEntries(row.map((value, i) => [header[i], value])));
}

function render({ model, el }) {
  const { plans, tints } = model.get("data"), view = { azimuth: 155, elevation: 28 };
  const camerasOf = new Map(plans.flatMap((one) => one.options)
    .map((one) => [one, rowsOf(one.table)])); // parsed once, not at each rotation
  const panel = figure("a", svg("svg"), "");
  const words = html("p", { class: "tl-summary", "aria-live": "polite" });
  const table = html("table", { class: "tl-cameras" });
  const link = html("a", { "data-testid": "csv" }, "These cameras as CSV");
  const pairs = (list, key) => list.map((one, i) => [i, one[key]]);
  const which = select(pairs(plans, "name"), { "data-testid": "plan" },
    (i) => choose(plans[i], plans[i].chosen));
  const of = select([], { "data-testid": "option" }, (i) => choose(plan, i));
  const names = { "aria-label": "Planned cameras", "data-testid": "layouts", onchange: remember };
  const root = html("section", { class: "tl-viewer tl-layouts", ...names },
    html("div", { class: "tl-controls" }, plans.length > 1 && field("Plan", which),
      field("Cameras", of)),
    words, panel.node, html("div", { class: "tl-scroll", tabindex: 0 }, table), link);
  let plan, option;

  function remember() {
    keep({ plan: plans.indexOf(plan) + 1, option: plan.options.indexOf(option) + 1 });
  }
  function choose(among, i) {
    plan = among;
    option = plan.options[i];
    of.replaceChildren(...options(pairs(plan.options, "label")));
    of.value = i;
    words.textContent = option.words;
    fill(panel.canvas, { role: "img",
      "aria-label": `Cameras of the plan: ${option.label}. Arrow keys rotate.` });
    const head = ["camera", ...COLUMNS.map(([name]) => name)];
    const body = camerasOf.get(option).map((row, n) => html("tr", {},
      html("th", { scope: "row" }, `${n + 1}`),
      COLUMNS.map(([, valueOf]) => html("td", {}, valueOf(row)))));
    table.replaceChildren(html("caption", {}, `${plan.name}: ${option.label}`),
      html("thead", {}, html("tr", {}, head.map((name) => html("th", { scope: "col" }, name)))),
      html("tbody", {}, body));
    fill(link, { href: `data:text/csv;charset=utf-8,${encodeURIComponent(option.table)}`,
      download: `cameras-${plan.name}-${option.label}.csv`.replace(/[^\w.]+/g, "-") });
    draw();
  }

  function draw() { // one scale for the whole plan, so that its options are comparable
    const width = panel.node.clientWidth || 480, { centre, outline, markers } = plan;
    const height = heightOf(width) * (width < 420 ? 0.85 : 1.1);
    const away = (place) => plus(place, times(centre, -1));
    const placesOf = (one) => camerasOf.get(one).map((row) =>
      away([row.x_mm / 1000, row.y_mm / 1000, row.z_mm / 1000]));
    const all = [...plan.options.flatMap(placesOf), ...outline.map(away)];
    const heights = [0, ...all.map((v) => v[2])], low = Math.min(...heights);
    const high = Math.max(...heights), radius = Math.max(...all.map(([x, y]) => Math.hypot(x, y)));
    const sine = Math.abs(Math.sin(view.elevation * RAD)), cosine = Math.cos(view.elevation * RAD);
    const tall = 2 * radius * sine + (high - low) * cosine; // of the vertical cylinder around all
    const unit = Math.min((width - 70) / (2 * radius), (height - 60) / tall);
    const middle = height / 2 + (unit * cosine * (high + low)) / 2;
    const space = orbit(view, unit, [width / 2, middle]), { viewer, flat, line } = space;
    const known = outline.length === 4; // else the box around markers, corner by corner
    const dots = markers.map((place) => `M${xy(flat(away(place)))}h0`).join("");
    const drawn = placesOf(option).map((tip, i) => {
      const style = `--c: ${tints[i % tints.length]}`, [x, y] = flat(times(tip, 1.07));
      const sight = [line("tl-sight", [tip, [0, 0, 0]], "", style),
        line("tl-wire", [tip, [tip[0], tip[1], 0]])];
      return [dot(tip, viewer), sight, svg("g", { class: "tl-camera", style },
        drawCamera(space, tip, 0.1 * radius), text(x, y + 4, `${i + 1}`, "tl-note"))];
    }).sort(([one], [two]) => one - two);
    resize(panel, width, height).replaceChildren(
      ...[0.5, 1].map((r) => drawRing(space, r * radius)),
      ...drawAxes(space, [0, 0, 0], 0.3 * radius),
      line(known ? "tl-plate" : "tl-wire", outline.map(away), known ? "Z" : ""),
      path("tl-places", dots), ...drawn.flatMap(([, sight]) => sight),
      ...drawn.map(([, , group]) => group));
  }

  turnable(panel.canvas, view, -90, draw);
  panel.foot.append("Drag, or focus and press the arrow keys, to turn. " +
    "Numbers are those of the table below.");
  el.replaceChildren(root);
  const given = (name, list) => list.findIndex((_, i) => `${i + 1}` === asked(name));
  const first = Math.max(0, given("plan", plans)), { options: those, chosen } = plans[first];
  const named = given("option", those);
  which.value = first;
  choose(plans[first], named < 0 ? chosen : named);
  followWidth(panel.node, draw);
}

export default { render };
