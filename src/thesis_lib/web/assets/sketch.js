// Panel (a): the bending structure and the cameras around it, in a rotatable view.
import { entitle, fill, heightOf, isNumber, lines, path, resize, svg, text } from "./parts.js";
import { towards } from "./pinhole.js";
import {
  RAD, SQUARE, bent, dot, drawAxes, drawCamera, drawClamp, drawHemisphere, drawRing,
  orbitHemisphere, plus, times, trace, turnable,
} from "./space.js";

const DRAWN_DEFLECTION = 0.06; // drawn deflection, relative to the structure's length

export function createSketch(panel, study) { // returns the drawing function
  const view = { azimuth: 158, elevation: 33 }, shape = path("tl-mesh");
  let bending = []; // screen curves of the mesh through the markers

  function mesh() { // curves of points [X, Y, deflection] in mm; a gap in the markers ends one
    const { x_mm: xs, y_mm: ys, structure: { length_mm: length, width_mm: width } } = study.data;
    if (!xs) return [];
    const markers = study.markers(), edge = (y) => // of a beam, from the clamp to the last marker
      [[-length / 2, 0, 0], ...markers].map(([x, , w]) => [x, y, w]);
    const rows = ys ? ys.map((_, j) => markers.slice(j * xs.length, (j + 1) * xs.length))
      : [-width / 2, width / 2].map(edge);
    const columns = rows[0].map((_, i) => rows.map((row) => row[i]));
    return [...rows, ...columns].flatMap((row) => row.reduce((parts, place) => {
      if (isNumber(place[2])) parts.at(-1).push(place);
      else if (parts.at(-1).length) parts.push([]);
      return parts;
    }, [[]])).filter((part) => part.length > 1);
  }

  function draw() {
    const { width, data } = study, height = heightOf(width), { label } = data.parameter;
    entitle(panel, study, "img", "Cameras; varied: ", label, "Arrow keys rotate.");
    const { kind, length_mm: length } = data.structure, every = study.settings();
    const shown = every.map((_, i) => i).filter((i) => study.stateOf(i) === "on");
    const distances = new Set(every.flatMap((one) => one.cameras.map((camera) => camera[0])));
    const half = length / 2, across = (data.structure.width_mm ?? 30) / 2;
    const radius = Math.max(...distances, half * 1.1);
    const space = orbitHemisphere(view, radius, width, height, 70);
    const { viewer, flat, line, unit } = space;

    const curves = data.structure.contours_mm ?? [SQUARE.map(([u, v]) => [u * half, v * across])];
    const outline = curves.map((curve) =>
      lines(curve.map(([x, y]) => flat([x, y, 0])), "Z")).join("");
    const places = mesh(), most = Math.max(...places.flat().map(([, , w]) => Math.abs(w)));
    const rise = (unit * DRAWN_DEFLECTION * length * Math.cos(view.elevation * RAD)) / (most || 1);
    bending = places.map((curve) => curve.map(([x, y, w]) => [...flat([x, y, 0]), rise * w]));
    const scene = [
      ...[...distances].map((r) => drawRing(space, r)), ...drawHemisphere(space, radius),
      ...drawAxes(space, [half, across, 0], 0.16 * radius),
      path(bending.length ? "tl-rest" : "tl-plate", outline), shape,
      ...(kind === "beam" ? [drawClamp(space, half, radius)] : [])];
    for (const { name, u_mm: [u0, u1], z_mm: [z0, z1] } of data.planes ?? []) { // of a sound study
      const rectangle = [[u0, z0], [u1, z0], [u1, z1], [u0, z1]]
        .map(([u, z]) => (name.startsWith("X") ? [u, 0, z] : [0, u, z]));
      const [x, y] = flat(rectangle[3]);
      scene.push(line("tl-plane", rectangle, "Z"), text(x, y - 4, name, "tl-muted"));
    }

    // Cameras: pyramids with the tip at the centre of projection. A camera in several highlighted
    // settings has the colour of the first.
    const seen = new Set(), pyramids = [];
    function pyramid(camera, style = null) {
      const [distance, ...angles] = camera, tip = times(towards(angles), distance);
      if (seen.has(String(camera))) return;
      seen.add(String(camera));
      const drawn = drawCamera(space, tip, 0.12 * radius);
      if (style) scene.push(line("tl-sight", [tip, [0, 0, 0]], "", style));
      pyramids.push([dot(tip, viewer),
        svg("g", { class: `tl-camera${style ? "" : " tl-faint"}`, style }, drawn)]);
    }
    for (const i of shown) for (const camera of every[i].cameras) pyramid(camera, study.tint(i));
    for (const one of every) for (const camera of one.cameras) pyramid(camera);
    scene.push(...pyramids.sort(([one], [two]) => one - two).map(([, group]) => group));
    resize(panel, width, height).replaceChildren(...scene, ...drawAperture(every, shown, space));
  }

  function drawAperture(every, shown, { flat, line }) { // between the first two optical axes
    if (!study.data.parameter.name.startsWith("aperture") || shown.length > 2) return [];
    return shown.flatMap((i, n) => {
      const { cameras: [[distance]], cameras, label } = every[i];
      const [one, two] = cameras.map(([, ...angles]) => towards(angles));
      if (!two) return [];
      const angle = Math.acos(dot(one, two) * 0.99999);
      const size = (distance * (0.66 - 0.2 * n)) / Math.sin(angle);
      const arc = trace((t) => plus(times(one, size * Math.sin((1 - t) * angle)),
        times(two, size * Math.sin(t * angle))), 32);
      const [x, y] = flat(arc[16]);
      return [line("tl-arc", arc, "", study.tint(i)), text(x, y - 5, label, "tl-note")];
    });
  }

  turnable(panel.canvas, view, 0, draw);
  panel.foot.append("Drag, or focus and press the arrow keys, to rotate.");
  return { draw, move(phase) { fill(shape, { d: bent(bending, Math.cos(phase)) }); } };
}
