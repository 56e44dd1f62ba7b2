// The forward model of the explorer: a structure bends, cameras with few pixels see it, and it is rebuilt.
// This is the one place where physics is written twice, so that a page without a kernel can compute while the reader
// drags. Names and conventions are those of the rooms vibration and vision, and tests/book/test_explorer.py
// holds each function against them. Units and the order of points and images are those of pinhole.js.
import pinhole from "./pinhole.js";

export default (() => {
  const { PI, abs, sin, cos, exp, sqrt, max, hypot } = Math, { project, rint, pixelate } = pinhole;

  // --- vibration: structure.py, beam.py, plate.py
  // Coordinates of the markers in the structure's own frame, [[x, …], [y, …]].
  function markers({ kind, length, width, row, grid }) {
    if (kind === "beam") {
      const x = Array.from({ length: row.count }, (_, i) => i * row.spacing + row.first);
      return [x, x.map(() => width / 2)];
    }
    const [nx, ny] = grid, every = Array.from({ length: nx * ny }, (_, i) => i); // x runs fastest
    return [every.map((i) => ((i % nx) + 0.5) * length / nx),
      every.map((i) => (Math.floor(i / nx) + 0.5) * width / ny)];
  }

  // Mode shape at one point, 2 at its largest (eq. 3.4 with its sign put right, eq. 4.4).
  function modeShape({ kind, length, width, roots, indices }, mode, x, y) {
    if (kind === "plate") {
      const [m1, m2] = indices[mode - 1];
      return 2 * sin(m1 * PI * x / length) * sin(m2 * PI * y / width);
    }
    const beta = Number(roots[mode - 1]), decay = exp(-beta), s = x / length;
    const grow = (decay + cos(beta) + sin(beta)) / (1 + decay ** 2 + 2 * decay * cos(beta)); // (1 − σ)/2 · e^β
    const sigma = 1 - 2 * grow * decay;
    return grow * exp(beta * (s - 1)) + (1 + sigma) / 2 * exp(-beta * s) - cos(beta * s) + sigma * sin(beta * s);
  }

  // Single-mode deflection of every marker at the instant of its maximum, scaled to its peak over the structure.
  function deflectionShape(structure, mode, peak) {
    const [x, y] = markers(structure);
    return x.map((_, i) => modeShape(structure, mode, x[i], y[i]) * (peak / 2));
  }

  // Markers in world coordinates for given deflections: origin at the structure's centre.
  function worldPoints(structure, deflections) {
    const [x, y] = markers(structure), { length, width } = structure;
    return Float64Array.from(x.flatMap((_, i) => [x[i] - length / 2, y[i] - width / 2, deflections[i]]));
  }

  // --- triangulation.py
  // Solution of a symmetric 3×3 system by LDLᵀ, into `into`.
  function solve(xx, xy, xz, yy, yz, zz, x, y, z, into) {
    const yx = xy / xx, zx = xz / xx, dy = yy - yx * xy, rest = yz - yx * xz, zy = rest / dy;
    const dz = zz - zx * xz - zy * rest, y1 = y - yx * x, z1 = (z - zx * x - zy * y1) / dz, y2 = y1 / dy - zy * z1;
    into[0] = x / xx - yx * y2 - zx * z1; into[1] = y2; into[2] = z1;
  }

  // Points that fit their images best: a linear start, then Gauss–Newton steps on the reprojection error (eq. 3.19). From points
  // that are given the second step changes less than 1e-5 px.
  function triangulate(P, uv, given = null, steps = given ? 2 : 3) {
    const n = P.length / 12, count = uv.length / (2 * n), points = new Float64Array(3 * count), d = new Float64Array(3);
    const middle = new Float64Array(2 * n), Q = P.slice(); // pixels are counted from the principal point
    for (let i = 0; i < n; i += 1) {
      const k = 12 * i, norm = hypot(P[k + 8], P[k + 9], P[k + 10]);
      for (let c = 0; c < 12; c += 1) Q[k + c] /= norm;
      for (let j = 0; j < 2; j += 1) {
        const a = k + 4 * j, m = Q[a] * Q[k + 8] + Q[a + 1] * Q[k + 9] + Q[a + 2] * Q[k + 10];
        for (let c = 0; c < 4; c += 1) Q[a + c] -= m * Q[k + 8 + c];
        middle[2 * i + j] = m;
      }
    }
    for (let p = 0; p < count; p += 1) {
      let X = given ? given[3 * p] : 0, Y = given ? given[3 * p + 1] : 0, Z = given ? given[3 * p + 2] : 0;
      for (let step = given ? 1 : 0; step <= steps; step += 1) {
        let xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, bx = 0, by = 0, bz = 0; // normal equations
        for (let row = 0; row < 2 * n; row += 1) {
          const k = 12 * (row >> 1) + 8, a = k - 8 + 4 * (row & 1), m = uv[row * count + p] - middle[row];
          const w = step ? 1 / (Q[k] * X + Q[k + 1] * Y + Q[k + 2] * Z + Q[k + 3]) : 1;
          // Start: (a − m a₃)·X = m b₃ − b. Step: J ΔX = m − h with the reprojection h and J = w (a − h a₃).
          const h = step ? w * (Q[a] * X + Q[a + 1] * Y + Q[a + 2] * Z + Q[a + 3]) : m;
          const r = step ? m - h : m * Q[k + 3] - Q[a + 3];
          const x = w * (Q[a] - h * Q[k]), y = w * (Q[a + 1] - h * Q[k + 1]), z = w * (Q[a + 2] - h * Q[k + 2]);
          xx += x * x; xy += x * y; xz += x * z; yy += y * y; yz += y * z; zz += z * z;
          bx += x * r; by += y * r; bz += z * r;
        }
        solve(xx, xy, xz, yy, yz, zz, bx, by, bz, d);
        X += d[0]; Y += d[1]; Z += d[2];
      }
      points[3 * p] = X; points[3 * p + 1] = Y; points[3 * p + 2] = Z;
    }
    return points;
  }

  // ∂Z/∂(u, v) in m/px of the refined points, the last row of (JᵀJ)⁻¹Jᵀ, in the order of the images.
  function gainZ(P, points) {
    const n = P.length / 12, count = points.length / 3, uv = project(P, points), g = new Float64Array(uv.length);
    const J = new Float64Array(6 * n), d = new Float64Array(3);
    for (let p = 0; p < count; p += 1) {
      let xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
      for (let row = 0; row < 2 * n; row += 1) {
        const k = 12 * (row >> 1) + 8, a = k - 8 + 4 * (row & 1), h = uv[row * count + p];
        const w = 1 / (P[k] * points[3 * p] + P[k + 1] * points[3 * p + 1] + P[k + 2] * points[3 * p + 2] + P[k + 3]);
        const x = w * (P[a] - h * P[k]), y = w * (P[a + 1] - h * P[k + 1]), z = w * (P[a + 2] - h * P[k + 2]);
        xx += x * x; xy += x * y; xz += x * z; yy += y * y; yz += y * z; zz += z * z;
        J[3 * row] = x; J[3 * row + 1] = y; J[3 * row + 2] = z;
      }
      solve(xx, xy, xz, yy, yz, zz, 0, 0, 1, d);
      for (let row = 0; row < 2 * n; row += 1)
        g[row * count + p] = d[0] * J[3 * row] + d[1] * J[3 * row + 1] + d[2] * J[3 * row + 2];
    }
    return g;
  }

  // --- rounding.py
  // Variance in m² of each marker's measured deflection over random grid shifts: the law of rounding.
  function deflectionVariance(P, rest, deflected, restIsKnown = false) {
    const count = rest.length / 3, variance = new Float64Array(count), gd = gainZ(P, deflected);
    const gr = restIsKnown ? null : gainZ(P, rest), ud = project(P, deflected), ur = project(P, rest);
    gd.forEach((g, i) => {
      const delta = ud[i] - ur[i], f = abs(delta - rint(delta));
      variance[i % count] += restIsKnown ? g * g / 12 : (g - gr[i]) ** 2 / 12 + g * gr[i] * f * (1 - f);
    });
    return variance;
  }

  // --- vision/simulation.py
  // Deflections that cameras with whole pixels measure, with their pixel grids shifted (null: the nominal run). `deflected` may
  // hold the markers several times, once for each mode.
  function measure(P, rest, deflected, shifts = null, restIsKnown = false) {
    const heights = (points) => {
      const uv = pixelate(project(P, points, shifts)), count = points.length / 3;
      if (shifts) for (let i = 0; i < uv.length; i += 1) uv[i] -= shifts[Math.floor(i / count)];
      return triangulate(P, uv);
    };
    const high = heights(deflected), low = restIsKnown ? rest : heights(rest);
    return new Float64Array(deflected.length / 3).map((_, p) => high[3 * p + 2] - low[(3 * p) % low.length + 2]);
  }

  // Point, mean (rms) and largest error in % of the largest reference deflection (eq. 3.22, 3.23).
  function percentErrors(measured, reference) {
    const scale = 100 / reference.reduce((most, w) => max(most, abs(w)), 0), point = reference.map((w, i) => abs(measured[i] - w) * scale);
    let squares = 0, largest = 0;
    for (const error of point) {
      squares += error * error;
      largest = error > largest ? error : largest;
    }
    return { point, mean: sqrt(squares / point.length), largest: squares >= 0 ? largest : NaN };
  }

  return { ...pinhole, markers, modeShape, deflectionShape, worldPoints, triangulate, gainZ, deflectionVariance, measure,
    percentErrors };
})();
