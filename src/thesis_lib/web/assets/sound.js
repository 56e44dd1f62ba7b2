// Panels of a sound field: ideal pressure and errors of the best and the worst setting.
import { amplitude, createPressure, decode, playFields } from "./field.js";
import { colourBar, mapWidth } from "./maps.js";
import { KINDS, entitle, figure, html, isNumber } from "./parts.js";

KINDS.sound = (study) => {
  const b = figure("b", html("div", { class: "tl-planes" }), "b, c");
  const shown = [], motion = playFields(shown, study.data.colormap);

  b.canvas.before(motion.node);
  b.foot.append("Best and worst by the median error of the deflection.");
  motion.watch(b.node);

  const isNodal = (name) => study.results().every(({ planes }) => !isNumber(planes[name]?.mean));
  function fieldsOf(name) { // [label, field or null, setting or null]
    const extremes = study.case().extremes?.[study.mode().mode] ?? {};
    const read = ({ fields: all }) => (all?.[name] ? decode(all[name]) : null);
    return [["ideal", isNodal(name) ? null : read(study.mode()), null],
      ...["best", "worst"].filter((word) => extremes[word]).map((word) =>
        [`error of the ${word}`, read(extremes[word]), extremes[word].index])];
  }
  function drawPlane(plane) {
    const { name } = plane, { colormap, pressure_unit: unit, structure } = study.data;
    const width = mapWidth(study, 2), list = fieldsOf(name);
    const half = structure[name[0] === "X" ? "length_mm" : "width_mm"] / 2;
    const [ideal, errors] = [list.slice(0, 1), list.slice(1)].map((part) => // each on its own scale
      Math.max(0, ...part.map(([, field]) => amplitude(field))));
    const bars = [[ideal, "pressure"], [errors, "error"]].filter(([most]) => most)
      .map(([most, words]) => colourBar(colormap, most, unit, words));
    const maps = list.map(([words, field, i], n) => {
      const names = { "data-testid": `field-${name}-${words.split(" ").at(-1)}`,
        "aria-label": `${words} on ${name}` };
      return createPressure(width, plane, half, field, (n ? errors : ideal) || 1,
        i === null ? words : study.heading(i, words), names, study.data.nodal_note);
    });
    shown.push(...maps);
    return html("section", { "aria-label": `${name} plane` },
      html("div", { class: "tl-planehead" }, html("strong", {}, `${name} plane`), ...bars),
      html("div", { class: "tl-maps" }, ...maps.map(({ element }) => element)));
  }
  function draw() {
    entitle(b, study, "group", "Sound pressure: ideal, and what the measured shapes add to it", "",
      "The button plays the period; the slider sets the instant.");
    shown.length = 0;
    b.canvas.replaceChildren(...study.data.planes.map(drawPlane));
    motion.redraw();
  }
  return { figures: [b.node], draw, stop: motion.stop };
};
