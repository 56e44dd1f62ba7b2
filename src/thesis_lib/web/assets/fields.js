// The controls of a request's parameters: what is typed, what is allowed, what is wrong with it.
import request from "./request.js";
import { html } from "./parts.js";

export default (() => {
  const { read, valueOf } = request;
  const choicesOf = ({ items = {} }) => items.enum ?? items.anyOf?.flatMap((part) => part.enum) ?? []; // of a list

  function control(field, text, id, described) {
    const { schema, typed } = field, labelled = { id, "aria-describedby": described }, choices = choicesOf(schema);
    if (choices.length) {
      const held = [valueOf(field, text)].flat().map(String);
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

  // One parameter: `text` is what was typed so far, `more` a further hint, `changed` is called with what is typed now.
  return function create(field, id, text, more, changed) {
    const { name, meaning, unit, allowed, typed, schema } = field;
    const [node, now] = control(field, text, id, `${id}-hint ${id}-problem`), boxes = node.matches("div");
    const usual = read(schema, valueOf(field, typed), name), all = boxes && usual.length === choicesOf(schema).length;
    const hints = [`Allowed: ${allowed}.`, `Default: ${all ? "all" : typed}.`, ...(more ? [more] : [])];
    const problem = html("p", { id: `${id}-problem`, class: "tl-rerun-problem" });
    const body = html("div", { class: "tl-rerun-row", "data-parameter": name },
      html(boxes ? "div" : "label", { id: `${id}-label`, for: boxes ? null : id, class: "tl-rerun-label" },
        html("code", {}, name), " ", html("span", {}, meaning)),
      html("div", { class: "tl-rerun-value" }, node, ...(unit ? [html("span", {}, unit)] : [])),
      html("p", { id: `${id}-hint`, class: "tl-rerun-hint" }, hints.join(" ")), problem);
    body.addEventListener("input", () => changed(now()));
    return { name, body, now, usual,
      judge(found) { // says what is wrong, and whether it is another value than the default
        const other = Boolean(found.problem) || request.dumps(found.value) !== request.dumps(usual);
        problem.textContent = found.problem ?? "";
        body.toggleAttribute("data-changed", other);
        if (!boxes) node.setAttribute("aria-invalid", Boolean(found.problem));
        return other;
      } };
  };
})();
