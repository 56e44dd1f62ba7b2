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
  // Solution of a symmetric 3×3 system [xx, xy, xz, yy, yz, zz] by LDLᵀ.
  function solve([xx, xy, xz, yy, yz, zz], [x, y, z]) {
    const yx = xy / xx, zx = xz / xx, dy = yy - yx * xy, rest = yz - yx * xz, zy = rest / dy;
    const dz = zz - zx * xz - zy * rest, y1 = y - yx * x, z1 = (z - zx * x - zy * y1) / dz, y2 = y1 / dy - zy * z1;
    return [x / xx - yx * y2 - zx * z1, y2, z1];
  }

  function addSquare(A, x, y, z) {
    A[0] += x * x; A[1] += x * y; A[2] += x * z; A[3] += y * y; A[4] += y * z; A[5] += z * z;
  }

  // Points that fit their images best: a linear start, then Gauss–Newton steps on the reprojection error (eq. 3.19).
  function triangulate(P, uv, steps = 3) {
    const n = P.length / 12, count = uv.length / (2 * n), points = new Float64Array(3 * count);
    const A = new Float64Array(6), b = new Float64Array(3); // normal equations
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
      let X = 0, Y = 0, Z = 0;
      for (let step = 0; step <= steps; step += 1) {
        A.fill(0);
        b.fill(0);
        for (let i = 0; i < n; i += 1) {
          const k = 12 * i;
          const w = step ? 1 / (Q[k + 8] * X + Q[k + 9] * Y + Q[k + 10] * Z + Q[k + 11]) : 1;
          for (let j = 0; j < 2; j += 1) {
            const a = k + 4 * j, m = uv[(2 * i + j) * count + p] - middle[2 * i + j];
            // Start: (a − m a₃)·X = m b₃ − b. Step: J ΔX = m − h with the reprojection h and J = w (a − h a₃).
            const h = step ? w * (Q[a] * X + Q[a + 1] * Y + Q[a + 2] * Z + Q[a + 3]) : m;
            const r = step ? m - h : m * Q[k + 11] - Q[a + 3];
            const x = w * (Q[a] - h * Q[k + 8]), y = w * (Q[a + 1] - h * Q[k + 9]), z = w * (Q[a + 2] - h * Q[k + 10]);
            addSquare(A, x, y, z);
            b[0] += x * r; b[1] += y * r; b[2] += z * r;
          }
        }
        const [dx, dy, dz] = solve(A, b);
        X += dx; Y += dy; Z += dz;
      }
      points.set([X, Y, Z], 3 * p);
    }
    return points;
  }

  // ∂Z/∂(u, v) in m/px of the refined points, the last row of (JᵀJ)⁻¹Jᵀ, in the order of the images.
  function gainZ(P, points) {
    const n = P.length / 12, count = points.length / 3, uv = project(P, points), g = new Float64Array(uv.length);
    const J = new Float64Array(6 * n), A = new Float64Array(6);
    for (let p = 0; p < count; p += 1) {
      A.fill(0);
      for (let row = 0; row < 2 * n; row += 1) {
        const k = 12 * (row >> 1) + 8, a = k - 8 + 4 * (row & 1), h = uv[row * count + p];
        const w = 1 / (P[k] * points[3 * p] + P[k + 1] * points[3 * p + 1] + P[k + 2] * points[3 * p + 2] + P[k + 3]);
        for (let c = 0; c < 3; c += 1) J[3 * row + c] = w * (P[a + c] - h * P[k + c]);
        addSquare(A, J[3 * row], J[3 * row + 1], J[3 * row + 2]);
      }
      const [x, y, z] = solve(A, [0, 0, 1]);
      for (let row = 0; row < 2 * n; row += 1)
        g[row * count + p] = x * J[3 * row] + y * J[3 * row + 1] + z * J[3 * row + 2];
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
  // Deflections that cameras with whole pixels measure, with their pixel grids shifted (null: the literal run).
  function measure(P, rest, deflected, shifts = null, restIsKnown = false) {
    const rebuilt = (points) => {
      const uv = pixelate(project(P, points, shifts)), count = points.length / 3;
      return triangulate(P, shifts ? uv.map((value, i) => value - shifts[Math.floor(i / count)]) : uv);
    };
    const high = rebuilt(deflected), low = restIsKnown ? rest : rebuilt(rest);
    return Float64Array.from({ length: rest.length / 3 }, (_, p) => high[3 * p + 2] - low[3 * p + 2]);
  }

  // Point, mean (rms) and largest error in % of the largest reference deflection (eq. 3.22, 3.23).
  function percentErrors(measured, reference) {
    const scale = 100 / max(...reference.map(abs)), point = Array.from(measured, (w, i) => abs(w - reference[i]) * scale);
    return { point, mean: sqrt(point.reduce((sum, e) => sum + e * e, 0) / point.length), largest: max(...point) };
  }

  return { ...pinhole, markers, modeShape, deflectionShape, worldPoints, triangulate, gainZ, deflectionVariance, measure,
    percentErrors };
})();
