// Bending beams and plates, and their measurement by cameras: a second implementation, so that a
// page can compute without a kernel. Names are those of `vibration` and `vision`, with which
// tests/book/test_recompute.py compares; units and array orders are those of pinhole.js.
import { hemisphereCameras, inView, pixelate, project, radians, rint } from "./pinhole.js";

// --- vibration: structure.py
// Coordinates of the markers in the structure's own frame, [[x, …], [y, …]].
export function markers({ kind, length, width, row, grid }) {
  if (kind === "beam") {
    const x = Array.from({ length: row.count }, (_, i) => i * row.spacing + row.first);
    return [x, x.map(() => width / 2)];
  }
  const [nx, ny] = grid, every = Array.from({ length: nx * ny }, (_, i) => i); // x runs fastest
  return [every.map((i) => ((i % nx) + 0.5) * length / nx),
    every.map((i) => (Math.floor(i / nx) + 0.5) * width / ny)];
}

// Mode shape at one point, 2 at its largest (eq. 3.4 with its sign corrected, eq. 4.4).
export function modeShape({ kind, length, width, roots, indices }, mode, x, y) {
  const { PI, cos, exp, sin } = Math;
  if (kind === "plate") {
    const [m1, m2] = indices[mode - 1];
    return 2 * sin(m1 * PI * x / length) * sin(m2 * PI * y / width);
  }
  const beta = Number(roots[mode - 1]), decay = exp(-beta), s = x / length;
  // (1 − σ)/2 · e^β
  const grow = (decay + cos(beta) + sin(beta)) / (1 + decay ** 2 + 2 * decay * cos(beta));
  const sigma = 1 - 2 * grow * decay;
  return grow * exp(beta * (s - 1)) + (1 + sigma) / 2 * exp(-beta * s)
    - cos(beta * s) + sigma * sin(beta * s);
}

// Largest deflection of every marker in one mode, whose maximum on the structure is `peak`.
export function deflectionShape(structure, mode, peak) {
  const [x, y] = markers(structure);
  return x.map((_, i) => modeShape(structure, mode, x[i], y[i]) * (peak / 2));
}

// Markers in world coordinates for given deflections: origin at the structure's centre.
export function worldPoints(structure, deflections) {
  const [x, y] = markers(structure), { length, width } = structure;
  return Float64Array.from(
    x.flatMap((_, i) => [x[i] - length / 2, y[i] - width / 2, deflections[i]]));
}

// --- triangulation.py
// Solution of a symmetric 3×3 system by LDLᵀ, into `into`.
function solveSymmetric(xx, xy, xz, yy, yz, zz, x, y, z, into) {
  const yx = xy / xx, zx = xz / xx, dy = yy - yx * xy, rest = yz - yx * xz, zy = rest / dy;
  const dz = zz - zx * xz - zy * rest, y1 = y - yx * x, z1 = (z - zx * x - zy * y1) / dz;
  const y2 = y1 / dy - zy * z1;
  into[0] = x / xx - yx * y2 - zx * z1;
  into[1] = y2;
  into[2] = z1;
}

// Least-squares points from images: a linear start, then Gauss–Newton steps on the reprojection
// error (eq. 3.19). From given start points the second step changes less than 1e-5 px.
export function triangulate(P, uv, given = null) {
  const n = P.length / 12, count = uv.length / (2 * n), steps = given ? 2 : 3;
  const points = new Float64Array(3 * count), d = new Float64Array(3);
  const middle = new Float64Array(2 * n), Q = P.slice(); // pixels from the principal point
  for (let i = 0; i < n; i += 1) {
    const k = 12 * i, norm = Math.hypot(P[k + 8], P[k + 9], P[k + 10]);
    for (let c = 0; c < 12; c += 1) Q[k + c] /= norm;
    for (let j = 0; j < 2; j += 1) {
      const a = k + 4 * j, m = Q[a] * Q[k + 8] + Q[a + 1] * Q[k + 9] + Q[a + 2] * Q[k + 10];
      for (let c = 0; c < 4; c += 1) Q[a + c] -= m * Q[k + 8 + c];
      middle[2 * i + j] = m;
    }
  }
  for (let p = 0; p < count; p += 1) {
    let [X, Y, Z] = given ? given.subarray(3 * p, 3 * p + 3) : [0, 0, 0];
    for (let step = given ? 1 : 0; step <= steps; step += 1) {
      let xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, bx = 0, by = 0, bz = 0;
      for (let row = 0; row < 2 * n; row += 1) { // normal equations
        const k = 12 * (row >> 1) + 8, a = k - 8 + 4 * (row & 1);
        const m = uv[row * count + p] - middle[row];
        const w = step ? 1 / (Q[k] * X + Q[k + 1] * Y + Q[k + 2] * Z + Q[k + 3]) : 1;
        // Start: (a − m a₃)·X = m b₃ − b. Step: J ΔX = m − h, reprojection h, J = w (a − h a₃).
        const h = step ? w * (Q[a] * X + Q[a + 1] * Y + Q[a + 2] * Z + Q[a + 3]) : m;
        const r = step ? m - h : m * Q[k + 3] - Q[a + 3];
        const x = w * (Q[a] - h * Q[k]), y = w * (Q[a + 1] - h * Q[k + 1]);
        const z = w * (Q[a + 2] - h * Q[k + 2]);
        xx += x * x; xy += x * y; xz += x * z; yy += y * y; yz += y * z; zz += z * z;
        bx += x * r; by += y * r; bz += z * r;
      }
      solveSymmetric(xx, xy, xz, yy, yz, zz, bx, by, bz, d);
      X += d[0]; Y += d[1]; Z += d[2];
    }
    points.set([X, Y, Z], 3 * p);
  }
  return points;
}

// ∂Z/∂(u, v) in m/px of the refined points, the last row of (JᵀJ)⁻¹Jᵀ, in the order of the images.
export function gainZ(P, points) {
  const n = P.length / 12, count = points.length / 3, uv = project(P, points);
  const g = new Float64Array(uv.length), J = new Float64Array(6 * n), d = new Float64Array(3);
  for (let p = 0; p < count; p += 1) {
    const [X, Y, Z] = points.subarray(3 * p, 3 * p + 3);
    let xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    for (let row = 0; row < 2 * n; row += 1) {
      const k = 12 * (row >> 1) + 8, a = k - 8 + 4 * (row & 1), h = uv[row * count + p];
      const w = 1 / (P[k] * X + P[k + 1] * Y + P[k + 2] * Z + P[k + 3]);
      const x = w * (P[a] - h * P[k]), y = w * (P[a + 1] - h * P[k + 1]);
      const z = w * (P[a + 2] - h * P[k + 2]);
      xx += x * x; xy += x * y; xz += x * z; yy += y * y; yz += y * z; zz += z * z;
      J[3 * row] = x; J[3 * row + 1] = y; J[3 * row + 2] = z;
    }
    solveSymmetric(xx, xy, xz, yy, yz, zz, 0, 0, 1, d);
    for (let row = 0; row < 2 * n; row += 1)
      g[row * count + p] = d[0] * J[3 * row] + d[1] * J[3 * row + 1] + d[2] * J[3 * row + 2];
  }
  return g;
}

// --- rounding.py
// Variance in m² of each marker's measured deflection over random grid shifts: the law of rounding.
export function deflectionVariance(P, rest, deflected, restIsKnown = false) {
  const count = rest.length / 3, variance = new Float64Array(count), gd = gainZ(P, deflected);
  const ud = project(P, deflected), ur = project(P, rest), gr = restIsKnown ? null : gainZ(P, rest);
  gd.forEach((g, i) => {
    const delta = ud[i] - ur[i], f = Math.abs(delta - rint(delta));
    variance[i % count] += restIsKnown ? g * g / 12
      : (g - gr[i]) ** 2 / 12 + g * gr[i] * f * (1 - f);
  });
  return variance;
}

// --- vision/simulation.py
// Deflections measured by cameras with whole pixels and shifted pixel grids (null: nominal run).
// `deflected` may hold all markers once per mode; `near` starts at the true points to save steps.
export function measureDeflections(P, rest, deflected, shifts, restIsKnown = false, near = false) {
  const heightsOf = (points) => points.filter((_, i) => i % 3 === 2);
  function measureHeights(points) {
    const count = points.length / 3, pixels = pixelate(project(P, points, shifts));
    const images = shifts ? pixels.map((u, i) => u - shifts[Math.floor(i / count)]) : pixels;
    return heightsOf(triangulate(P, images, near ? points : null));
  }
  const low = restIsKnown ? heightsOf(rest) : measureHeights(rest);
  return measureHeights(deflected).map((high, p) => high - low[p % low.length]);
}

// Point, mean (rms) and largest error in % of the largest reference deflection (eq. 3.22, 3.23).
export function percentErrors(measured, reference) {
  const scale = 100 / reference.reduce((most, w) => Math.max(most, Math.abs(w)), 0);
  const point = reference.map((w, i) => Math.abs(measured[i] - w) * scale);
  const squares = point.reduce((sum, error) => sum + error * error, 0);
  return { point, mean: Math.sqrt(squares / point.length), largest: Math.max(...point) };
}

// --- one setting of cameras, with angles in degrees and distances in mm, as users give them
export const MAX_CAMERAS = 24;

// The n-th pseudorandom number in [0, 1), the same on every visit (mulberry32).
export function randomNumber(n) {
  const seed = Math.imul(n, 0x6d2b79f5);
  let z = Math.imul(seed ^ (seed >>> 15), seed | 1);
  z ^= z + Math.imul(z ^ (z >>> 7), z | 61);
  return ((z ^ (z >>> 14)) >>> 0) / 2 ** 32;
}
// Shifts of pixel grids in ±½ px, by draw, camera and axis: results change smoothly with inputs.
export const shiftsOf = (draw, cameras, offset) => Float64Array.from({ length: 2 * cameras },
  (_, i) => randomNumber(draw * 2 * MAX_CAMERAS + i + 1) - 0.5 + offset);

// The largest distance between two images of a marker in a camera, in px.
function largestMotion(before, after, count) {
  let most = 0;
  for (let i = 0; i < before.length; i += 2 * count) // per camera u, then v
    for (let u = i, v = i + count; u < i + count; u += 1, v += 1)
      most = Math.max(most, Math.hypot(after[u] - before[u], after[v] - before[v]));
  return most;
}

// Simulated measurement of some modes: nominal run, predicted errors, and trials one by one.
// `shapes` are modes with largest deflections in m; `offset` is that of the principal point.
export function simulateSetting(setting, structure, shapes) {
  const { distance, cameras, focal, size, known, offset = 0 } = setting;
  const P = hemisphereCameras(distance / 1000, cameras.map(radians), focal, size);
  const references = shapes.map(({ mode, peak }) => deflectionShape(structure, mode, peak));
  const count = references[0].length, rest = worldPoints(structure, Array(count).fill(0));
  const points = references.map((reference) => worldPoints(structure, reference));
  const all = Float64Array.from(points.flatMap((one) => [...one])), before = project(P, rest);
  const measure = (shifts, near) => measureDeflections(P, rest, all, shifts, known, near);
  const part = (values, m) => values.subarray(m * count, (m + 1) * count);
  const measured = measure(offset ? new Float64Array(2 * cameras.length).fill(offset) : null);
  const modes = references.map((reference, m) => {
    const variance = deflectionVariance(P, rest, points[m], known), images = project(P, points[m]);
    const mean = variance.reduce((sum, v) => sum + v, 0) / count;
    return {
      reference, deflected: points[m], measured: part(measured, m), variance, means: [], peaks: [],
      errors: percentErrors(part(measured, m), reference),
      inView: inView(images, size, cameras.length),
      moved: largestMotion(before, images, count),
      predicted: 100 * Math.sqrt(mean) / Math.max(...reference.map(Math.abs)),
    };
  });
  function draw() {
    const drawn = measure(shiftsOf(modes[0].means.length, cameras.length, offset), true);
    modes.forEach(({ reference, means, peaks }, m) => {
      const { mean, largest } = percentErrors(part(drawn, m), reference);
      means.push(mean);
      peaks.push(largest);
    });
  }
  const share = modes.reduce((sum, one) => sum + one.inView, 0) / modes.length;
  return { P, rest, modes, draw, inView: share };
}

export function bandOf(values) { // median, 5 % and 95 %
  const sorted = [...values].sort((a, b) => a - b);
  return [0.5, 0.05, 0.95].map((q) => {
    const at = q * (sorted.length - 1), low = Math.floor(at), next = sorted[low + 1] ?? sorted[low];
    return sorted[low] + (at - low) * (next - sorted[low]);
  });
}
