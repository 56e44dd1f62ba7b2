// Panels of a beam: (b) the shapes and (c) the errors of the markers, both as curves along it.
import { axes, extent } from "./chart.js";
import { KINDS, entitle, figure, isNumber, lines, mark, path, svg } from "./parts.js";

KINDS.beam = (study) => {
  const [b, c] = ["b", "c"].map((letter) => figure(letter, svg("svg")));
  c.foot.append("In (d), point at a bar to show its setting; click or press Enter to keep it.");

  function drawCurves(panel, yTitle, curves, reference) {
    const { length_mm: length } = study.data.structure, title = "distance from the clamp (mm)";
    const range = extent([...curves, reference]);
    const { x, y } = axes(panel, study.width, [0, length], range, title, yTitle);
    const trail = (values) => values.flatMap((v, n) =>
      (isNumber(v) ? [[x(study.data.x_mm[n]), y(v)]] : []));
    panel.canvas.append(path("tl-reference", lines(trail(reference))), ...curves.map((values, i) =>
      svg("g", { class: "tl-series", "data-setting": i, style: study.tint(i) },
        path("tl-line", lines(trail(values))),
        path("tl-mark", trail(values).map((point) => mark(i, ...point, 2.4)).join("")))));
  }
  return {
    figures: [b.node, c.node],
    draw() {
      const results = study.results(), shapes = results.map((r) => r.measured_mm);
      entitle(b, study, "img", "Reference and measured shapes");
      entitle(c, study, "img", "Error of each marker");
      drawCurves(b, "deflection (mm)", shapes, study.mode().reference_mm);
      drawCurves(c, "error (% of the largest deflection)", results.map((r) => r.point_error), []);
    },
    highlight() { // brought to the front
      for (const { canvas } of [b, c]) canvas.append(...[...canvas.querySelectorAll(".tl-series")]
        .filter((series) => study.stateOf(Number(series.dataset.setting)) === "on"));
    },
  };
};
