// The settings of a request of chapter 3 or 4, as facts/setups.py makes them, and what is refused
// of them beside bounds, in the words of figure_sets/parametric. Values are as request.js reads them:
// whole numbers are BigInt, objects are Maps.
import { rint } from "./pinhole.js";
import { MOST_CAMERAS, towards } from "./physics.js";
import { formatGeneral, formatGiven } from "./request.js";

const MOST_IMAGES = 1e6; // of markers, in a page

// --- settings, by what is varied; `facts` are the thesis's
const pairOf = ({ azimuth_deg: azimuth, elevation_deg: elevation }) =>
  [[azimuth, elevation], [-azimuth, elevation]];
const SETTINGS = {
  distance: (v) => v.distances_mm.map((distance) => ({
    case: "1", value: distance, label: `${formatGeneral(distance)} mm`, distance,
    cameras: pairOf(v),
  })),
  aperture: (v, { centres, opposite }) => v.cases.flatMap((name) => {
    const opened = name in centres
      ? v.half_apertures_deg.map((half) => [2 * half, [centres[name] + half, v.elevation_deg],
        [centres[name] - half, v.elevation_deg]])
      : v.elevations_deg.map((elevation) => [180 - 2 * elevation,
        ...opposite[name].map((azimuth) => [azimuth, elevation])]);
    return opened.map(([alpha, ...cameras]) =>
      ({ case: name, value: alpha, label: `${formatGeneral(alpha)}°`, cameras }));
  }),
  resolution: (v) => v.widths_px.map(Number).map((width) => {
    const size = [width, rint((width * 9) / 16)];
    return { case: "3", value: width, label: size.join("×"), cameras: pairOf(v), size };
  }),
  arrays: (v, { pairs, order: usual }) => {
    const grown = v.cases.map((name) => {
      const order = v.pair_order.get(name) ?? usual[name] ?? "printed";
      const ordered = order === "reversed" ? pairs[name].toReversed() : pairs[name];
      return [name, order, ordered.map((_, n) => ordered.slice(0, n + 1).flat())];
    });
    const own = [...v.layouts].map(([name, sets]) => [name, "", sets]);
    return [...grown, ...own].flatMap(([name, order, sets]) => sets.map((cameras) => ({
      case: name, value: cameras.length, label: `${cameras.length} cameras`, cameras, order,
    })));
  },
};
function peaksOf({ amplitude_mm: given, modes }, { peaks }) { // in m
  if (given === "force") return modes.map((mode) => Number(peaks[Number(mode) - 1]));
  return modes.map((_, i) => (Array.isArray(given) ? given[i] : given) / 1000);
}

// --- refusals
function findCoincident({ cameras }) { // the first two cameras in one place
  const places = cameras.map(towards);
  const near = (one, two) => Math.hypot(...one.map((c, k) => c - two[k])) < 1e-6;
  for (const [i, one] of places.entries()) {
    const j = places.findIndex((two, k) => k > i && near(one, two));
    if (j > 0) return [cameras[i], cameras[j]];
  }
  return null;
}
function findProblem(values, settings, peaks, facts, { length, width }) {
  const { opposite, pairs, conditions } = facts;
  const { layouts, cases, amplitude_mm: amplitude } = values;
  const refuse = (field, given, why) => `${field}: given ${formatGiven(given)}, ${why}`;
  const uneven = Array.isArray(amplitude) && amplitude.length !== peaks.length;
  if (uneven || peaks.some(Number.isNaN))
    return refuse("amplitude_mm", amplitude, conditions.amplitude_mm);
  const reach = 1000 * (Math.hypot(length, width) / 2 + Math.max(...peaks));
  const near = settings.find((one) => one.distance <= reach);
  if (near) return refuse("distances_mm" in values ? "distances_mm" : "distance_mm", near.distance,
    conditions.reach.replace("{}", formatGeneral(reach, 4)));
  for (const one of settings) {
    const same = findCoincident(one);
    if (!same) continue;
    const field = layouts?.has(one.case) ? "layouts" : same[0][1] < 90 ? "azimuth_deg"
      : one.case in opposite ? "elevations_deg" : "elevation_deg";
    const place = [formatGiven(one.case), one.label];
    return refuse(field, same,
      place.reduce((text, part) => text.replace("{}", () => part), conditions.places));
  }
  if (!layouts) return "";
  if (!cases.length && !layouts.size) return refuse("cases", cases, conditions.cases);
  const grow = [...layouts.values()]
    .every((sets) => sets.every((one, i) => !i || sets[i - 1].length < one.length));
  const own = [...layouts.keys()].every((name) => !Object.hasOwn(pairs, name));
  return grow && own ? "" : refuse("layouts", layouts, conditions.layouts);
}
function findLimit({ estimator, noise_px: noise, modes }, settings, markers) { // of a page, or ""
  if (estimator !== "least-squares") return `the estimator ${estimator}`;
  if (noise > 0) return "noise in the images";
  const counts = settings.map((one) => one.cameras.length), most = Math.max(...counts);
  if (most > MOST_CAMERAS) return `${most} cameras (a page takes ${MOST_CAMERAS})`;
  const images = counts.reduce((sum, count) => sum + count, 0) * (modes.length + 1) * markers;
  return images > MOST_IMAGES ? `${images} images of markers (a page takes ${MOST_IMAGES})` : "";
}

// A request by the names of its parameters: settings, modes with their peaks, the structure; or why
// there are none: a `problem`, or what is `left` to the command.
export function planRequest({ subject, study, others }, values, facts) {
  const unknown = Object.keys(others).find((name) => formatGiven(values[name]) !== others[name]);
  if (unknown) return { left: `the parameter ${unknown}` };
  const given = facts.structures[subject], peaks = peaksOf(values, given);
  const common = { distance: values.distance_mm, size: values.resolution_px?.map(Number) };
  const settings = SETTINGS[study](values, facts).map((one) => ({ ...common, ...one }));
  const problem = findProblem(values, settings, peaks, facts, given);
  if (problem) return { problem };
  const structure = given.row
    ? { ...given, row: { ...given.row, first: values.first_marker_mm / 1000 } }
    : { ...given, grid: values.grid.map(Number) };
  const [nx, ny] = structure.grid ?? [given.row.count, 1];
  const left = findLimit(values, settings, nx * ny);
  if (left) return { left };
  const turn = ([azimuth, elevation]) => [90 - azimuth, elevation];
  return {
    settings: settings.map((one) => ({ ...one,
      cameras: values.azimuth_zero === "X" ? one.cameras.map(turn) : one.cameras,
      focal: (values.focal_length_mm * one.size[0]) / values.sensor_width_mm,
      known: values.rest === "known", offset: values.principal_offset_px })),
    structure, shapes: values.modes.map((mode, i) => ({ mode: Number(mode), peak: peaks[i] })),
  };
}
