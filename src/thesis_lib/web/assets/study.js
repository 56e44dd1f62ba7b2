// What one viewer shows: the chosen case and mode, the highlighted setting, and the words for them.
import { fixed, isNumber, range, show } from "./parts.js";

export function createStudy(model) {
  const study = {
    data: model.get("data"), compare: "extremes", hovered: null, focused: null, pinned: null,
    width: 480, full: 480, ofBars: 480, wide: false, // of one column, of the whole viewer and of panel (d), in px

    case: () => study.data.cases.find((one) => one.name === model.get("case")) ?? study.data.cases[0],
    modeIndex: () => Math.max(0, study.data.modes.findIndex((one) => one.mode === model.get("mode"))),
    mode: () => study.data.modes[study.modeIndex()],
    settings: () => study.case().settings,
    results: () => study.settings().map((one) => one.modes[study.modeIndex()]),
    tint: (i) => `--c:${study.data.colors[i % study.data.colors.length]}`,
    active: () => study.hovered ?? study.focused ?? study.pinned,

    // The errors of a setting: one, or one per plane of the sound; without a mean where the plane is nodal.
    errors(i) {
      const result = study.results()[i];
      return study.data.planes?.map(({ name }) => ({ name, ...result.planes[name] })) ?? [result];
    },
    // What settings are ranked by: the median over the trials, or the one run there is.
    typical: (result) => result?.median ?? result?.mean,
    extremes() { // the best and the worst setting
      const stored = study.case().extremes?.[study.mode().mode];
      if (stored) return [stored.best.index, stored.worst.index];
      const errors = study.results().map((r) => study.typical(r) ?? r.deflection?.mean);
      const known = errors.filter(isNumber);
      return [errors.indexOf(Math.min(...known)), errors.indexOf(Math.max(...known))];
    },
    extremeWord(i) {
      const [best, worst] = study.extremes();
      return best === worst ? "" : i === best ? "best" : i === worst ? "worst" : "";
    },
    stateOf(i) { // "on": in full colour, "dim": in the background, "off": not drawn
      const chosen = study.compare === "all" || study.extremes().includes(i);
      return i === study.active() || (study.active() === null && chosen) ? "on" : chosen ? "dim" : "off";
    },

    nameOf(i) {
      const { label } = study.settings()[i];
      return (/^[\d.]+$/.test(label) ? `${study.data.parameter.label} = ` : "") + label;
    },
    inView: ({ in_view: share }) => (!isNumber(share) ? null : share >= 1 ? "all markers in view"
      : `${fixed(Math.floor(share * 1000) / 10, 1)} % of marker images on the sensor`),
    describe(i) {
      const parts = study.errors(i).flatMap((error) => {
        if (error.name && !isNumber(error.mean)) return [`${error.name}: ${study.data.nodal_note}`];
        return [`${error.name ? `${error.name}: ` : ""}mean error ${show(error.mean)} % ` +
            `(5–95 % band ${range(error.low, error.high)})`,
          isNumber(error.predicted) ? `predicted ${show(error.predicted)} %` : null,
          error.stated ? `stated in the thesis ${range(...error.stated)}` : null];
      });
      const { deflection } = study.results()[i];
      if (deflection) parts.push(`deflection: mean error ${show(deflection.mean)} %`);
      parts.push(study.inView(study.settings()[i]));
      return `${study.nameOf(i)}: ${parts.filter(Boolean).join(", ")}`;
    },
    summarise() {
      const place = `Mode ${study.mode().mode}, case ${study.case().name}`, [best, worst] = study.extremes();
      const active = study.active(), every = study.settings();
      const pin = active !== null && active === study.pinned ? "Pinned: " : "";
      if (active !== null) return `${pin}${place}, ${study.describe(active)}.`;
      if (best < 0) return `${place}: no errors known.`;
      const what = study.results()[best].deflection ? " shape" : "";
      const name = (i) => `${study.extremeWord(i) || "only"}${what}, ${study.nameOf(i)}`;
      const error = (one, i) => `${show(study.typical(one))} % (${name(i)})`, high = study.errors(worst);
      const drawn = study.errors(best).some((one) => isNumber(one.median));
      const parts = study.errors(best).map((low, n) => {
        if (low.name && !isNumber(low.mean)) return `${low.name}: ${study.data.nodal_note}`;
        return `${low.name ? `${low.name} ` : ""}${what ? "" : "from "}${error(low, best)}${what ? ", " : " to "}` +
          error(high[n], worst);
      });
      const cut = every.filter((one) => one.in_view < 1).length;
      return `${place}: mean error ${parts.join("; ")}${drawn ? ", by the median over the trials" : ""}. ` +
        (cut ? `Markers leave the image in ${cut} of ${every.length} settings.` : "All markers in view.");
    },
  };
  return study;
}
