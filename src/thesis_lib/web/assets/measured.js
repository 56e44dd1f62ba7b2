// A measured shape that moves in space, in colours by deflection, with the uncertainty of each marker as a whisker.
// Front end of thesis_lib.measure.report.view in the form that static_html runs.
import { createMotion } from "./motion.js";
import { field, figure, fill, fixed, followWidth, html, lines, path, resize, svg, text } from "./parts.js";
import { RAD, dot, orbit, times, turnable } from "./space.js";

const RISE = 0.14, STRONGEST = 3; // of the extent, as which the largest deflection is drawn; and what that may be multiplied by

function render({ model, el }) {
  const { points, real, imag, error, faces, edges, frequency, colormap, outline } = model.get("data");
  const view = { azimuth: 155, elevation: 28 }, amplitudes = real.map((re, i) => Math.hypot(re, imag[i]));
  const most = Math.max(...amplitudes), extent = Math.max(...outline.map(([x, y]) => Math.hypot(x, y)));
  const panel = figure("a", svg("svg"), ""), words = html("p", { class: "tl-summary", "aria-live": "polite" });
  const strength = html("input", { type: "range", min: 0, max: STRONGEST, step: 0.05, value: 1, "data-testid": "strength" });
  const whiskers = html("input", { type: "checkbox", checked: "", "data-testid": "whiskers" });
  const motion = createMotion(move);
  const controls = html("div", { class: "tl-controls" }, field("Drawn larger", strength), field("Whiskers (2 ±)", whiskers));
  const root = html("section", { class: "tl-viewer tl-measured", "aria-label": "The measured shape", "data-testid": "measured" },
    words, controls, panel.node, motion.node);
  const scene = svg("g"), shape = svg("g", { class: "tl-measured-shape" }), scale = svg("g");
  let width = 480, at = (i, w) => [i, w], rise = 0, phase = 0, order = [];
  const polygons = faces.map(() => path("tl-face", "")), bars = edges.map(() => path("tl-mesh", ""));
  const errors = points.map(() => path("tl-whisker", "")), dots = points.map(() => svg("circle", { r: 3.2, class: "tl-dot" }));
  const mean = (list, of) => list.reduce((sum, i) => sum + of(i), 0) / list.length;
  const tint = (w) => colormap[Math.max(0, Math.min(colormap.length - 1, Math.round(((w / most + 1) / 2) * (colormap.length - 1))))];

  function draw() { // what only turning and the width change
    const height = Math.max(260, Math.round(width * 0.5)), unit = Math.min((width - 40) / (2 * extent),
      (height - 90) / (2 * extent * Math.abs(Math.sin(view.elevation * RAD)) + 2 * RISE * extent + 1e-9));
    const { viewer, flat } = orbit(view, unit, [width / 2, (height - 40) / 2]);
    rise = (RISE * extent) / most;
    at = (i, w) => flat([points[i][0], points[i][1], Number(strength.value) * rise * w]);
    const axes = [["X", [1, 0, 0]], ["Y", [0, 1, 0]], ["Z", [0, 0, 1]]].map(([name, axis]) => {
      const [x, y] = flat(times(axis, 0.3 * extent)), [x0, y0] = flat([0, 0, 0]), o = [44 - x0, height - 52 - y0];
      return svg("g", { transform: `translate(${o[0].toFixed(1)} ${o[1].toFixed(1)})` },
        path("tl-axis", lines([[x0, y0], [x0 + (x - x0) * 0.3, y0 + (y - y0) * 0.3]])),
        text(x0 + (x - x0) * 0.42, y0 + (y - y0) * 0.42 + 4, name, "tl-muted"));
    });
    scene.replaceChildren(path("tl-ex-rest", lines(outline.map(([x, y]) => flat([x, y, 0])), "Z")), ...axes);
    const depth = (list) => mean(list, (i) => dot([points[i][0], points[i][1], 0], viewer));
    order = faces.map((_, k) => k).sort((a, b) => depth(faces[a]) - depth(faces[b]));
    shape.replaceChildren(...order.map((k) => polygons[k]), ...bars, ...errors, ...dots);
    drawScale(height);
    resize(panel, width, height).replaceChildren(scene, shape, scale);
    move(phase);
  }
  function drawScale(height) {
    const wide = Math.min(260, width * 0.5), left = (width - wide) / 2, top = height - 30, step = wide / colormap.length;
    scale.replaceChildren(...colormap.map((c, i) => svg("rect", { x: left + i * step, y: top, width: step + 0.5, height: 8, fill: c })),
      ...[-most, 0, most].map((w, i) => text(left + (wide * i) / 2, top + 22, `${i > 1 ? "+" : ""}${fixed(w, most < 0.1 ? 4 : most < 10 ? 2 : 1)}${i === 1 ? " mm" : ""}`, "tl-muted")));
  }
  function move(now) {
    phase = now;
    const w = real.map((re, i) => re * Math.cos(phase) - imag[i] * Math.sin(phase)), shown = whiskers.checked;
    const placed = w.map((value, i) => at(i, value));
    polygons.forEach((node, k) => fill(node, { d: lines(faces[k].map((i) => placed[i]), "Z"), fill: tint(mean(faces[k], (i) => w[i])) }));
    bars.forEach((node, k) => fill(node, { d: lines(edges[k].map((i) => placed[i])) }));
    dots.forEach((node, i) => fill(node, { cx: placed[i][0].toFixed(1), cy: placed[i][1].toFixed(1), fill: tint(w[i]) }));
    errors.forEach((node, i) => {
      const [[x, low], [, high]] = [at(i, w[i] - 2 * error[i]), at(i, w[i] + 2 * error[i])];
      fill(node, { d: shown ? `M${x.toFixed(1)} ${low.toFixed(1)}V${high.toFixed(1)}M${(x - 3).toFixed(1)} ${low.toFixed(1)}h6M${(x - 3).toFixed(1)} ${high.toFixed(1)}h6` : "" });
    });
  }

  turnable(panel.canvas, view, 0, draw);
  strength.addEventListener("input", draw);
  whiskers.addEventListener("change", () => move(phase));
  words.textContent = `${points.length} markers, up to ${most.toPrecision(3)} mm. Colours show the deflection at each instant; whiskers are two standard errors either way.`;
  fill(panel.canvas, { role: "img", "aria-label": "The measured shape in motion. Arrow keys turn the view." });
  panel.foot.append("Drag, or focus and press the arrow keys, to turn.");
  motion.at(frequency);
  motion.watch(panel.node);
  el.replaceChildren(root);
  draw();
  const unfollow = followWidth(root, panel.node, width, (now) => { width = now; draw(); });
  return () => { unfollow(); motion.stop(); };
}

export default { render };
