// One setting of cameras: what they measure of some modes in the nominal run, the law of it, and one draw after the other.
// Angles are in degrees and distances in mm, as readers have them; the model's own units are those of pinhole.js.
import model from "./explorer_model.js";

export default (() => {
  const MOST = 24; // cameras
  const radians = (pair) => pair.map((angle) => (angle * Math.PI) / 180);

  // Shifts of the pixel grids in ±½ px, by draw, camera and axis alone, so that results follow a change smoothly (mulberry32).
  function shiftsOf(draw, cameras, offset) {
    return Float64Array.from({ length: 2 * cameras }, (_, i) => {
      let z = Math.imul(draw * 2 * MOST + i + 1, 0x6d2b79f5);
      z = Math.imul(z ^ (z >>> 15), z | 1);
      z ^= z + Math.imul(z ^ (z >>> 7), z | 61);
      return ((z ^ (z >>> 14)) >>> 0) / 2 ** 32 - 0.5 + offset;
    });
  }

  // `shapes` are modes with the peaks of their deflection in m; `offset` is that of the principal point.
  function simulate({ distance, cameras, focal, size, known, offset = 0 }, structure, shapes) {
    const P = model.hemisphereCameras(distance / 1000, cameras.map(radians), focal, size);
    const references = shapes.map(({ mode, peak }) => model.deflectionShape(structure, mode, peak)), [first] = references;
    const rest = model.worldPoints(structure, first.map(() => 0)), before = model.project(P, rest);
    const points = references.map((reference) => model.worldPoints(structure, reference));
    const all = new Float64Array(points.flatMap((one) => [...one])), count = first.length;
    const part = (values, m) => values.subarray(m * count, (m + 1) * count);
    const seen = known ? all : new Float64Array([...rest, ...all]), exact = model.project(P, seen);
    const measured = model.measure(P, rest, all, offset ? new Float64Array(2 * cameras.length).fill(offset) : null, known);
    const modes = references.map((reference, m) => {
      const variance = model.deflectionVariance(P, rest, points[m], known), images = model.project(P, points[m]);
      const largest = Math.max(...reference.map(Math.abs));
      return { reference, deflected: points[m], measured: part(measured, m), variance, means: [], peaks: [],
        errors: model.percentErrors(part(measured, m), reference), inView: model.inView(images, size, cameras.length),
        moved: images.reduce((most, value, i) => Math.max(most, Math.abs(value - before[i])), 0),
        predicted: (100 / largest) * Math.sqrt(variance.reduce((sum, v) => sum + v, 0) / count) };
    });
    return { P, rest, modes, inView: modes.reduce((sum, one) => sum + one.inView, 0) / modes.length,
      draw() { // as model.measure, from where the markers are
        const shifts = shiftsOf(modes[0].means.length, cameras.length, offset), markers = seen.length / 3;
        const shifted = exact.slice(), each = (add) => {
          for (let row = 0, i = 0; row < shifts.length; row += 1) for (let p = 0; p < markers; p += 1, i += 1) add(i, shifts[row]);
        };
        each((i, shift) => { shifted[i] += shift; });
        const uv = model.pixelate(shifted);
        each((i, shift) => { uv[i] -= shift; });
        const found = model.triangulate(P, uv, seen), skipped = markers - modes.length * count;
        const drawn = new Float64Array(modes.length * count).map((_, p) =>
          found[3 * (p + skipped) + 2] - (known ? rest : found)[3 * (p % count) + 2]);
        modes.forEach(({ reference, means, peaks }, m) => {
          const { mean, largest } = model.percentErrors(part(drawn, m), reference);
          means.push(mean);
          peaks.push(largest);
        });
      } };
  }
  function band(values) { // median, 5 % and 95 %
    const sorted = [...values].sort((a, b) => a - b);
    return [0.5, 0.05, 0.95].map((q) => {
      const at = q * (sorted.length - 1), low = Math.floor(at), next = sorted[low + 1] ?? sorted[low];
      return sorted[low] + (at - low) * (next - sorted[low]);
    });
  }

  return { MOST, band, radians, shiftsOf, simulate };
})();
