// What is typed for a request as Python reads, judges and writes it: JSON, bounds, commands.

// --- Python's JSON. What is typed means what it means after `-p name=`: JSON, or else text.
// Numbers with a point are Number, others BigInt; objects are Maps, which keep the order of names.
const TOKEN =
  /"(?:[^"\\]|\\.)*"(\s*:)?|-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?|NaN|-?Infinity/g;
function wrapNumber(token, colon) { // into an object, and let the names of others begin with ~
  if (token[0] !== '"') return `{"":"${token}"}`;
  return colon ? `"~${token.slice(1)}` : token;
}
function unwrap(_, value) {
  const plain = typeof value !== "object" || value === null || Array.isArray(value);
  if (plain || value instanceof Map) return value;
  if (!("" in value))
    return new Map(Object.entries(value).map(([name, one]) => [name.slice(1), one]));
  return /[.eEN]|I/.test(value[""]) ? Number(value[""]) : BigInt(value[""]);
}
function parse(text) { // undefined where it is no JSON
  try { return JSON.parse(text.replace(TOKEN, wrapNumber), unwrap); } catch { return undefined; }
}
const padExponent = (power) => power.replace(/^(.)(\d)$/, "$10$2");
function formatFloat(value) { // as Python writes it
  const [digits, power] = value.toExponential().split("e");
  if (power < -4 || power >= 16) return `${digits}e${padExponent(power)}`;
  const text = Object.is(value, -0) ? "-0" : String(value);
  return Number.isInteger(value) ? `${text}.0` : text;
}
export function formatGeneral(value, digits = 6) { // as Python's format "g" writes it
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  if (power >= -4 && power < digits) return `${Number(value.toPrecision(digits))}`;
  return `${Number(mantissa)}e${padExponent(power)}`;
}
const escapeUnit = (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`;
const keepAscii = (text) => text.replace(/[^ -~]/g, escapeUnit);
export function dumps(value, protect = keepAscii, number = formatFloat) {
  const inner = (one) => dumps(one, protect, number);
  if (typeof value === "string") return protect(JSON.stringify(value));
  if (typeof value === "number") return number(value);
  if (Array.isArray(value)) return `[${value.map(inner).join(", ")}]`;
  if (value instanceof Map)
    return `{${[...value].map((pair) => pair.map(inner).join(": ")).join(", ")}}`;
  return String(value);
}
const UNPRINTABLE = /(?! )[\p{C}\p{Z}]/gu;
function escapeSign(sign) { // as Python's unicode_escape
  const code = sign.codePointAt(0);
  const [letter, length] = code > 0xffff ? ["U", 8] : code > 0xff ? ["u", 4] : ["x", 2];
  return `\\${letter}${code.toString(16).padStart(length, "0")}`;
}
const keepPrintable = (text) => text.replace(UNPRINTABLE, escapeSign);
export function formatGiven(value) { // on one line, at most 60 signs; of a long list its length
  const signs = [...keepPrintable(dumps(value, (text) => text))];
  if (signs.length <= 60) return signs.join("");
  return Array.isArray(value) ? `a list of ${value.length}` : `${signs.slice(0, 57).join("")}...`;
}

// --- checking, by the JSON schema of the parameter's model, in the order of pydantic
const TYPES = {
  integer: (value) => typeof value === "bigint",
  number: (value) => typeof value === "bigint" || Number.isFinite(value),
  string: (value) => typeof value === "string",
  array: Array.isArray,
  object: (value) => value instanceof Map,
};
function readValue(schema, value, place) { // as the model holds it
  const need = (good, at = place, given = value) => { if (!good) throw { at, given }; };
  for (const one of schema.anyOf ?? []) {
    try { return readValue(one, value, place); } catch { /* perhaps the next */ }
  }
  need(!schema.anyOf && TYPES[schema.type](value));
  const choices = "const" in schema ? [schema.const] : schema.enum;
  need(!choices || choices.map(String).includes(String(value)));
  if (schema.type === "array") return readList(schema, value, place, need);
  if (schema.type === "object") return readMap(schema, value, place, need);
  if (schema.type === "string") return value;
  const { minimum = -Infinity, maximum = Infinity } = schema;
  const { exclusiveMinimum: above = -Infinity, exclusiveMaximum: below = Infinity } = schema;
  need(value >= minimum && value <= maximum && value > above && value < below);
  return schema.type === "number" ? Number(value) : value;
}
function readList({ items, prefixItems, minItems = 0, maxItems = Infinity }, value, place, need) {
  need(value.length <= maxItems);
  const held = value.map((one, i) => readValue(prefixItems?.[i] ?? items, one, `${place}[${i}]`));
  need(held.length >= minItems);
  return held;
}
function readMap(schema, value, place, need) {
  const { patternProperties, propertyNames, additionalProperties } = schema;
  const [[pattern, inner]] = Object.entries(patternProperties ?? { "": additionalProperties });
  const fits = new RegExp(pattern, "u");
  return new Map([...value].map(([name, one]) => {
    const at = `${place}[${formatGiven(name)}]`;
    if (propertyNames) readValue({ type: "string", ...propertyNames }, name, at);
    need(fits.test(name), at, name);
    return [name, readValue(inner, one, at)];
  }));
}
export function parseTyped({ schema }, text) { // lists may be typed without their brackets
  const typed = text.trim().replace(/4a(′|\\u2032)/g, "4a'"), value = parse(typed);
  const bare = schema.type === "array" ? !Array.isArray(value)
    : schema.anyOf && value === undefined && typed;
  return (bare ? parse(`[${typed}]`) : undefined) ?? (value === undefined ? typed : value);
}
export const readDefault = (field) =>
  readValue(field.schema, parseTyped(field, field.typed), field.name);
export function judge(field, text) { // the value, or what the command says of it
  try {
    const value = readValue(field.schema, parseTyped(field, text), field.name);
    const different = field.schema.items && new Set(value.map((one) => dumps(one))).size;
    if (different < value.length) throw { at: field.name, given: value };
    return { value };
  } catch ({ at, given }) {
    return { problem: `${at}: given ${formatGiven(given)}, ${field.permitted}` };
  }
}

// --- the commands; values are quoted as Python's shlex does it
const quote = (text) =>
  (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);
const formatValue = (value, ...how) => (typeof value === "string" ? value : dumps(value, ...how));
export const formatCommand = (name, given) => ["thesis run", name,
  ...given.map(([key, value]) => `-p ${quote(`${key}=${formatValue(value)}`)}`)].join(" ");
// With a point in numbers, else YAML takes 1e-07 for a word.
const pointed = (value) => formatFloat(value).replace(/^(-?\d+)e/, "$1.0e");
export const formatPapermill = (name, given) => ["papermill", `notebooks/${name}.ipynb`,
  `${name}-out.ipynb`, ...given.map(([key, value]) => (Object(value) === value
    ? `-y ${quote(`${key}: ${formatValue(value, keepPrintable, pointed)}`)}`
    : `-p ${key} ${quote(formatValue(value))}`))].join(" ");
