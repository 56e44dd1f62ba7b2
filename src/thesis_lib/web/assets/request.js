// Parsing and validation of typed values as in Python: JSON, bounds, the command.

// --- JSON with a space after commas and colons, as Python writes it
export const dumps = (value) => JSON.stringify(value, null, 1)
  .replace(/(?<=[[{])\n *|\n *(?=[\]}])/g, "").replace(/\n */g, " ");
export function formatGiven(value) { // at most 60 characters; a long list by its length
  const words = dumps(value);
  if (words.length <= 60) return words;
  return Array.isArray(value) ? `a list of ${value.length}` : `${words.slice(0, 57)}...`;
}
export const formatGeneral = (value, digits = 6) => `${Number(value.toPrecision(digits))}`;

// Typed text is parsed as after `-p name=`: JSON, or else text.
function parse(text) { // undefined if it is not JSON
  try { return JSON.parse(text); } catch { return undefined; }
}
export function parseTyped({ schema }, text) { // lists may be typed without their brackets
  const typed = text.trim().replaceAll("4a′", "4a'"), value = parse(typed);
  const bare = schema.type === "array" ? !Array.isArray(value)
    : schema.anyOf && value === undefined && typed;
  return (bare ? parse(`[${typed}]`) : undefined) ?? value ?? typed;
}

// --- checking, by the JSON schema of the parameter's model, in the order of pydantic
const TYPES = {
  integer: Number.isSafeInteger,
  number: Number.isFinite,
  string: (value) => typeof value === "string",
  array: Array.isArray,
  object: (value) => Object(value) === value && !Array.isArray(value),
};
function findFault(schema, value, at) { // the first fault, if any: its place and the value there
  const own = { at, given: value };
  if (schema.anyOf) return schema.anyOf.every((one) => findFault(one, value, at)) ? own : null;
  const choices = "const" in schema ? [schema.const] : schema.enum;
  if (!TYPES[schema.type](value) || (choices && !choices.includes(value))) return own;
  if (schema.type === "array") return findInList(schema, value, at);
  if (schema.type === "object") return findInObject(schema, value, at);
  const { minimum = -Infinity, maximum = Infinity } = schema;
  const { exclusiveMinimum: above = -Infinity, exclusiveMaximum: below = Infinity } = schema;
  return value < minimum || value > maximum || value <= above || value >= below ? own : null;
}
function findInList({ items, prefixItems, minItems = 0, maxItems = Infinity }, value, at) {
  const own = { at, given: value };
  if (value.length > maxItems) return own;
  return value.map((one, i) => findFault(prefixItems?.[i] ?? items, one, `${at}[${i}]`))
    .find(Boolean) ?? (value.length < minItems ? own : null);
}
function findInObject({ patternProperties, propertyNames, additionalProperties }, value, at) {
  const [[pattern, inner]] = Object.entries(patternProperties ?? { "": additionalProperties });
  const names = { type: "string", ...propertyNames }, fits = new RegExp(pattern, "u");
  return Object.entries(value).map(([name, one]) => {
    const place = `${at}[${formatGiven(name)}]`;
    return findFault(names, name, place) ??
      (fits.test(name) ? findFault(inner, one, place) : { at: place, given: name });
  }).find(Boolean);
}
export function judge(field, text) { // the value, or the command's refusal
  const value = parseTyped(field, text), { schema, name, permitted } = field;
  const differs = () => !schema.uniqueItems || new Set(value.map(dumps)).size === value.length;
  const fault = findFault(schema, value, name) ?? (differs() ? null : { at: name, given: value });
  return fault ? { problem: `${fault.at}: given ${formatGiven(fault.given)}, ${permitted}` }
    : { value };
}

// --- the command; values are quoted as by Python's shlex
const quote = (text) =>
  (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);
export const formatCommand = (name, given) => ["thesis run", name, ...given.map(([key, value]) =>
  `-p ${quote(`${key}=${typeof value === "string" ? value : dumps(value)}`)}`)].join(" ");
