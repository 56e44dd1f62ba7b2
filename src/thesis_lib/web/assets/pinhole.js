// Cameras that look at the origin, and whole pixels, as in vision/pinhole.py. Lengths in m, angles
// in rad, images in px; flat lists of points X Y Z X Y Z …, and of images as (cameras, 2, points).
const { abs, sin, cos } = Math;

const hemisphereDirection = (azimuth, elevation) =>
  [cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation)];

// From the users' angles in degrees.
export const radians = (pair) => pair.map((angle) => (angle * Math.PI) / 180);
export const towards = (pair) => hemisphereDirection(...radians(pair)); // unit vector to a camera
export const apart = (one, two) => Math.hypot(...towards(one).map((c, i) => c - towards(two)[i]));

// Projection matrices K [R | −R C] (eq. 3.10) of equal cameras, 12 numbers each.
export function hemisphereCameras(distance, directions, focalPx, [width, height]) {
  return Float64Array.from(directions.flatMap(([azimuth, elevation]) => {
    const out = hemisphereDirection(azimuth, elevation), C = out.map((c) => distance * c);
    // Rows of the rotation from world to camera: x right, y down, z forward towards the origin.
    const x = [-cos(azimuth), sin(azimuth), 0], z = out.map((c) => -c);
    const y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]];
    const [right, down, forward] = [x, y, z]
      .map((r) => [...r, -(r[0] * C[0] + r[1] * C[1] + r[2] * C[2])]);
    const row = (axis, middle) => axis.map((c, i) => focalPx * c + middle * forward[i]);
    return [...row(right, width / 2), ...row(down, height / 2), ...forward];
  }));
}

// Images of points; `shifts` (u and v by camera) moves each camera's pixel grid.
export function project(P, points, shifts = null) {
  const n = P.length / 12, count = points.length / 3, uv = new Float64Array(2 * n * count);
  for (let i = 0; i < n; i += 1) for (let p = 0; p < count; p += 1) {
    const k = 12 * i, X = points[3 * p], Y = points[3 * p + 1], Z = points[3 * p + 2];
    const depth = P[k + 8] * X + P[k + 9] * Y + P[k + 10] * Z + P[k + 11];
    for (let j = 0; j < 2; j += 1) {
      const a = k + 4 * j, shift = shifts ? shifts[2 * i + j] : 0;
      const w = P[a] * X + P[a + 1] * Y + P[a + 2] * Z + P[a + 3];
      uv[(2 * i + j) * count + p] = w / depth + shift;
    }
  }
  return uv;
}

const ROUNDING_SHIFT = 1.5 * 2 ** 52; // near it a double has no fraction
export const rint = (value) => value + ROUNDING_SHIFT - ROUNDING_SHIFT; // halves to even, like numpy.rint
export function pixelate(uv) { // values within 1e-9 px of a half count as that half
  return uv.map((value) => {
    const doubled = rint(2 * value);
    return rint(abs(2 * value - doubled) < 2e-9 ? doubled / 2 : value);
  });
}

// Share of the images that lie on the sensor.
export function inView(uv, [width, height], n) {
  const count = uv.length / (2 * n);
  let inside = 0;
  for (let i = 0; i < n; i += 1) for (let p = 0; p < count; p += 1) {
    const u = uv[2 * i * count + p], v = uv[(2 * i + 1) * count + p];
    if (u >= 0 && u <= width && v >= 0 && v <= height) inside += 1;
  }
  return inside / (n * count);
}
