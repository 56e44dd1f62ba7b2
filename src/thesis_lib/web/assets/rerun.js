// The rerun form: a figure set or chapter, its parameters, the command that runs it with them, and for beam and plate the
// results, computed in the page. With one set alone it stands, made compact, above that set's viewer.
// Front end of thesis_lib.notebook.form in the form that static_html runs.
import { asked, keep } from "./address.js";
import { copyButton, linkButton } from "./copy.js";
import createField from "./fields.js";
import { html } from "./parts.js";
import createRecompute from "./recompute.js";
import request from "./request.js";
import viewer from "./viewer.js";

export default (() => {
  const { command, dumps, judge, papermill } = request;
  const FIRST = new Set(["cases", "distances_mm", "half_apertures_deg", "elevations_deg", "widths_px", "distance_mm", "azimuth_deg",
    "elevation_deg", "resolution_px", "focal_length_mm", "amplitude_mm"]); // what stands first in a compact form
  const ELSEWHERE = "The page draws its own pixel grids; estimators, noise, trials and seed are for the command.";

  return { render({ model, el }) {
    const { fields, sets, chapters, here, start = {} } = model.get("form"), onPage = Boolean(model.get("page"));
    const original = model.get("data"), only = Object.keys(sets).length === 1;
    const uid = `tl-rerun-${document.querySelectorAll(".tl-rerun").length}`, texts = new Map(); // what is typed, by field
    const begin = () => fields.forEach(({ name }, n) => { if (Object.hasOwn(start, name)) texts.set(n, start[name]); });
    const textOf = (n) => texts.get(n) ?? fields[n].typed;
    let rows = [], shownOf = "", shown = null;

    // --- elements
    const option = (name) => html("option", { value: name }, `${name}: ${sets[name].title}`);
    const inChapters = Object.values(chapters).flatMap((one) => one.sets);
    const chooser = html("select", {}, ...Object.entries(chapters).map(([name, { title, sets: members }]) =>
      html("optgroup", { label: title }, html("option", { value: name }, `${name}: all its figure sets`),
        ...members.map(option))), ...Object.keys(sets).filter((one) => !inChapters.includes(one)).map(option));
    const note = html("p", { class: "tl-rerun-note" }), form = html("div", { class: "tl-rerun-rows" });
    const more = html("div", { class: "tl-rerun-rows" });
    const status = html("p", { class: "tl-rerun-status", "aria-live": "polite" });
    const sentence = html("p", { class: "tl-rerun-sentence", "aria-live": "polite" });
    const code = html("code"), mill = html("code");
    const line = (label, node) => html("div", { class: "tl-rerun-command" }, html("pre", {}, node),
      copyButton("Copy", label, () => node.textContent, node));
    const output = html("div", { class: "tl-rerun-output" }, line("Copy the command", code),
      html("details", {}, html("summary", {}, "The same with papermill"), line("Copy papermill's command", mill)));
    const reset = html("button", { type: "button" }, "Reset"), link = linkButton(writeAddress);
    const head = html("div", { class: "tl-rerun-head" },
      html("label", {}, html("span", {}, "Figure set or chapter"), chooser), reset, ...link);
    const result = html("div", { class: "tl-rerun-result" }, status, sentence, output);
    const others = html("details", { class: "tl-rerun-more" }, html("summary", {}, "All parameters"), more,
      html("p", { class: "tl-rerun-note" }, ELSEWHERE));
    const root = html("section", { class: "tl-rerun", "aria-label": "A rerun with your parameters" },
      ...(only ? [html("h3", { class: "tl-rerun-title" }, "Change a parameter: the page computes it again"), form, others,
        result, html("div", { class: "tl-rerun-head" }, reset, ...link)] : [head, note, form, result]));
    root.classList.toggle("tl-rerun-compact", only);
    const figure = html("div", { class: "tl-rerun-figure" });
    const chosen = () => chapters[chooser.value] ?? { ...sets[chooser.value], sets: [chooser.value], differ: [] };

    // --- results in the page
    const recompute = createRecompute(here, show, () => model.get("case"), () =>
      tell("This browser lets no page compute beside itself; the command runs it."));
    function show(data) {
      shown = data;
      model.set("data", data);
      figure.hidden = !data;
      if (data && !figure.firstChild) viewer.render({ model, el: figure });
      const compared = recompute.comparison();
      if (compared) tell(`${changes()} ${compared}`);
    }
    function tell(words) { if (sentence.textContent !== words) sentence.textContent = words; }
    function changes() {
      const those = rows.filter((one) => one.other).map((one) => `${one.name} ${one.now()} in place of ${fields[one.n].typed}`);
      if (!those.length) return "With the published parameters";
      return `With ${those.length > 3 ? `${those.length} other parameters` : those.join(", ")}`;
    }
    function compute(judged) { // begins, if there is something to compute; says what is refused
      const name = chooser.value, values = Object.fromEntries(rows.map((one) => [one.name, judged.get(one.n).value]));
      const wish = here.sets[name] ? `${name}?${dumps(Object.values(values))}` : "";
      if (wish === shownOf) return recompute.refused ?? "";
      shownOf = wish;
      recompute.refused = "";
      figure.removeAttribute("data-stale");
      tell("");
      if (!wish || (original && rows.every((one) => one.now() === (start[one.name] ?? fields[one.n].typed)))) {
        recompute.stop();
        show(wish ? original : null);
        return "";
      }
      const { problem, left } = recompute.ask(name, values);
      if ((problem || left) && !shown) show(original);
      if (left) tell(`Not in the page: ${left}. The command runs it.`);
      figure.toggleAttribute("data-stale", Boolean(left));
      recompute.refused = problem ? `thesis: ${name}: ${problem}` : "";
      return recompute.refused;
    }

    // --- the form
    function build() {
      const run = chosen(), differ = run.differ.join(", ");
      note.textContent = [run.takes, differ && "Each set takes the parameters that it has. " +
        `The sets differ in ${differ}: choose one set to change these.`].filter(Boolean).join(" ");
      rows = run.shown.map((n) => {
        const holders = run.sets.filter((one) => sets[one].shown.includes(n));
        const hint = holders.length < run.sets.length ? `Only in ${holders.join(", ")}.` : "";
        const row = createField(fields[n], `${uid}-${fields[n].name}`, textOf(n), hint, (text) => {
          texts.set(n, text);
          update();
        });
        return Object.assign(row, { n });
      });
      const first = ({ name }) => !only || FIRST.has(name), bodies = (those) => those.map(({ body }) => body);
      form.replaceChildren(...bodies(rows.filter(first)));
      more.replaceChildren(...bodies(rows.filter((row) => !first(row))));
      update();
      others.open = rows.some((row) => row.other && !first(row));
    }
    function update() { // all rows, the line that the command would print, or the commands
      const judged = new Map(rows.map(({ n, now }) => [n, judge(fields[n], now())])), run = chosen(), given = new Map();
      for (const row of rows) {
        const found = judged.get(row.n);
        row.other = row.judge(found);
        if (row.other && !found.problem && found.value !== row.usual) given.set(row.n, [row.name, found.value]); // −0 is 0
      }
      const faults = run.sets.flatMap((one) => sets[one].checked.filter((n) => judged.get(n)?.problem)
        .map((n) => `thesis: ${one}: ${judged.get(n).problem}`));
      if (faults.length) shownOf = "";
      const refused = faults[0] || compute(judged);
      output.hidden = Boolean(refused);
      if (refused) figure.setAttribute("data-stale", "");
      sentence.hidden = output.hidden;
      root.toggleAttribute("data-refused", output.hidden);
      status.textContent = refused || (given.size === 0 ? "As published, no parameter changed:"
        : `${given.size} ${given.size === 1 ? "parameter differs" : "parameters differ"} from the default:`);
      if (refused) return;
      const order = sets[chooser.value]?.checked ?? run.shown;
      code.textContent = command(chooser.value, order.filter((n) => given.has(n)).map((n) => given.get(n)));
      mill.textContent = run.sets.map((one) => papermill(one,
        sets[one].checked.filter((n) => given.has(n)).map((n) => given.get(n)))).join("\n");
    }

    // --- the address: ?set=beam-distance&azimuth_deg=45
    function readAddress() {
      const name = asked("set") ?? "";
      if (Object.hasOwn(sets, name) || Object.hasOwn(chapters, name)) chooser.value = name;
      for (const n of chosen().shown) {
        const text = asked(fields[n].name);
        if (text !== null && !(only && judge(fields[n], text).problem)) texts.set(n, text);
      }
    }
    function writeAddress() {
      if (!onPage) return;
      const said = new URLSearchParams(only ? {} : { set: chooser.value });
      for (const { name, now, other } of rows)
        if (Object.hasOwn(start, name) ? now() !== start[name] : other) said.set(name, now());
      keep(["set", ...fields.map(({ name }) => name)], said);
    }

    const every = Object.keys(sets);
    chooser.value = every.find((one) => Object.hasOwn(here.sets, one)) ?? every[0]; // one that the page computes
    begin();
    if (onPage) readAddress();
    chooser.addEventListener("change", build);
    root.addEventListener("change", writeAddress);
    reset.addEventListener("click", () => {
      texts.clear();
      begin();
      build();
      writeAddress();
    });
    model.on("change:case", recompute.prefer);
    root.recompute = { model, times: recompute.times }; // for tests
    el.replaceChildren(root, figure);
    build();
  } };
})();
