// Panels of a beam: (b) the shapes and (c) the errors of the markers, both as curves along it.
import { extent, frame } from "./chart.js";
import { KINDS, entitle, figure, isNumber, lines, mark, path, svg, text, ticks } from "./parts.js";

KINDS.beam = (study) => {
  const [b, c] = [figure("b", svg("svg")), figure("c", svg("svg"))];
  c.foot.append("In (d), point at a bar to show its setting; click or press Enter to keep it.");

  function drawCurves(panel, yTitle, curves, reference) {
    const { length_mm: length } = study.data.structure, title = "distance from the clamp (mm)";
    const scales = frame(panel, study.width, [0, length], extent([...curves, reference]), title, yTitle);
    const { x, y, bottom } = scales;
    const place = (values) =>
      values.map((v, n) => [x(study.data.x_mm[n]), y(v)]).filter((_, n) => isNumber(values[n]));
    ticks(0, length, 6).forEach(([value, words]) => panel.canvas.append(
      path("tl-axis", `M${x(value)} ${bottom}v4`), text(x(value), bottom + 17, words)));
    panel.canvas.append(path("tl-reference", lines(place(reference))));
    curves.forEach((values, i) => {
      const marks = place(values).map((point) => mark(i, ...point, 2.4)).join("");
      panel.canvas.append(svg("g", { class: "tl-series", "data-setting": i, style: study.tint(i) },
        path("tl-line", lines(place(values))), path("tl-mark", marks)));
    });
  }
  return {
    figures: [b.node, c.node],
    draw() {
      const results = study.results();
      entitle(b, study, "img", "Reference and measured shapes");
      entitle(c, study, "img", "Error of each marker");
      drawCurves(b, "deflection (mm)", results.map((r) => r.measured_mm), study.mode().reference_mm);
      drawCurves(c, "error (% of the largest deflection)", results.map((r) => r.point_error), []);
    },
    highlight() { // to the front
      for (const { canvas } of [b, c]) canvas.append(...[...canvas.querySelectorAll(".tl-series")].filter(
        (series) => study.stateOf(Number(series.dataset.setting)) === "on"));
    },
    stop() {},
  };
};
