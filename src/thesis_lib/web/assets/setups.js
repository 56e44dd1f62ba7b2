// The settings of a request of chapter 3 or 4, as facts/setups.py makes them, and what is refused of them beside bounds,
// in the words of figure_sets/parametric. Values are as request.js reads them: whole numbers are BigInt, objects are Maps.
import pinhole from "./pinhole.js";
import request from "./request.js";
import simulation from "./simulation.js";

export default (() => {
  const { general, shown } = request;

  // --- settings, by what is varied; `facts` are the thesis's
  const pair = ({ azimuth_deg: azimuth, elevation_deg: elevation }) => [[azimuth, elevation], [-azimuth, elevation]];
  const sizeOf = (given) => given.map(Number);
  const KINDS = {
    distance: (v) => v.distances_mm.map((distance) => ({ case: "1", value: distance, label: `${general(distance)} mm`, distance,
      cameras: pair(v), size: sizeOf(v.resolution_px) })),
    aperture: (v, { centres, opposite }) => v.cases.flatMap((name) => {
      const opened = name in centres ? v.half_apertures_deg.map((half) =>
        [2 * half, [centres[name] + half, v.elevation_deg], [centres[name] - half, v.elevation_deg]])
        : v.elevations_deg.map((phi) => [180 - 2 * phi, ...opposite[name].map((azimuth) => [azimuth, phi])]);
      return opened.map(([alpha, ...cameras]) => ({ case: name, value: alpha, label: `${general(alpha)}°`,
        distance: v.distance_mm, cameras, size: sizeOf(v.resolution_px) }));
    }),
    resolution: (v) => sizeOf(v.widths_px).map((width) => {
      const size = [width, pinhole.rint((width * 9) / 16)];
      return { case: "3", value: width, label: size.join("×"), distance: v.distance_mm, cameras: pair(v), size };
    }),
    arrays: (v, { pairs, order }) => {
      const grown = v.cases.map((name) => {
        const way = v.pair_order.get(name) ?? order[name] ?? "printed";
        const ordered = way === "reversed" ? [...pairs[name]].reverse() : pairs[name];
        return [name, way, ordered.map((_, n) => ordered.slice(0, n + 1).flat())];
      });
      return [...grown, ...[...v.layouts].map(([name, sets]) => [name, "", sets])].flatMap(([name, way, sets]) =>
        sets.map((cameras) => ({ case: name, value: cameras.length, label: `${cameras.length} cameras`,
          distance: v.distance_mm, cameras, size: sizeOf(v.resolution_px), order: way })));
    },
  };
  const turned = (settings) => settings.map((one) =>
    ({ ...one, cameras: one.cameras.map(([azimuth, elevation]) => [90 - azimuth, elevation]) }));
  function peaksOf({ amplitude_mm: given, modes }, { peaks }) { // in m
    if (given === "force") return modes.map((mode) => Number(peaks[Number(mode) - 1]));
    return modes.map((_, i) => (Array.isArray(given) ? given[i] : given) / 1000);
  }

  // --- refusals
  const refused = (field, given, why) => `${field}: given ${shown(given)}, ${why}`;
  const toward = (direction) => pinhole.hemisphereDirection(...simulation.radians(direction));
  function coinciding({ cameras }) { // the first two cameras in one place
    const places = cameras.map(toward), far = (one, two) => Math.hypot(...one.map((c, k) => c - two[k]));
    for (let i = 0; i < places.length; i += 1) for (let j = i + 1; j < places.length; j += 1)
      if (far(places[i], places[j]) < 1e-6) return [cameras[i], cameras[j]];
    return null;
  }
  function problemOf(values, printed, peaks, { opposite, pairs, conditions }, { length, width }) {
    if (peaks.some(Number.isNaN) || (Array.isArray(values.amplitude_mm) && values.amplitude_mm.length !== peaks.length))
      return refused("amplitude_mm", values.amplitude_mm, conditions.amplitude_mm);
    const reach = 1000 * (Math.hypot(length, width) / 2 + Math.max(...peaks)), near = printed.find((one) => one.distance <= reach);
    if (near) return refused("distances_mm" in values ? "distances_mm" : "distance_mm", near.distance,
      conditions.reach.replace("{}", general(reach, 4)));
    for (const one of printed) {
      const same = coinciding(one);
      if (!same) continue;
      const field = values.layouts?.has(one.case) ? "layouts" : same[0][1] < 90 ? "azimuth_deg"
        : one.case in opposite ? "elevations_deg" : "elevation_deg";
      return refused(field, same, [shown(one.case), one.label].reduce((text, part) => text.replace("{}", () => part), conditions.places));
    }
    if (!values.layouts) return "";
    if (!values.cases.length && !values.layouts.size) return refused("cases", values.cases, conditions.cases);
    const grow = [...values.layouts.values()].every((sets) => sets.every((one, i) => !i || sets[i - 1].length < one.length));
    const own = [...values.layouts.keys()].every((name) => !Object.hasOwn(pairs, name));
    return grow && own ? "" : refused("layouts", values.layouts, conditions.layouts);
  }

  // What a page leaves to the command, or "".
  const MOST_IMAGES = 1e6;
  function beyond({ estimator, noise_px: noise, modes }, settings, markers) {
    if (estimator !== "least-squares") return `the estimator ${estimator}`;
    if (noise > 0) return "noise in the images";
    const cameras = Math.max(...settings.map((one) => one.cameras.length));
    if (cameras > simulation.MOST) return `${cameras} cameras (a page takes ${simulation.MOST})`;
    const images = settings.reduce((sum, one) => sum + one.cameras.length, 0) * (modes.length + 1) * markers;
    return images > MOST_IMAGES ? `${images} images of markers (a page takes ${MOST_IMAGES})` : "";
  }

  // A request by the names of its parameters: settings, modes with their peaks, the structure; or why there are none.
  function asked({ subject, study, others }, values, facts) {
    const unknown = Object.keys(others).find((name) => shown(values[name]) !== others[name]);
    if (unknown) return { left: `the parameter ${unknown}` };
    const given = facts.structures[subject], printed = KINDS[study](values, facts), peaks = peaksOf(values, given);
    const problem = problemOf(values, printed, peaks, facts, given);
    if (problem) return { problem };
    const structure = given.row ? { ...given, row: { ...given.row, first: values.first_marker_mm / 1000 } }
      : { ...given, grid: values.grid.map(Number) };
    const left = beyond(values, printed, given.row?.count ?? structure.grid[0] * structure.grid[1]);
    if (left) return { left };
    const focal = (width) => (values.focal_length_mm * width) / values.sensor_width_mm;
    const settings = (values.azimuth_zero === "X" ? turned(printed) : printed).map((one) => ({ ...one,
      focal: focal(one.size[0]), known: values.rest === "known", offset: values.principal_offset_px }));
    return { settings, structure, shapes: values.modes.map((mode, i) => ({ mode: Number(mode), peak: peaks[i] })) };
  }

  return { asked };
})();
