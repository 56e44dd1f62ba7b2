// What is typed for a request as Python reads, judges and writes it: JSON, bounds, and the commands that say it.
// One expression, so that its names stay apart.
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
  function general(value, digits = 6) { // as Python's format "g" writes it
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    if (power >= -4 && power < digits) return `${Number(value.toPrecision(digits))}`;
    return `${Number(mantissa)}e${power.replace(/^(.)(\d)$/, "$10$2")}`;
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
  function shown(value) { // on one line, at most 60 signs; of a long list its length
    const signs = [...asIs(dumps(value, (text) => text))];
    if (signs.length > 60 && Array.isArray(value)) return `a list of ${value.length}`;
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
    const fits = new RegExp(pattern, "u");
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

  return { command, dumps, general, judge, papermill, read, shown, valueOf };
})();
