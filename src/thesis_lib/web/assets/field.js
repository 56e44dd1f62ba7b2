// Sound fields on planes at any instant of the period, from complex pressures at points, u-major.
import { channelsOf, createMap } from "./maps.js";
import { createMotion } from "./motion.js";
import { clamp, html, path } from "./parts.js";

export function decode({ scale, re, im }) {
  const numbers = (code) => Int8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  return { scale: scale / 127, re: numbers(re), im: numbers(im) };
}
export const amplitude = (field) => (field ? field.scale * field.re.reduce(
  (most, re, n) => Math.max(most, Math.hypot(re, field.im[n])), 0) : 0);
// Plays the fields of a list, which may change, but only on request.
export const playFields = (shown, colormap) => {
  const colours = Uint32Array.from(colormap.map(channelsOf),
    ([red, green, blue]) => (255 << 24) | (blue << 16) | (green << 8) | red);
  return createMotion([(phase) =>
    shown.forEach((one) => one.paint(colours, Math.cos(phase), Math.sin(phase)))], false);
};

// A plane with axes in mm over a structure from −half to half, with its field, or the reason of its
// absence. Returns the element and a function that paints an instant on a scale up to `most`.
export function createPressure(width, plane, half, field, most, heading, names, words) {
  const { u_mm: [u0, u1], z_mm: [z0, z1], shape: [nu, nz], name } = plane;
  const du = (u1 - u0) / (nu - 1) / 2, dz = (z1 - z0) / (nz - 1) / 2; // a pixel around each point
  const { node, x, y, unit, frame } =
    createMap(width, [u0 - du, u1 + du], [0, z1 + dz], `${name[0]} (mm)`, "Z (mm)");
  node.append(frame(), path("tl-slab", `M${x(-half)} ${y(0)}H${x(half)}`));
  const size = { left: x(u0 - du), top: y(z1 + dz), width: unit * (u1 - u0 + 2 * du),
    height: unit * (z1 - z0 + 2 * dz) };
  const style = Object.entries(size).map(([key, value]) => `${key}: ${value}px`).join("; ");
  const shown = field
    ? html("canvas", { width: nu, height: nz, role: "img", style, ...names })
    : html("div", { class: "tl-nodal-note", style, ...names }, words);
  const element = html("div", { class: "tl-map" }, html("p", { class: "tl-maphead" }, heading),
    html("div", { class: "tl-picture" }, node, shown));
  if (!field) return { element, paint() {} };
  const context = shown.getContext("2d"), image = context.createImageData(nu, nz);
  const pixels = new Uint32Array(image.data.buffer), { scale, re, im } = field;
  return { element, paint(colours, cos, sin) {
    const middle = colours.length >> 1, factor = (scale * middle) / most;
    for (let iz = nz - 1, at = 0; iz >= 0; iz--) for (let iu = 0; iu < nu; iu++, at++) { // from the top
      const n = iu * nz + iz, step = Math.round(middle + factor * (re[n] * cos - im[n] * sin));
      pixels[at] = colours[clamp(step, [0, 2 * middle])];
    }
    context.putImageData(image, 0, 0);
  } };
}
