// Panel (d): the mean error of each setting as a bar, or as one bar per plane of the sound.
import { MARGIN, axes, spread } from "./chart.js";
import { ARROWS, entitle, html, icon, isNumber, mark, path, show, svg, text } from "./parts.js";

export function createBars(panel, study, uid, highlight, remember) { // returns the drawing function
  const hatched = (box) => svg("rect", { ...box, fill: `url(#${uid}-hatch)` });

  function draw() {
    const { data } = study, width = study.ofBars, settings = study.settings();
    const title = `Mean error of each setting${data.planes ? " on both planes" : ""}`;
    const help = "Arrow keys move, Enter pins, Escape releases.";
    entitle(panel, study, "group", title, "", help);
    const { label, unit } = data.parameter;
    const every = settings.map((_, i) => study.errors(i)), count = every[0].length;
    const errors = every.flat(), [least, most] = spread(errors.map((r) => [r.mean, r.low, r.high,
      r.median, r.predicted, ...(r.stated ?? []).filter(Boolean), r.published?.high]));
    const had = panel.canvas.contains(document.activeElement) ? study.focused : null;
    const slotWidth = (width - MARGIN.left - MARGIN.right) / every.length;
    const staggered = settings.some((one) => one.label.length * 7.5 + 2 > slotWidth);
    const { x, y, bottom } = axes(panel, width, [0, every.length], [least, most],
      unit ? `${label} (${unit})` : label,
      `error (% of the largest ${data.planes ? "pressure" : "deflection"})`,
      { columns: 0, room: staggered ? 15 : 0 });
    const tile = { width: 6, height: 6, patternUnits: "userSpaceOnUse" };
    panel.canvas.append(svg("pattern", { id: `${uid}-hatch`, ...tile,
      patternTransform: "rotate(45)" }, path("tl-hatch", "M0 0V6")));
    const gap = Math.max(10, Math.min(22, slotWidth * 0.18)); // between the bars of a setting
    const wide = count > 1 ? Math.min(34, slotWidth / 2 - gap) : Math.min(44, slotWidth * 0.46);
    const stub = count > 1 ? gap / 2 + 4 : Math.min(14, slotWidth / 4);
    const middleOf = (i, n) => x(i + 0.5) + (n - (count - 1) / 2) * (wide + gap);

    function column(setting, i, r, n) { // one bar with its band, median, prediction and claim
      const middle = middleOf(i, n), left = middle - wide / 2, was = r.published;
      if (!isNumber(r.mean) && r.name) return svg("g", { class: "tl-nodal" },
        svg("title", {}, `${r.name}: ${data.nodal_note}`),
        path("tl-band", `M${middle - 5} ${y(0) - 6}h10`));
      const box = { x: left, y: y(r.mean ?? 0), width: wide, height: y(0) - y(r.mean ?? 0) };
      const at = left - 7, high = was && y(was.low) - y(was.high); // of an outline next to it
      const part = (values, cls, outline) =>
        values.every(isNumber) && path(cls, outline(...values.map(y)));
      return [
        was && path("tl-published", `M${at} ${y(0)}V${y(was.mean)}h${wide + 14}V${y(0)}Z` +
          `M${at} ${y(was.low)}v${-high}m-3 0h6m-6 ${high}h6${mark(0, at, y(was.median), 3)}`),
        svg("rect", { class: `tl-box${n ? " tl-second" : ""}`, ...box }),
        setting.in_view < 1 && hatched(box),
        part([r.low, r.high], "tl-band",
          (low, up) => `M${middle} ${low}V${up}m-4 0h8M${middle - 4} ${low}h8`),
        part([r.median], "tl-median", (v) => mark(0, middle, v, 3)),
        part([r.predicted], "tl-predicted", (v) => `M${left + wide - 5} ${v}h${stub}`),
        r.stated && part([r.stated[0] ?? 0, r.stated[1] ?? most], "tl-stated", (low, up) =>
          (low === up ? mark(3, left - 5, low, 4) : `M${left - 1} ${low}h-4V${up}h4`)),
      ];
    }
    // Numbers are right above their bars, in smaller type the closer these are.
    const longest = Math.max(...errors.map((r) => show(r.mean).length));
    const near = count > 1 ? wide + gap : slotWidth, free = slotWidth - (count - 1) * near;
    const size = Math.min(12, Math.min(near, free) / (0.62 * longest));
    const number = (r, middle) => text(middle,
      y(Math.max(...[0, r.mean, r.high, r.stated?.[1]].filter(isNumber))) - 6, show(r.mean));
    // Next to the buttons, not in them: a button's name begins with its own text, the setting.
    const values = settings.map((_, i) => svg("g", { class: `tl-value${size < 12 ? " tl-tight" : ""}`,
      style: `font-size: ${size}px`, "data-setting": i, "aria-hidden": "true" },
    every[i].map((r, n) => (isNumber(r.mean) || !r.name) && number(r, middleOf(i, n)))));
    const bars = settings.map((setting, i) => {
      const drop = staggered && i % 2 ? 15 : 0, height = bottom - MARGIN.top + 36 + drop;
      const area = { x: x(i) + 2, y: MARGIN.top - 12, width: slotWidth - 4, height, rx: 4 };
      const bar = svg("g", { class: "tl-bar", role: "button", "data-setting": i,
        "aria-label": study.describe(i), style: study.tint(i) },
      svg("rect", { class: "tl-hit", ...area }),
      every[i].map((r, n) => column(setting, i, r, n)),
      text(x(i + 0.5), bottom + 17 + drop, setting.label));
      return listen(bar, i, () => bars);
    });
    panel.canvas.append(...bars, ...values);
    if (had !== null) bars[had]?.focus();
    drawKey(settings, errors);
  }

  function listen(bar, i, bars) {
    const on = (name, handler) => bar.addEventListener(name, (event) => { handler(event); highlight(); });
    on("pointerenter", (event) => { if (event.pointerType === "mouse") study.hovered = i; });
    on("pointerleave", () => { study.hovered = null; });
    on("focus", () => { study.focused = bar.matches(":focus-visible") ? i : null; });
    on("blur", () => { study.focused = null; });
    on("click", () => { study.pinned = study.pinned === i ? null : i; remember(); });
    on("keydown", (event) => {
      const [right, up] = ARROWS[event.key] ?? [];
      const next = { Home: 0, End: -1 }[event.key] ?? i + right - up;
      if (isNumber(next)) bars().at(next % bars().length).focus();
      else if (event.key === "Enter" || event.key === " ") bar.dispatchEvent(new Event("click"));
      else if (event.key === "Escape") study.pinned = null;
      else return;
      event.preventDefault();
    });
    return bar;
  }

  function drawKey(settings, errors) {
    const box = { x: 4, y: 2, width: 10, height: 10 };
    const grey = (cls = "") => svg("rect", { class: `tl-box${cls}`, ...box });
    const { planes, nodal_note: note, words: { draws, predicts } } = study.data;
    const bars = planes?.map(({ name }, n) => [`${name}: mean (rms)`, grey(n ? " tl-second" : "")]);
    const stated = path("tl-stated", mark(3, 5, 7, 4) + "M17 2h-4V12h4");
    const entries = [
      ...(bars ?? [["mean (rms)", grey()]]),
      [`5–95 % over ${draws}`, path("tl-band", "M9 1V13M5 1h8M5 13h8")],
      ["their median", path("tl-median", mark(0, 9, 7, 3))],
      [predicts, path("tl-predicted", "M2 7h14")],
      errors.some((r) => r.published) && ["as published", path("tl-published", "M2 13V4h14V13Z")],
      errors.some((r) => r.stated) && ["claimed in the thesis", stated],
      errors.some((r) => r.name && !isNumber(r.mean)) && [note, path("tl-band", "M4 7h10")],
      settings.some((one) => one.in_view < 1) && ["markers leave the image", grey(), hatched(box)],
    ];
    panel.foot.replaceChildren(...entries.filter(Boolean).map(([words, ...parts]) =>
      html("span", {}, icon(18, ...parts), words)));
  }

  return { draw };
}
