// Panels of a sound field: the ideal pressure on each plane, and the errors of the best and the worst setting,
// at any instant of the period.
import { amplitude, coloursOf, createPressure, createPlane, decode } from "./field.js";
import { colourBar, mapWidth, paletteOf } from "./heatmap.js";
import { createMotion } from "./motion.js";
import { KINDS, entitle, figure, html, isNumber, swatch } from "./parts.js";

KINDS.sound = (study, uid) => {
  const b = figure("b", html("div", { class: "tl-planes" }), "b, c");
  let colours = [], fields = []; // what is on the screen

  const motion = createMotion((phase) => {
    const cos = Math.cos(phase), sin = Math.sin(phase);
    for (const one of fields) one.paint(colours, cos, sin);
  }, false); // a sound plays only when it is asked to
  b.canvas.before(motion.node);
  b.foot.append("Best and worst by the median error of the deflection.");
  motion.watch(b.node);

  // --- one field
  function drawField(width, plane, most, [word, field, i]) {
    const { name } = plane, half = study.data.structure[name[0] === "X" ? "length_mm" : "width_mm"] / 2;
    const picture = createPlane(width, plane, half);
    const names = { "data-testid": `field-${name}-${word}`, "aria-label": `${saidOf(word)} on ${name}` };
    if (field) {
      const one = createPressure(field, most, plane.shape, names);
      fields.push(one);
      picture.put(one.canvas);
    } else {
      picture.put(html("div", { class: "tl-nodal-note", ...names }, study.data.nodal_note));
    }
    return html("div", { class: "tl-map" }, html("p", { class: "tl-maphead" }, headingOf(word, i)), picture.node);
  }

  // --- all of them
  const nodal = (name) => study.results().every((result) => !isNumber(result.planes[name]?.mean));
  function fieldsOf(name) { // [word, field or null, setting or null]
    const extremes = study.case().extremes?.[study.mode().mode] ?? {};
    const read = ({ fields: all }) => (all?.[name] ? decode(all[name]) : null);
    return [["ideal", nodal(name) ? null : read(study.mode()), null],
      ...["best", "worst"].filter((word) => extremes[word]).map((word) =>
        [word, read(extremes[word]), extremes[word].index])];
  }
  const saidOf = (word) => (word === "ideal" ? "ideal" : `error of the ${word}`);
  function headingOf(word, i) {
    if (i === null) return word;
    return html("span", { style: study.tint(i), "data-setting": i },
      swatch(i), study.nameOf(i), html("em", {}, saidOf(word)));
  }
  function drawPlane({ plane, list }) {
    const { name } = plane, { colormap, pressure_unit: unit } = study.data, width = mapWidth(study, 2);
    const palette = paletteOf(colormap), wide = Math.min(width, 260);
    const [ideal, errors] = [list.slice(0, 1), list.slice(1)].map((part) => // each on a scale of its own
      Math.max(0, ...part.map(([, field]) => amplitude(field))));
    const bars = [[ideal, "pressure"], [errors, "error"]].filter(([most]) => most)
      .map(([most, words]) => colourBar(`${uid}-${name}-${words}`, palette, most, unit, words, wide));
    const maps = list.map((one, n) => drawField(width, plane, (n ? errors : ideal) || 1, one));
    return html("section", { "aria-label": `${name} plane` },
      html("div", { class: "tl-planehead" }, html("strong", {}, `${name} plane`), ...bars),
      html("div", { class: "tl-maps" }, ...maps));
  }
  function draw() {
    entitle(b, study, "group", "Sound pressure: ideal, and what the measured shapes add to it", "",
      "The button plays the period; the slider sets the instant.");
    colours = coloursOf(paletteOf(study.data.colormap));
    fields = [];
    b.canvas.replaceChildren(...study.data.planes.map((plane) =>
      drawPlane({ plane, list: fieldsOf(plane.name) })));
    motion.redraw();
  }
  return { figures: [b.node], draw, highlight() {}, stop: motion.stop };
};
