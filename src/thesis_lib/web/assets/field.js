// A sound field on a plane above what vibrates, at any instant of the period: complex pressures in a canvas.
import { createMap } from "./heatmap.js";
import { html, path } from "./parts.js";

export function decode({ scale, re, im }) { // complex pressures at the points, u-major
  const numbers = (code) => Int8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  return { scale: scale / 127, re: numbers(re), im: numbers(im) };
}
export function amplitude(field) {
  const { scale, re, im } = field ?? { scale: 0, re: [], im: [] };
  let most = 0;
  for (let n = 0; n < re.length; n++) most = Math.max(most, re[n] * re[n] + im[n] * im[n]);
  return scale * Math.sqrt(most);
}
export const coloursOf = (palette) => Uint32Array.from(palette,
  ([red, green, blue]) => (255 << 24) | (blue << 16) | (green << 8) | red);

// The axes of a plane in mm over a structure that reaches as far as `half`, and a place for what is put on it.
export function createPlane(width, plane, half) {
  const { u_mm: [u0, u1], z_mm: [z0, z1], shape: [nu, nz], name } = plane;
  const du = (u1 - u0) / (nu - 1) / 2, dz = (z1 - z0) / (nz - 1) / 2; // a pixel around each point
  const map = createMap(width, [u0 - du, u1 + du], [0, z1 + dz], `${name[0]} (mm)`, "Z (mm)");
  map.node.append(map.frame(), path("tl-slab", `M${map.x(-half)} ${map.y(0)}H${map.x(half)}`));
  const node = html("div", { class: "tl-picture" }, map.node);
  return { node, put(child) {
    const size = { left: map.x(u0 - du), top: map.y(z1 + dz), width: map.unit * (u1 - u0 + 2 * du),
      height: map.unit * (z1 - z0 + 2 * dz) };
    for (const [key, value] of Object.entries(size)) child.style[key] = `${value}px`;
    node.append(child);
    return child;
  } };
}

// A canvas for a field (nu, nz), drawn to a scale that ends at `most`.
export function createPressure(field, most, [nu, nz], names) {
  const canvas = html("canvas", { width: nu, height: nz, role: "img", ...names });
  const context = canvas.getContext("2d");
  const image = context.createImageData(nu, nz), pixels = new Uint32Array(image.data.buffer);
  const { scale, re, im } = field;
  return { canvas, paint(colours, cos, sin) {
    const middle = (colours.length - 1) / 2, factor = (scale * middle) / most;
    for (let iz = nz - 1, at = 0; iz >= 0; iz--) for (let iu = 0; iu < nu; iu++, at++) { // from the top
      const n = iu * nz + iz, step = Math.round(middle + factor * (re[n] * cos - im[n] * sin));
      pixels[at] = colours[Math.max(0, Math.min(2 * middle, step))];
    }
    context.putImageData(image, 0, 0);
  } };
}
