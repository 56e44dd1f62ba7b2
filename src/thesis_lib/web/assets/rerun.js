// The rerun form: a figure set or chapter, its parameters, and the command that runs it with them.
// Front end of thesis_lib.book.rerun_form; one expression, so that its names stay apart from those of other widgets.
export default (() => {
  // --- Python's JSON. What is typed means what it means after `-p name=`: JSON, or else text. Numbers with a point are
  // Number and others BigInt, for a whole number is asked for as such; objects are Maps, which keep the order of names.
  const TOKEN = /"(?:[^"\\]|\\.)*"(\s*:)?|-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?|NaN|-?Infinity/g;
  const mark = (token, colon) => (token[0] !== '"' ? `{"":"${token}"}` : colon ? `"~${token.slice(1)}` : token);
  function unmark(_, value) { // every name begins with ~, except the empty one of a number
    if (typeof value !== "object" || value === null || Array.isArray(value) || value instanceof Map) return value;
    if (!("" in value)) return new Map(Object.entries(value).map(([name, one]) => [name.slice(1), one]));
    return /[.eEN]|I/.test(value[""]) ? Number(value[""]) : BigInt(value[""]);
  }
  function parse(text) { // undefined where it is no JSON
    try { return JSON.parse(text.replace(TOKEN, mark), unmark); } catch { return undefined; }
  }
  function float(value) { // as Python writes it
    const [digits, power] = value.toExponential().split("e");
    if (power < -4 || power >= 16) return `${digits}e${power.replace(/^(.)(\d)$/, "$10$2")}`;
    const text = Object.is(value, -0) ? "-0" : String(value);
    return Number.isInteger(value) ? `${text}.0` : text;
  }
  const escape = (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`;
  const ascii = (text) => text.replace(/[^ -~]/g, escape);
  function dumps(value, protect = ascii, number = float) {
    const inner = (one) => dumps(one, protect, number);
    if (typeof value === "string") return protect(JSON.stringify(value));
    if (typeof value === "number") return number(value);
    if (Array.isArray(value)) return `[${value.map(inner).join(", ")}]`;
    if (value instanceof Map) return `{${[...value].map((pair) => pair.map(inner).join(": ")).join(", ")}}`;
    return String(value);
  }
  const UNPRINTABLE = /(?! )[\p{C}\p{Z}]/gu;
  function unprintable(sign) { // what Python's unicode_escape makes of it
    const code = sign.codePointAt(0), [letter, length] = code > 0xffff ? ["U", 8] : code > 0xff ? ["u", 4] : ["x", 2];
    return `\\${letter}${code.toString(16).padStart(length, "0")}`;
  }
  const asIs = (text) => text.replace(UNPRINTABLE, unprintable);
  function shown(value) { // on one line, at most 60 signs
    const signs = [...asIs(dumps(value, (text) => text))];
    return signs.length > 60 ? `${signs.slice(0, 57).join("")}...` : signs.join("");
  }

  // --- checking, by the JSON schema of the parameter's model; what is refused first is what pydantic names first
  const TYPES = {
    integer: (value) => typeof value === "bigint",
    number: (value) => typeof value === "bigint" || Number.isFinite(value),
    string: (value) => typeof value === "string", array: Array.isArray, object: (value) => value instanceof Map,
  };
  function read(schema, value, place) { // the value as the model holds it
    const need = (good, at = place, given = value) => { if (!good) throw { at, given }; };
    for (const one of schema.anyOf ?? []) {
      try { return read(one, value, place); } catch { /* perhaps the next */ }
    }
    need(!schema.anyOf && TYPES[schema.type](value));
    const choices = "const" in schema ? [schema.const] : schema.enum;
    need(!choices || choices.map(String).includes(String(value)));
    if (schema.type === "array") return readList(schema, value, place, need);
    if (schema.type === "object") return readMap(schema, value, place, need);
    if (schema.type === "string") return value;
    const { minimum = -Infinity, maximum = Infinity, exclusiveMinimum: above = -Infinity } = schema;
    need(value >= minimum && value <= maximum && value > above && value < (schema.exclusiveMaximum ?? Infinity));
    return schema.type === "number" ? Number(value) : value;
  }
  function readList({ items, prefixItems, minItems = 0, maxItems = Infinity }, value, place, need) {
    need(value.length <= maxItems);
    const held = value.map((one, i) => read(prefixItems?.[i] ?? items, one, `${place}[${i}]`));
    need(held.length >= minItems);
    return held;
  }
  function readMap({ patternProperties, propertyNames, additionalProperties }, value, place, need) {
    const [[pattern, inner]] = Object.entries(patternProperties ?? { "": additionalProperties });
    const fits = new RegExp(pattern.replaceAll(".", "[^\\n]"), "u"); // a dot means the same in both languages
    return new Map([...value].map(([name, one]) => {
      const at = `${place}[${shown(name)}]`;
      if (propertyNames) read({ type: "string", ...propertyNames }, name, at);
      need(fits.test(name), at, name);
      return [name, read(inner, one, at)];
    }));
  }
  function valueOf({ schema }, text) { // lists may be typed without their brackets
    const typed = text.trim().replace(/4a(′|\\u2032)/g, "4a'"), value = parse(typed);
    const bare = schema.type === "array" ? !Array.isArray(value) : schema.anyOf && value === undefined && typed;
    return (bare ? parse(`[${typed}]`) : undefined) ?? (value === undefined ? typed : value);
  }
  function judge(field, text) { // the value, or what the command says of it
    try {
      const value = read(field.schema, valueOf(field, text), field.name);
      const repeats = field.schema.items && new Set(value.map((one) => dumps(one))).size < value.length;
      if (repeats) throw { at: field.name, given: value };
      return { value };
    } catch ({ at, given }) {
      return { problem: `${at}: given ${shown(given)}, ${field.permitted}` };
    }
  }

  // --- the commands; values are quoted as Python's shlex does it
  const quote = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);
  const plain = (value, ...how) => (typeof value === "string" ? value : dumps(value, ...how));
  const command = (name, given) =>
    ["thesis run", name, ...given.map(([key, value]) => `-p ${quote(`${key}=${plain(value)}`)}`)].join(" ");
  const pointed = (value) => float(value).replace(/^(-?\d+)e/, "$1.0e"); // else YAML takes 1e-07 for a word
  const papermill = (name, given) =>
    ["papermill", `notebooks/${name}.ipynb`, `${name}-out.ipynb`, ...given.map(([key, value]) =>
      (Object(value) === value ? `-y ${quote(`${key}: ${plain(value, asIs, pointed)}`)}`
        : `-p ${key} ${quote(plain(value))}`))].join(" ");

  // --- elements: attributes and text only, never markup
  function html(tag, attributes = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) if (value != null) node.setAttribute(name, value);
    node.append(...children);
    return node;
  }
  function copyButton(label, code) {
    const node = html("button", { type: "button", "aria-label": `Copy ${label}` }, "Copy");
    node.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(code.textContent);
        node.textContent = "Copied";
      } catch { // no permission, or no clipboard on this page
        getSelection().selectAllChildren(code);
        node.textContent = "Selected: now copy it";
      }
      setTimeout(() => { node.textContent = "Copy"; }, 2500);
    });
    return node;
  }

  function render({ model, el }) {
    const data = model.get("data"), onPage = Boolean(model.get("page")), { fields, sets, chapters } = data;
    const uid = `tl-rerun-${document.querySelectorAll(".tl-rerun").length}`;
    const texts = new Map(); // what is typed for a field, by its number: kept when another set has the same
    let rows = [];

    // --- one parameter: a control, what is allowed, and what is wrong with it
    const choicesOf = ({ items = {} }) => items.enum ?? items.anyOf?.flatMap((part) => part.enum) ?? []; // of a list
    function control(n, id, describedby) {
      const { schema, name, typed } = fields[n], text = texts.get(n) ?? typed;
      const labelled = { id, "aria-describedby": describedby };
      const choices = choicesOf(schema);
      if (choices.length) {
        const held = [valueOf(fields[n], text)].flat().map(String);
        const boxes = choices.map((one) => html("input", { type: "checkbox", value: JSON.stringify(one),
          checked: held.includes(String(one)) ? "" : null }));
        const group = { role: "group", "aria-labelledby": `${id}-label`, class: "tl-rerun-boxes" };
        const node = html("div", { ...labelled, ...group },
          ...boxes.map((box, i) => html("label", {}, box, `${choices[i]}`)));
        return [node, () => boxes.filter((box) => box.checked).map((box) => box.value).join(", ")];
      }
      const long = schema.type === "object" || typed.length > 60;
      const node = schema.enum ? html("select", labelled, ...schema.enum.map((one) => html("option", {}, one)))
        : html(long ? "textarea" : "input", { ...labelled, rows: long ? 3 : null, type: long ? null : "text",
          inputmode: ["number", "integer"].includes(schema.type) ? "decimal" : null, spellcheck: "false",
          autocomplete: "off", autocapitalize: "off" });
      node.value = text;
      if (node.value === "") node.value = typed; // not one of the choices
      return [node, () => node.value];
    }
    function row(n, run) {
      const { name, meaning, unit, allowed, typed, schema } = fields[n], id = `${uid}-${name}`;
      const [node, now] = control(n, id, `${id}-hint ${id}-problem`), boxes = node.matches("div");
      const usual = read(schema, valueOf(fields[n], typed), name);
      const holders = run.sets.filter((one) => sets[one].shown.includes(n));
      const hints = [`Allowed: ${allowed}.`, `Default: ${boxes && usual.length === choicesOf(schema).length ? "all" : typed}.`];
      if (holders.length < run.sets.length) hints.push(`Only in ${holders.join(", ")}.`);
      const problem = html("p", { id: `${id}-problem`, class: "tl-rerun-problem" });
      const body = html("div", { class: "tl-rerun-row", "data-parameter": name },
        html(boxes ? "div" : "label", { id: `${id}-label`, for: boxes ? null : id, class: "tl-rerun-label" },
          html("code", {}, name), " ", meaning),
        html("div", { class: "tl-rerun-value" }, node, ...(unit ? [html("span", {}, unit)] : [])),
        html("p", { id: `${id}-hint`, class: "tl-rerun-hint" }, hints.join(" ")), problem);
      body.addEventListener("input", () => { texts.set(n, now()); update(); });
      return { n, name, body, node, problem, now, usual };
    }

    // --- the form
    const option = (name) => html("option", { value: name }, `${name}: ${sets[name].title}`);
    const inChapters = Object.values(chapters).flatMap((one) => one.sets);
    const chooser = html("select", {}, ...Object.entries(chapters).map(([name, { title, sets: members }]) =>
      html("optgroup", { label: title }, html("option", { value: name }, `${name}: all its figure sets`),
        ...members.map(option))), ...Object.keys(sets).filter((one) => !inChapters.includes(one)).map(option));
    const note = html("p", { class: "tl-rerun-note" }), form = html("div", { class: "tl-rerun-rows" });
    const status = html("p", { class: "tl-rerun-status", "aria-live": "polite" });
    const code = html("code"), mill = html("code"), output = html("div", { class: "tl-rerun-output" },
      html("div", { class: "tl-rerun-command" }, html("pre", {}, code), copyButton("the command", code)),
      html("details", {}, html("summary", {}, "The same with papermill"),
        html("div", { class: "tl-rerun-command" }, html("pre", {}, mill), copyButton("papermill's command", mill))));
    const reset = html("button", { type: "button" }, "Reset");
    const root = html("section", { class: "tl-rerun", "aria-label": "A rerun with your parameters" },
      html("div", { class: "tl-rerun-head" },
        html("label", {}, html("span", {}, "Figure set or chapter"), chooser), reset),
      note, form, html("div", { class: "tl-rerun-result" }, status, output));
    const chosen = () => chapters[chooser.value] ?? { ...sets[chooser.value], sets: [chooser.value], differ: [] };

    function build() {
      const run = chosen();
      const differ = run.differ.join(", "), said = [run.takes, differ && "Each set takes the parameters that it has. " +
        `The sets differ in ${differ}: choose one set to change these.`];
      note.textContent = said.filter(Boolean).join(" ");
      rows = run.shown.map((n) => row(n, run));
      form.replaceChildren(...rows.map(({ body }) => body));
      update();
    }
    function update() { // all rows, the line that the command would print, or the commands
      const judged = new Map(rows.map(({ n, now }) => [n, judge(fields[n], now())])), run = chosen();
      const given = new Map();
      for (const { n, name, body, node, problem, usual } of rows) {
        const found = judged.get(n), changed = found.problem || dumps(found.value) !== dumps(usual);
        if (changed && !found.problem && found.value !== usual) given.set(n, [name, found.value]); // −0 is 0
        problem.textContent = found.problem ?? "";
        body.toggleAttribute("data-changed", Boolean(changed));
        if (!node.matches("div")) node.setAttribute("aria-invalid", Boolean(found.problem));
      }
      const faults = run.sets.flatMap((one) => sets[one].checked.filter((n) => judged.get(n)?.problem)
        .map((n) => `thesis: ${one}: ${judged.get(n).problem}`));
      output.hidden = faults.length > 0;
      root.toggleAttribute("data-refused", output.hidden);
      status.textContent = faults[0] ?? (given.size === 0 ? "As published, no parameter changed:"
        : `${given.size} ${given.size === 1 ? "parameter differs" : "parameters differ"} from the default:`);
      if (faults.length) return;
      const order = sets[chooser.value]?.checked ?? run.shown;
      code.textContent = command(chooser.value, order.filter((n) => given.has(n)).map((n) => given.get(n)));
      mill.textContent = run.sets.map((one) => papermill(one,
        sets[one].checked.filter((n) => given.has(n)).map((n) => given.get(n)))).join("\n");
    }

    // --- the address: ?set=beam-distance&azimuth_deg=45
    function readAddress() {
      const query = new URLSearchParams(location.search), name = query.get("set") ?? "";
      if (name in sets || name in chapters) chooser.value = name;
      for (const n of chosen().shown) if (query.has(fields[n].name)) texts.set(n, query.get(fields[n].name));
    }
    function writeAddress() {
      if (!onPage) return;
      const url = new URL(location.href);
      for (const { name } of fields) url.searchParams.delete(name);
      url.searchParams.set("set", chooser.value);
      for (const { name, body, now } of rows) if (body.hasAttribute("data-changed")) url.searchParams.set(name, now());
      try { history.replaceState(history.state, "", url); } catch { /* some browsers refuse in a local file */ }
    }

    chooser.value = Object.keys(sets)[0];
    if (onPage) readAddress();
    chooser.addEventListener("change", build);
    root.addEventListener("change", writeAddress);
    reset.addEventListener("click", () => { texts.clear(); build(); writeAddress(); });
    el.replaceChildren(root);
    build();
  }

  return { render };
})();
