// Panels of a sound field: the ideal pressure on each plane, and the errors of the best and the worst setting,
// at any instant of the period.
import { colourBar, createMap, mapWidth, paletteOf } from "./heatmap.js";
import { createMotion } from "./motion.js";
import { KINDS, entitle, figure, html, isNumber, path, swatch } from "./parts.js";

function decode({ scale, re, im }) { // complex pressures at the points, u-major
  const numbers = (code) => Int8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  return { scale: scale / 127, re: numbers(re), im: numbers(im) };
}
function amplitude(field) {
  const { scale, re, im } = field ?? { scale: 0, re: [], im: [] };
  let most = 0;
  for (let n = 0; n < re.length; n++) most = Math.max(most, re[n] * re[n] + im[n] * im[n]);
  return scale * Math.sqrt(most);
}

KINDS.sound = (study, uid) => {
  const b = figure("b", html("div", { class: "tl-planes" }), "b, c");
  let colours = [], fields = []; // what is on the screen

  const motion = createMotion((phase) => {
    const cos = Math.cos(phase), sin = Math.sin(phase);
    for (const one of fields) paint(one, cos, sin);
  }, false); // a sound plays only when it is asked to
  b.canvas.before(motion.node);
  b.foot.append("Best and worst by the median error of the deflection.");
  motion.watch(b.node);

  // --- one field
  function paint({ context, image, pixels, field: { scale, re, im }, most, shape: [nu, nz] }, cos, sin) {
    const middle = (colours.length - 1) / 2, factor = (scale * middle) / most;
    for (let iz = nz - 1, at = 0; iz >= 0; iz--) for (let iu = 0; iu < nu; iu++, at++) { // from the top
      const n = iu * nz + iz, step = Math.round(middle + factor * (re[n] * cos - im[n] * sin));
      pixels[at] = colours[Math.max(0, Math.min(2 * middle, step))];
    }
    context.putImageData(image, 0, 0);
  }
  function drawField(width, plane, most, [word, field, i]) {
    const { u_mm: [u0, u1], z_mm: [z0, z1], shape: [nu, nz], name } = plane;
    const du = (u1 - u0) / (nu - 1) / 2, dz = (z1 - z0) / (nz - 1) / 2; // a pixel around each point
    const map = createMap(width, [u0 - du, u1 + du], [0, z1 + dz], `${name[0]} (mm)`, "Z (mm)");
    const half = study.data.structure[name[0] === "X" ? "length_mm" : "width_mm"] / 2;
    map.node.append(map.frame(), path("tl-slab", `M${map.x(-half)} ${map.y(0)}H${map.x(half)}`));
    const place = (node) => {
      const size = { left: map.x(u0 - du), top: map.y(z1 + dz), width: map.unit * (u1 - u0 + 2 * du),
        height: map.unit * (z1 - z0 + 2 * dz) };
      for (const [key, value] of Object.entries(size)) node.style[key] = `${value}px`;
      return node;
    };
    const picture = html("div", { class: "tl-picture" }, map.node);
    const names = { "data-testid": `field-${name}-${word}`, "aria-label": `${saidOf(word)} on ${name}` };
    if (field) {
      const canvas = html("canvas", { width: nu, height: nz, role: "img", ...names });
      const context = canvas.getContext("2d");
      const image = context.createImageData(nu, nz), pixels = new Uint32Array(image.data.buffer);
      fields.push({ context, image, pixels, field, most, shape: plane.shape });
      picture.append(place(canvas));
    } else {
      picture.append(place(html("div", { class: "tl-nodal-note", ...names }, study.data.nodal_note)));
    }
    return html("div", { class: "tl-map" }, html("p", { class: "tl-maphead" }, headingOf(word, i)), picture);
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
    colours = Uint32Array.from(paletteOf(study.data.colormap),
      ([red, green, blue]) => (255 << 24) | (blue << 16) | (green << 8) | red);
    fields = [];
    b.canvas.replaceChildren(...study.data.planes.map((plane) =>
      drawPlane({ plane, list: fieldsOf(plane.name) })));
    motion.redraw();
  }
  return { figures: [b.node], draw, highlight() {}, stop: motion.stop };
};
