// The controls of a request's parameters: what is typed, what is allowed, what is wrong with it.
import { html } from "./parts.js";
import { dumps, parseTyped, readDefault } from "./request.js";

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

// One parameter: `text` is what was typed so far, `more` a further hint, `changed` is called with
// what is typed now.
export function createField(field, id, text, more, changed) {
  const { name, meaning, unit, allowed, typed, schema } = field;
  const described = { id, "aria-describedby": `${id}-hint ${id}-problem` };
  const [node, now] = createControl(field, text, id, described), isGroup = node.matches("div");
  const usual = readDefault(field), all = isGroup && usual.length === choicesOf(schema).length;
  const hint = `Allowed: ${allowed}. Default: ${all ? "all" : typed}. ${more}`.trimEnd();
  const problem = html("p", { id: `${id}-problem`, class: "tl-rerun-problem" });
  const body = html("div", { class: "tl-rerun-row", "data-parameter": name },
    html(isGroup ? "div" : "label", { id: `${id}-label`, for: isGroup ? null : id,
      class: "tl-rerun-label" }, html("code", {}, name), " ", html("span", {}, meaning)),
    html("div", { class: "tl-rerun-value" }, node, unit ? html("span", {}, unit) : ""),
    html("p", { id: `${id}-hint`, class: "tl-rerun-hint" }, hint), problem);
  body.addEventListener("input", () => changed(now()));
  return { name, body, now, usual,
    report(found) { // says what is wrong, and whether it is another value than the default
      const other = Boolean(found.problem) || dumps(found.value) !== dumps(usual);
      problem.textContent = found.problem ?? "";
      body.toggleAttribute("data-changed", other);
      if (!isGroup) node.setAttribute("aria-invalid", Boolean(found.problem));
      return other;
    } };
}
