// The explorer's shapes, curves along a beam or maps of a plate: reference, measured, errors.
import { paletteOf, rgb, stepOf } from "./heatmap.js";
import { fill, html, lines, mark, path, show, svg, text, ticks } from "./parts.js";
import { markers } from "./physics.js";

const PERCENT = [10, 20, 50, 100, 200, 500, 1000, 1e4, 1e5];
const above = (value, steps) => steps.find((step) => step >= value) ?? value; // seldom changes
const drawing = (name, more) => svg("svg", { role: "img", "aria-label": name, ...more });

export function createShapes(app) {
  const node = html("div", { class: "tl-ex-shapes" }), palette = paletteOf(app.colormap);
  let draw, width = 0; // of a chart in px

  function chart(canvas, height, [low, high], title, xTitle = "") { // returns the scales, x in m
    const left = 40, right = width - 8, bottom = height - 20, { length } = app.structure;
    const x = (v) => left + (v / length) * (right - left);
    const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - 22);
    fill(canvas, { viewBox: `0 0 ${width} ${height}`, height }).replaceChildren(
      text(0, 12, title, null, "start"), text(right, 12, xTitle, "tl-muted", "end"),
      ...ticks(low, high, height / 40).flatMap(([v, words]) => [
        text(left - 6, y(v) + 4, words, "tl-muted", "end"),
        path(v ? "tl-gridline" : "tl-axis", `M${left} ${y(v)}H${right}`)]),
      ...ticks(0, 1000 * length, 6).map(([v, words]) =>
        text(x(v / 1000), height - 4, words, "tl-muted")));
    return { x, y };
  }
  function curves() {
    const sample = (cls, words, d = "M1 6H21") => html("span", { style: app.tint(0) },
      svg("svg", { width: 22, height: 12, "aria-hidden": "true" }, path(cls, d)), words);
    const bent = drawing("Deflection of the beam"), bars = drawing("Error of each marker");
    node.replaceChildren(html("p", { class: "tl-ex-key" }, sample("tl-reference", "reference"),
      sample("tl-mark", "measured, pixels as in the thesis", mark(0, 11, 6, 3)),
      sample("tl-ex-band", "expected: ± 2 σ by the law of rounding")), bent, bars);
    return ({ reference, measured, variance, errors: { point } }, amplitude) => {
      width ||= bent.clientWidth || 380;
      const [at] = markers(app.structure), style = app.tint(0);
      const [low, high] = [-2, 2].map((k) =>
        reference.map((w, i) => w + k * Math.sqrt(variance[i])));
      const most = (1000 * Math.max(...[...measured, ...low, ...high].map(Math.abs))) / amplitude;
      const limit = amplitude * above(most, [1.25, 1.5, 2, 3, 5, 10, 30, 100, 1000]);
      const shape = chart(bent, width < 480 ? 150 : 200, [-limit, limit], "deflection (mm)");
      const trail = (values) => at.map((x, i) => [shape.x(x), shape.y(1000 * values[i])]);
      bent.append(path("tl-ex-band", lines([...trail(high), ...trail(low).reverse()], "Z")),
        path("tl-reference", lines(trail(reference))),
        svg("g", { style }, path("tl-line", lines(trail(measured))),
          path("tl-mark", trail(measured).map(([x, y]) => mark(0, x, y, 2.6)).join(""))));
      const along = `${width < 360 ? "" : "distance "}from the clamp (mm)`;
      const top = above(Math.max(...point), PERCENT);
      const { x, y } = chart(bars, 130, [0, top], "error of each marker (%)", along);
      const columns = at.map((v, i) => `M${x(v)} ${y(0)}V${y(point[i])}`).join("");
      bars.append(path("tl-ex-bars", columns, { style }));
    };
  }

  function maps() {
    const [nx, ny] = app.structure.grid;
    const shown = ["reference", "measured", "marker errors"].map((name, n) => {
      const canvas = drawing(`Map: ${name}`,
        { viewBox: `0 0 ${nx} ${ny}`, preserveAspectRatio: "none" });
      const cells = Array.from({ length: nx * ny }, (_, i) => // a little wider: no gaps show
        svg("rect", { x: i % nx, y: ny - 1 - Math.floor(i / nx), width: 1.03, height: 1.03 }));
      canvas.append(...cells);
      // From the least, or from zero.
      const colors = palette.filter((_, i) => i % 127 === 0 && (n < 2 || i)).map(rgb);
      const ends = [html("i"), html("i")];
      const bar = html("i", { style: `background: linear-gradient(90deg, ${colors})` });
      return { cells, ends, node: html("figure", {}, html("figcaption", {}, name), canvas,
        html("span", { class: "tl-ex-scale" }, ends[0], bar, ends[1])) };
    });
    node.replaceChildren(...shown.map((map) => map.node));
    return ({ reference, measured, errors: { point, largest } }) => {
      const most = Math.max(...reference.map(Math.abs)), limit = above(largest, PERCENT);
      const words = [show(-1000 * most), `${show(1000 * most)} mm`];
      [[reference, most, words], [measured, most, words], [point, limit, ["0", `${limit} %`]]]
        .forEach(([values, full, labels], n) => {
          shown[n].cells.forEach((cell, i) =>
            fill(cell, { fill: rgb(palette[stepOf(values[i] || 0, full)]) }));
          shown[n].ends.forEach((end, i) => { end.textContent = labels[i]; });
        });
    };
  }

  return {
    node,
    remeasure() { width = 0; },
    build() {
      node.dataset.kind = app.structure.kind;
      draw = app.structure.kind === "beam" ? curves() : maps();
    },
    draw: () => draw(app.result, app.state.a),
  };
}
