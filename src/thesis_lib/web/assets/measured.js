// Animated 3-D view of a measured shape, coloured by deflection, with the uncertainty of each marker
// as a whisker. Front end of thesis_lib.measure.report.build.
import { colourBar, colourOf } from "./maps.js";
import { createMotion } from "./motion.js";
import {
  circle, field, figure, fill, followWidth, html, lines, path, resize, svg, xy,
} from "./parts.js";
import { RAD, dot, drawAxes, orbit, turnable } from "./space.js";

const DRAWN_RISE = 0.14; // drawn largest deflection, relative to the extent
const MAX_FACTOR = 3; // largest factor on it

function render({ model, el }) {
  const { points, real, imag, error, faces, edges, frequency, colormap, outline } = model.get("data");
  const view = { azimuth: 155, elevation: 28 };
  const most = Math.max(...real.map((re, i) => Math.hypot(re, imag[i])));
  const extent = Math.max(...outline.map((place) => Math.hypot(...place)));
  const motion = createMotion([move]), panel = figure("a", svg("svg"), "");
  const strength = html("input", { type: "range", min: 0, max: MAX_FACTOR, step: 0.05, value: 1,
    "data-testid": "strength", oninput: () => draw() });
  const names = { "aria-label": "The measured shape", "data-testid": "measured" };
  const root = html("section", { class: "tl-viewer tl-measured", ...names },
    html("p", { class: "tl-summary", "aria-live": "polite" },
      `${points.length} markers, up to ${most.toPrecision(3)} mm. Colours show the deflection at ` +
      "each instant; whiskers are two standard errors either way."),
    html("div", { class: "tl-controls" }, field("Drawn larger", strength)), panel.node,
    colourBar(colormap, most, "mm", "deflection"), motion.node);
  const scene = svg("g"), shape = svg("g", { class: "tl-measured-shape" });
  let at = null, phase = 0; // screen position of a marker, set by draw()
  const polygons = faces.map(() => path("tl-face", "")), bars = edges.map(() => path("tl-mesh", ""));
  const errors = points.map(() => path("tl-whisker", ""));
  const dots = points.map(() => circle("tl-dot", 0, 0, 3.2));
  const mean = (list, of) => list.reduce((sum, i) => sum + of(i), 0) / list.length;
  const tint = (w) => colourOf(colormap, w, most);

  function draw() { // parts that depend only on rotation and width
    const width = panel.node.clientWidth || 480;
    const height = Math.max(220, Math.round(width * 0.5) - 40);
    const tall = 2 * extent * Math.abs(Math.sin(view.elevation * RAD)) + 2 * DRAWN_RISE * extent;
    const unit = Math.min((width - 40) / (2 * extent), (height - 50) / tall);
    const space = orbit(view, unit, [width / 2, height / 2]), { viewer, flat, centre } = space;
    const rise = (Number(strength.value) * DRAWN_RISE * extent) / most;
    at = (i, w) => flat([...points[i], rise * w]);
    const corner = xy([44 - centre[0], height - 12 - centre[1]]);
    scene.replaceChildren(
      path("tl-ex-rest", lines(outline.map((place) => flat([...place, 0])), "Z")),
      svg("g", { transform: `translate(${corner})` }, ...drawAxes(space, [0, 0, 0], 0.09 * extent)));
    const depth = (k) => mean(faces[k], (i) => dot([...points[i], 0], viewer));
    const order = faces.map((_, k) => k).sort((a, b) => depth(a) - depth(b));
    shape.replaceChildren(...order.map((k) => polygons[k]), ...bars, ...errors, ...dots);
    resize(panel, width, height).replaceChildren(scene, shape);
    move(phase);
  }
  function move(now) {
    phase = now;
    const w = real.map((re, i) => re * Math.cos(phase) - imag[i] * Math.sin(phase));
    const placed = w.map((value, i) => at(i, value)), trail = (list) => list.map((i) => placed[i]);
    polygons.forEach((node, k) =>
      fill(node, { d: lines(trail(faces[k]), "Z"), fill: tint(mean(faces[k], (i) => w[i])) }));
    bars.forEach((node, k) => fill(node, { d: lines(trail(edges[k])) }));
    dots.forEach((node, i) => {
      const [cx, cy] = placed[i].map((value) => value.toFixed(1));
      fill(node, { cx, cy, fill: tint(w[i]) });
    });
    errors.forEach((node, i) => {
      const [low, high] = [-2, 2].map((k) => at(i, w[i] + k * error[i]));
      const cap = ([x, y]) => `M${xy([x - 3, y])}h6`, stem = `M${xy(low)}V${high[1].toFixed(1)}`;
      fill(node, { d: stem + cap(low) + cap(high) });
    });
  }

  turnable(panel.canvas, view, 0, draw);
  fill(panel.canvas, { role: "img",
    "aria-label": "The measured shape in motion. Arrow keys turn the view." });
  panel.foot.append("Drag, or focus and press the arrow keys, to turn.");
  motion.at(frequency);
  motion.watch(panel.node);
  el.replaceChildren(root);
  draw();
  followWidth(panel.node, draw);
}

export default { render };
