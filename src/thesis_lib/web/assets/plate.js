// Panels of a plate: (b) the reference and (c) the measured shapes, as maps of its markers.
import { colourBar, colourOf, createMap, mapWidth, scaleOf, written } from "./maps.js";
import { ARROWS, KINDS, clamp, entitle, figure, fill, html, isNumber, show, svg } from "./parts.js";

KINDS.plate = (study) => {
  const [b, c] = ["b", "c"].map((letter) => {
    const canvas = html("div", { class: "tl-maps", tabindex: 0, onkeydown: walk });
    const panel = figure(letter, canvas), scale = html("div");
    panel.canvas.after(scale);
    return { ...panel, scale, cursors: [] };
  });
  const readout = html("p",
    { class: "tl-readout", "data-testid": "readout", "aria-live": "polite" });
  c.scale.after(readout);
  let cell = null; // the selected one

  function limit() { // over all settings, so that the scale stays while settings are compared
    const every = [study.mode().reference_mm, ...study.results().map((r) => r.measured_mm)].flat();
    return Math.max(0, ...every.filter(isNumber).map(Math.abs)) || 1;
  }
  function shown() { // the best and the worst setting; a highlighted one replaces the worst
    if (study.compare === "all") return study.settings().map((_, i) => i);
    const [best, worst] = study.extremes(), active = study.active();
    return [...new Set([best, active === null || active === best ? worst : active])]
      .filter((i) => i >= 0);
  }

  // --- one map
  function drawMap(panel, deflections, most, testid, heading) {
    const { length_mm: length, width_mm: across } = study.data.structure, [nx, ny] = study.data.grid;
    const { node, x, y, unit, frame } =
      createMap(mapWidth(study, 1), [0, length], [0, across], "X (mm)", "Y (mm)");
    const size = { width: (unit * length) / nx, height: (unit * across) / ny };
    const corner = (n) => ({ x: x(0) + size.width * (n % nx),
      y: y(across) + size.height * (ny - 1 - Math.floor(n / nx)) });
    const cells = svg("g", { class: "tl-cells" }, deflections.map((value, n) => isNumber(value) &&
      svg("rect", { ...corner(n), ...size, "data-n": n,
        fill: colourOf(study.data.colormap, value, most) })));
    const cursor = svg("g", { class: "tl-cursor" },
      svg("rect", { class: "tl-halo", ...size }), svg("rect", size));
    const pointAt = ({ target: { dataset } }) => point("n" in dataset ? Number(dataset.n) : null);
    fill(node, { onpointerdown: pointAt, onpointermove: pointAt,
      onpointerleave(event) { if (event.pointerType === "mouse") point(null); } },
    cells, frame(), cursor);
    panel.canvas.append(html("div", { class: "tl-map", "data-testid": testid },
      html("p", { class: "tl-maphead" }, heading), node));
    panel.cursors.push((n) => {
      const { x: cx, y: cy } = corner(n ?? 0), visibility = n === null ? "hidden" : "visible";
      fill(cursor, { visibility, transform: `translate(${cx} ${cy})` });
    });
  }
  function clear(panel) {
    panel.cursors = [];
    panel.canvas.replaceChildren();
  }

  // --- the selected marker: by mouse, finger or arrow keys
  function point(index) {
    cell = index;
    for (const move of [...b.cursors, ...c.cursors]) move(cell);
    const scale = scaleOf(limit(), "mm");
    const value = (list) => (isNumber(list[cell]) ? written(list[cell], scale) : "–");
    readout.textContent = "Point at a cell, or focus and press the arrow keys, to read it. " +
      "In (d), point at a bar to show its setting; click or press Enter to keep it.";
    if (cell === null) return;
    const { x_mm: x, y_mm: y, grid: [nx] } = study.data;
    const place = `X ${x[cell % nx].toFixed(0)} mm, Y ${y[Math.floor(cell / nx)].toFixed(0)} mm`;
    const measured = shown().map((i) => {
      const { measured_mm: list, point_error: errors } = study.results()[i];
      const error = errors ? `, error ${show(errors[cell])}\u00a0%` : "";
      return `${study.nameOf(i)}: ${value(list)}${error}`;
    });
    const reference = `${place}: reference ${value(study.mode().reference_mm)}`;
    readout.textContent = [reference, ...measured].join("; ");
  }
  function walk(event) {
    const [nx, ny] = study.data.grid, [dx, dy] = ARROWS[event.key] ?? [];
    if (event.key === "Escape") point(null);
    else if (dx === undefined) return;
    else point(cell === null ? 0 : clamp(Math.floor(cell / nx) + dy, [0, ny - 1]) * nx +
      clamp((cell % nx) + dx, [0, nx - 1]));
    event.preventDefault();
  }

  function drawMeasured() {
    const most = limit();
    clear(c);
    shown().forEach((i, n) => {
      const notes = [study.extremeWord(i), i === study.pinned ? "pinned" : ""].filter(Boolean);
      drawMap(c, study.results()[i].measured_mm, most, `map-${n}`,
        study.heading(i, notes.join(", ")));
    });
    point(cell);
  }
  return {
    figures: [b.node, c.node],
    draw() {
      const most = limit();
      const help = "Arrow keys move from marker to marker.";
      entitle(b, study, "img", "Reference shape", "", help);
      entitle(c, study, "img", "Measured shapes", "", help);
      clear(b);
      drawMap(b, study.mode().reference_mm, most, "map-ideal", "ideal");
      for (const { scale } of [b, c])
        scale.replaceChildren(colourBar(study.data.colormap, most, "mm", "deflection"));
    },
    highlight: drawMeasured,
  };
};
