// The rerun form: a figure set or chapter, its parameters, the command that runs it with them, and
// for beam and plate the results, computed in the page; above the viewer of one set it is folded.
import { asked, button, copyButton, html, keep, options } from "./parts.js";
import { createRecompute } from "./recompute.js";
import { dumps, formatCommand, judge, parseTyped } from "./request.js";
import viewer from "./viewer.js";

// --- controls of parameters: typed text, allowed values, fault
const choicesOf = ({ items = {} }) => // of a list
  items.enum ?? items.anyOf?.flatMap((part) => part.enum) ?? [];

function createControl(field, text, id, attributes) {
  const { schema, typed } = field, choices = choicesOf(schema);
  if (choices.length) {
    const held = [parseTyped(field, text)].flat().map(String);
    const boxes = choices.map((one) => html("input", { type: "checkbox",
      value: JSON.stringify(one), checked: held.includes(String(one)) ? "" : null }));
    const node = html("div", { ...attributes, role: "group", "aria-labelledby": `${id}-label`,
      class: "tl-rerun-boxes" }, ...boxes.map((box, i) => html("label", {}, box, `${choices[i]}`)));
    return [node, () => boxes.filter((box) => box.checked).map((box) => box.value).join(", ")];
  }
  const long = schema.type === "object" || typed.length > 60;
  const isNumeric = ["number", "integer"].includes(schema.type);
  const node = schema.enum
    ? html("select", attributes, ...schema.enum.map((one) => html("option", {}, one)))
    : html(long ? "textarea" : "input", { ...attributes, ...(long ? { rows: 3 } : { type: "text" }),
      inputmode: isNumeric ? "decimal" : null, spellcheck: "false", autocomplete: "off",
      autocapitalize: "off" });
  node.value = text;
  if (node.value === "") node.value = typed; // not one of the choices
  return [node, () => node.value];
}

// One parameter: `text` is the initial text, `more` a further hint; `changed` is called with input.
function createField(field, id, text, more, changed) {
  const { name, meaning, unit, allowed, typed, schema } = field;
  const described = { id, "aria-describedby": `${id}-hint ${id}-problem` };
  const [node, now] = createControl(field, text, id, described), isGroup = node.matches("div");
  const usual = parseTyped(field, typed);
  const all = isGroup && usual.length === choicesOf(schema).length;
  const hint = `Allowed: ${allowed}. Default: ${all ? "all" : typed}. ${more}`.trimEnd();
  const problem = html("p", { id: `${id}-problem`, class: "tl-rerun-problem" });
  const body = html("div", { class: "tl-rerun-row", "data-parameter": name },
    html(isGroup ? "div" : "label", { id: `${id}-label`, for: isGroup ? null : id,
      class: "tl-rerun-label" }, html("code", {}, name), " ", html("span", {}, meaning)),
    html("div", { class: "tl-rerun-value" }, node, unit ? html("span", {}, unit) : ""),
    html("p", { id: `${id}-hint`, class: "tl-rerun-hint" }, hint), problem);
  body.addEventListener("input", () => changed(now()));
  return { name, body, now,
    report(found) { // shows a fault, and whether the value differs from the default
      const other = Boolean(found.problem) || dumps(found.value) !== dumps(usual);
      problem.textContent = found.problem ?? "";
      body.toggleAttribute("data-changed", other);
      if (!isGroup) node.setAttribute("aria-invalid", Boolean(found.problem));
      return other;
    } };
}

// --- the form
const ELSEWHERE =
  "The page draws its own pixel grids; estimators, noise, trials and seed are for the command.";

function renderForm({ model, el }) {
  const { fields, sets, chapters, here, start = {} } = model.get("form");
  const original = model.get("data"), every = Object.keys(sets), compact = every.length === 1;
  const uid = `tl-rerun-${document.querySelectorAll(".tl-rerun").length}`;
  const begin = () => new Map( // typed text, by index of the field
    fields.map(({ name }, n) => [n, start[name]]).filter(([, text]) => text !== undefined));
  let texts = begin(), rows = [], shownOf = "";

  // --- elements
  const pairsOf = (names) => options(names.map((name) => [name, `${name}: ${sets[name].title}`]));
  const inChapters = Object.values(chapters).flatMap((one) => one.sets);
  const chooser = html("select", {},
    ...Object.entries(chapters).map(([name, one]) => html("optgroup", { label: one.title },
      ...options([[name, `${name}: all its figure sets`]]), ...pairsOf(one.sets))),
    ...pairsOf(every.filter((name) => !inChapters.includes(name))));
  const note = html("p", { class: "tl-rerun-note" });
  const form = html("div", {});
  const status = html("p", { class: "tl-rerun-status", "aria-live": "polite" });
  const sentence = html("p", { class: "tl-rerun-sentence", "aria-live": "polite" });
  const figure = html("div", { class: "tl-rerun-figure", hidden: "" });
  const see = button("See the result", { class: "tl-rerun-see", hidden: "" },
    () => figure.scrollIntoView());
  const code = html("code");
  const output = html("div", { class: "tl-rerun-output" }, html("pre", {}, code),
    copyButton("Copy", "Copy the command", () => code.textContent, code));
  const result = html("div", { class: "tl-rerun-result" }, status, sentence, see, output);
  const head = html("div", { class: "tl-rerun-head" },
    compact ? "" : html("label", {}, html("span", {}, "Figure set or chapter"), chooser),
    button("Reset", {}, reset));
  const words = "Change a parameter: the page computes it again";
  const parts = compact // above the viewer it is folded
    ? html("details", {}, html("summary", {}, words), form,
      html("p", { class: "tl-rerun-note" }, ELSEWHERE), result, head)
    : [head, note, form, result];
  const names = { class: "tl-rerun", "aria-label": "A rerun with your parameters" };
  const root = html("section", names, parts);
  const chosen = () => chapters[chooser.value] ??
    { ...sets[chooser.value], sets: [chooser.value], differ: [] };

  // --- results in the page
  const recompute = createRecompute(here, put, () => model.get("case"));
  function put(data) {
    model.set("data", data);
    figure.hidden = see.hidden = !data;
    if (data && !figure.firstChild) viewer.render({ model, el: figure });
    const compared = recompute.comparison();
    const which = rows.some((one) => one.other) ? "these" : "the published";
    if (compared) tell(`With ${which} parameters ${compared}`);
  }
  function tell(words) { if (sentence.textContent !== words) sentence.textContent = words; }
  function compute(judged) { // starts if there is something to compute; returns a refusal
    const name = chooser.value, values = {};
    for (const { name: field, n } of rows) values[field] = judged.get(n).value;
    const wish = here.sets[name] ? `${name}?${dumps(Object.values(values))}` : "";
    if (wish === shownOf) return recompute.refused ?? "";
    shownOf = wish;
    recompute.refused = "";
    figure.removeAttribute("data-stale");
    tell("");
    const asBefore = original &&
      rows.every((one) => one.now() === (start[one.name] ?? fields[one.n].typed));
    if (!wish || asBefore) {
      recompute.stop();
      put(wish ? original : null);
      return "";
    }
    const { problem, left } = recompute.ask(name, values);
    if ((problem || left) && figure.hidden) put(original);
    if (left) tell(`Not in the page: ${left}. The command runs it.`);
    figure.toggleAttribute("data-stale", Boolean(left));
    recompute.refused = problem ? `thesis: ${name}: ${problem}` : "";
    return recompute.refused;
  }

  // --- the form
  function describe(run) { // the command's action
    if (!chapters[chooser.value]) return run.takes;
    const names = run.differ.join(", "), computed = run.sets.some((one) => here.sets[one]);
    return `The command below runs all ${run.sets.length} figure sets of the chapter, ` +
      `each with those of the parameters that it has. ${run.takes}` +
      (names && ` The sets differ in ${names}: choose one set to change these.`) +
      (computed ? " The page computes one set at a time." : "");
  }
  function build() {
    const run = chosen();
    note.textContent = describe(run);
    rows = run.shown.map((n) => {
      const holders = run.sets.filter((one) => sets[one].shown.includes(n));
      const hint = holders.length < run.sets.length ? `Only in ${holders.join(", ")}.` : "";
      const row = createField(fields[n], `${uid}-${fields[n].name}`,
        texts.get(n) ?? fields[n].typed, hint, (text) => {
          texts.set(n, text);
          update();
        });
      return { ...row, n };
    });
    form.replaceChildren(...rows.map(({ body }) => body));
    update();
    if (compact) parts.open ||= rows.some((row) => row.other);
  }
  function update() { // all rows, the command's error message, or the commands
    const judged = new Map(rows.map(({ n, now }) => [n, judge(fields[n], now())]));
    const run = chosen(), given = new Map();
    for (const row of rows) {
      const { problem, value } = judged.get(row.n);
      row.other = row.report(judged.get(row.n));
      if (row.other && !problem) given.set(row.n, [row.name, value]);
    }
    const faults = run.sets.flatMap((one) => sets[one].checked.filter((n) => judged.get(n)?.problem)
      .map((n) => `thesis: ${one}: ${judged.get(n).problem}`));
    if (faults.length) shownOf = null; // so the next result differs from it, also ""
    const refused = faults[0] || compute(judged), { size } = given;
    output.hidden = sentence.hidden = Boolean(refused);
    if (refused) figure.setAttribute("data-stale", "");
    status.textContent = refused || (size === 0 ? "As published, no parameter changed:"
      : `${size} parameter${size === 1 ? " differs" : "s differ"} from the default:`);
    if (refused) return;
    const order = sets[chooser.value]?.checked ?? run.shown;
    code.textContent = formatCommand(chooser.value,
      order.filter((n) => given.has(n)).map((n) => given.get(n)));
  }

  // --- the URL: ?set=beam-distance&azimuth_deg=45
  function readAddress() {
    const name = asked("set") ?? "";
    if (Object.hasOwn(sets, name) || Object.hasOwn(chapters, name)) chooser.value = name;
    for (const n of chosen().shown) {
      const text = asked(fields[n].name);
      if (text !== null && !(compact && judge(fields[n], text).problem)) texts.set(n, text);
    }
  }
  function writeAddress() {
    const values = Object.fromEntries(fields.map(({ name }) => [name, null]));
    for (const { name, now, other } of rows)
      if (Object.hasOwn(start, name) ? now() !== start[name] : other) values[name] = now();
    keep({ set: compact ? null : chooser.value, ...values });
  }
  function reset() {
    texts = begin();
    build();
    writeAddress();
  }

  chooser.value = every.find((one) => Object.hasOwn(here.sets, one)) ?? every[0];
  readAddress();
  chooser.addEventListener("change", build);
  root.addEventListener("change", writeAddress);
  root.recompute = { model, data: recompute.data }; // for tests
  el.replaceChildren(root, figure);
  build();
}

export default { render: renderForm };
