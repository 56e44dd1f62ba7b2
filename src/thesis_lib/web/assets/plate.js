// Panels of a plate: (b) the reference and (c) the measured shapes, as maps of its markers.
import {
  colourBar, createMap, isDark, mapWidth, paletteOf, rgb, scaleOf, stepOf, written,
} from "./heatmap.js";
import { KINDS, entitle, figure, fill, html, isNumber, path, show, svg, swatch } from "./parts.js";

KINDS.plate = (study, uid) => {
  const [b, c] = ["b", "c"].map((letter) => {
    const panel = figure(letter, html("div", { class: "tl-maps", tabindex: 0 })), scale = html("div");
    const readout = html("p", { class: "tl-readout", "data-testid": `readout-${letter}` });
    panel.canvas.after(scale, readout);
    return { ...panel, scale, readout, maps: [] };
  });
  fill(c.readout, { "aria-live": "polite" });
  let cell = null; // the pointed one

  function limit() { // over all settings, so that the scale stays while settings are compared
    const every = [study.mode().reference_mm, ...study.results().map((r) => r.measured_mm)].flat();
    return every.filter(isNumber).reduce((most, value) => Math.max(most, Math.abs(value)), 0) || 1;
  }
  function shown() { // the best and the worst setting; a highlighted third one takes the place of the worst
    if (study.compare === "all") return study.settings().map((_, i) => i);
    const [best, worst] = study.extremes(), active = study.active();
    return [...new Set([best, active === null || active === best ? worst : active])].filter((i) => i >= 0);
  }

  // --- one map
  function createCells(width, deflections, most) {
    const { length_mm: length, width_mm: across } = study.data.structure, [nx, ny] = study.data.grid;
    const map = createMap(width, [0, length], [0, across], "X (mm)", "Y (mm)");
    const palette = paletteOf(study.data.colormap), { x_mm: xs, y_mm: ys } = study.data;
    const size = { width: (map.unit * length) / nx, height: (map.unit * across) / ny };
    const rowOf = (n) => Math.floor(n / nx), [left, top] = [map.x(0), map.y(across)];
    const corner = (n) => ({ x: left + size.width * (n % nx), y: top + size.height * (ny - 1 - rowOf(n)) });
    const cells = svg("g", { class: "tl-cells" }), dots = ["", ""];
    deflections.forEach((value, n) => {
      if (!isNumber(value)) return;
      const colour = palette[stepOf(value, most)];
      cells.append(svg("rect", { ...corner(n), ...size, fill: rgb(colour) }));
      dots[isDark(colour) ? 1 : 0] += `M${map.x(xs[n % nx])} ${map.y(ys[rowOf(n)])}h0`;
    });
    const cursor = svg("g", { class: "tl-cursor" },
      svg("rect", { class: "tl-halo", ...size }), svg("rect", size));
    map.node.append(cells, path("tl-dots", dots[0]), path("tl-dots tl-light", dots[1]), map.frame(), cursor);
    const cellAt = (event) => {
      const box = map.node.getBoundingClientRect();
      const ix = Math.floor((event.clientX - box.left - left) / size.width);
      const iy = ny - 1 - Math.floor((event.clientY - box.top - top) / size.height);
      return ix >= 0 && ix < nx && iy >= 0 && iy < ny ? iy * nx + ix : null;
    };
    const on = (name, handler) => map.node.addEventListener(name, handler);
    on("pointerdown", (event) => point(cellAt(event)));
    on("pointermove", (event) => point(cellAt(event)));
    on("pointerleave", (event) => { if (event.pointerType === "mouse") point(null); });
    const move = (n) => {
      const { x, y } = corner(n ?? 0);
      fill(cursor, { visibility: n === null ? "hidden" : "visible", transform: `translate(${x} ${y})` });
    };
    return { node: map.node, move };
  }
  function drawMap(panel, width, deflections, most, testid, ...heading) {
    const map = createCells(width, deflections, most);
    panel.maps.push(map);
    panel.canvas.append(html("div", { class: "tl-map", "data-testid": testid },
      html("p", { class: "tl-maphead" }, ...heading), map.node));
  }

  // --- the pointed marker: by mouse, finger or arrow keys
  function point(index) {
    cell = index;
    for (const map of [...b.maps, ...c.maps]) map.move(cell);
    const scale = scaleOf(limit(), "mm");
    const value = (list) => (isNumber(list[cell]) ? written(list[cell], scale) : "–");
    if (cell === null) {
      b.readout.textContent = "Point at a cell, or focus and press the arrow keys, to read it.";
      c.readout.textContent = "In (d), point at a bar to show its setting; click or press Enter to keep it.";
      return;
    }
    const { x_mm: x, y_mm: y, grid: [nx] } = study.data, reference = value(study.mode().reference_mm);
    const place = `X ${x[cell % nx].toFixed(0)} mm, Y ${y[Math.floor(cell / nx)].toFixed(0)} mm`;
    const measured = shown().map((i) => {
      const { measured_mm: list, point_error: errors } = study.results()[i];
      return `${study.nameOf(i)}: ${value(list)}${errors ? `, error ${show(errors[cell])}\u00a0%` : ""}`;
    });
    b.readout.textContent = `${place}: reference ${reference}`;
    c.readout.textContent = `${place}: reference ${reference}; ${measured.join("; ")}`;
  }
  function walk(event) {
    const [nx, ny] = study.data.grid, from = cell ?? 0, column = from % nx, row = Math.floor(from / nx);
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const [dx, dy] = steps[event.key] ?? [], within = (at, count) => Math.max(0, Math.min(count - 1, at));
    if (event.key === "Escape") point(null);
    else if (dx === undefined) return;
    else point(cell === null ? 0 : within(row + dy, ny) * nx + within(column + dx, nx));
    event.preventDefault();
  }
  for (const { canvas } of [b, c]) canvas.addEventListener("keydown", walk);

  function drawMeasured() {
    const most = limit();
    c.maps = [];
    c.canvas.replaceChildren();
    shown().forEach((i, n) => {
      const notes = [study.extremeWord(i), i === study.pinned ? "pinned" : ""].filter(Boolean).join(", ");
      const words = html("span", { style: study.tint(i), "data-setting": i },
        swatch(i), study.nameOf(i), html("em", {}, notes));
      drawMap(c, mapWidth(study, 1), study.results()[i].measured_mm, most, `map-${n}`, words);
    });
    point(cell);
  }
  return {
    figures: [b.node, c.node],
    draw() {
      const most = limit(), palette = paletteOf(study.data.colormap), width = mapWidth(study, 1);
      const help = "Arrow keys move from marker to marker.";
      entitle(b, study, "img", "Reference shape", "", help);
      entitle(c, study, "img", "Measured shapes", "", help);
      b.maps = [];
      b.canvas.replaceChildren();
      drawMap(b, width, study.mode().reference_mm, most, "map-ideal", "ideal");
      [b, c].forEach(({ scale }, n) => scale.replaceChildren(
        colourBar(`${uid}-scale-${n}`, palette, most, "mm", "deflection", Math.min(width - 110, 240))));
    },
    highlight: drawMeasured,
    stop() {},
  };
};
