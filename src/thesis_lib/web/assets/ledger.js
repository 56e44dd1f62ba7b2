// The ledger: the claims of the thesis with their verdicts, as a table to filter, search and sort.
// Front end of thesis_lib.figure_sets.claims.figures.LedgerTable.
import { asked, button, copyButton, fill, html, keep, options } from "./parts.js";

// In the order of sorting and counting.
const VERDICTS = ["agrees", "within scatter", "differs", "no material change", "undefined"];
const WORDS = { agrees: "agree", differs: "differ" }; // plural

// Control, label, and the values of a row to choose from.
const FILTERS = [
  ["chapter", "Chapter", (row) => [row.chapter]],
  ["case", "Case", (row) => row.case.split(/,\s*/)],
  ["mode", "Mode", (row) => row.modes],
  ["verdict", "Verdict", (row) => [row.verdict]],
  ["kind", "Kind", (row) => [row.kind]],
];
const COLUMNS = [["place", "Place"], ["case", "Case"], ["mode", "Mode"], ["what", "Claim"],
  ["stated", "Claimed"], ["got", "We get"], ["verdict", "Verdict"], ["ratio", "Ratio"],
  ["more", "More"]];
const { compare } = new Intl.Collator("en", { numeric: true }); // figure 3.4 before figure 3.10
const rank = (verdict) => VERDICTS.indexOf(verdict);
const SORTS = { // label and comparison of two rows; rows without a ratio come last
  "": ["as listed", () => 0],
  place: ["place", (a, b) => a.chapter - b.chapter || compare(a.place, b.place)],
  verdict: ["verdict", (a, b) => rank(a.verdict) - rank(b.verdict)],
  ratio: ["ratio ↑", (a, b) => (a.ratio ?? Infinity) - (b.ratio ?? Infinity) || 0],
  "-ratio": ["ratio ↓", (a, b) => (b.ratio ?? -1) - (a.ratio ?? -1)],
};
const plain = (words) => words.replace(/\s+/g, " ").trim().toLowerCase(); // also no-break spaces

function link(words, href) {
  const node = html("a", { href }, words);
  return href && node.protocol !== "javascript:" ? node : words;
}

// --- one claim: a body with a row, and a second row once it is opened. The roles are explicit, since
// the style turns rows into grids, which some browsers then no longer report as a table.
function secondLine(row) {
  const code = html("code", {}, row.command ?? ""), more = link("More on this", row.note_href);
  const copy = copyButton("Copy", null, () => row.command, code);
  return html("tr", { class: "tl-ledger-second", id: `claim-${row.id}-more`, role: "row" },
    html("td", { colspan: COLUMNS.length, role: "cell" },
      row.note && html("p", {}, row.note, row.note_href && [" ", more]),
      row.command && html("p", {}, "Run again: ", code, " ", copy),
      html("p", {}, "Link: ", html("a", { href: `#claim-${row.id}` }, row.id))));
}
function claimOf(row) {
  const body = html("tbody", { id: `claim-${row.id}`, role: "rowgroup" });
  const word = row.note_href ? "why" : row.note ? "note" : "more";
  const name = `${word} about ${row.place}: ${row.what}`; // with the visible word, for speech input
  const toggle = button(word, { "aria-expanded": false, "aria-label": name }, () => {
    const open = toggle.ariaExpanded === "true";
    const second = body.rows[1] ?? body.appendChild(secondLine(row));
    second.hidden = open;
    fill(toggle, { "aria-expanded": !open, "aria-controls": second.id });
  });
  const verdict = row.verdict + (row.step_back ? ", not monotonic" : "");
  const shown = { ...row, mode: row.modes.join(", "), ratio: row.ratio?.toFixed(2), more: toggle,
    place: [link(row.place, row.href), !row.counted && html("sup", { title: "not counted" }, "†")],
    verdict: html("span", { "data-verdict": row.verdict }, verdict) };
  const cells = COLUMNS.map(([name, label]) => html(name === "what" ? "th" : "td", {
    class: `tl-ledger-${name}`, "data-label": label, style: `--area: ${name}`,
    role: name === "what" ? "rowheader" : "cell" }, shown[name]));
  body.append(html("tr", { role: "row" }, cells));
  const text = [row.id, row.what, row.stated, row.note, row.place].map(plain).join("\n");
  return { row, body, text, values: FILTERS.map(([, , of]) => of(row).map(String)) };
}

function render({ model, el }) {
  const onPage = Boolean(model.get("page")); // a page by static_html: its URL keeps the filters
  const root = html("section", { class: "tl-ledger", "aria-label": "Claims of the thesis" });
  const count = html("p", { class: "tl-ledger-count", "aria-live": "polite" });
  const form = html("form", { class: "tl-ledger-controls", "aria-label": "Filters",
    oninput: apply, onchange: writeAddress, onsubmit: (event) => event.preventDefault() });
  const chosen = () => Object.fromEntries(new FormData(form)); // filters, search and order
  let claims = [], table = null, order = "";

  // --- shown claims
  function apply() {
    const { search, sort, ...filters } = chosen(), wanted = plain(search);
    const choices = Object.values(filters), shown = claims.filter(({ text, values }) =>
      text.includes(wanted) && choices.every((one, i) => !one || values[i].includes(one)));
    for (const { body } of claims) body.hidden = true;
    for (const { body } of shown) body.hidden = false;
    const [, compareRows] = SORTS[sort];
    if (order !== sort) table.append(...claims
      .toSorted((a, b) => compareRows(a.row, b.row)).map(({ body }) => body));
    order = sort;
    const counted = shown.filter(({ row }) => row.counted), others = shown.length - counted.length;
    const parts = VERDICTS.map((one) => {
      const number = counted.filter(({ row }) => row.verdict === one).length;
      return `${number} ${number === 1 ? one : WORDS[one] ?? one}`;
    });
    count.textContent = `${shown.length} of ${claims.length} shown: ${parts.join(", ")}` +
      (others ? `; ${others} not counted†` : "");
  }

  // --- the URL: ?chapter=3&verdict=differs for the filters, #claim-… for one claim
  function readAddress() { // unknown values are ignored
    for (const name of Object.keys(chosen())) {
      const box = form.elements[name], value = asked(name) ?? "";
      const isKnown = !box.options || [...box.options].some((one) => one.value === value);
      if (isKnown) box.value = value;
    }
  }
  function writeAddress() {
    const isHidden = claims.some(({ body }) => body.hidden && `#${body.id}` === location.hash);
    if (onPage) keep(Object.fromEntries(Object.entries(chosen())
      .map(([name, value]) => [name, value || null])), isHidden ? "" : location.hash);
  }
  function follow() { // a link to a claim, which is shown despite the filters
    const claim = claims.find(({ body }) => `#${body.id}` === location.hash);
    for (const one of claims) one.body.ariaCurrent = one === claim ? "true" : null;
    if (!claim) return;
    claim.body.querySelector("button[aria-expanded=false]")?.click();
    if (claim.body.hidden) reset();
    const show = () => claim.body.scrollIntoView({ block: "center" });
    show();
    requestAnimationFrame(() => requestAnimationFrame(show)); // rows then have their final heights
  }

  // --- building, once per data
  const control = (name, label, node) =>
    html("label", { class: `tl-ledger-${name}` }, html("span", {}, label), fill(node, { name }));
  const choice = (name, label, pairs) => control(name, label, html("select", {}, options(pairs)));
  function filter([name, label], i) {
    const values = [...new Set(claims.flatMap((claim) => claim.values[i]))].filter(Boolean);
    values.sort(name === "verdict" ? (a, b) => rank(a) - rank(b) : compare);
    return choice(name, label, [["", "all"], ...values.map((value) => [value, value])]);
  }
  const head = ([name, label]) => html("th", { role: "columnheader", class: `tl-ledger-${name}` },
    html("span", {}, label));
  function reset() {
    form.reset();
    apply();
    writeAddress();
  }
  function build() {
    claims = (model.get("data").rows ?? []).map(claimOf);
    if (!claims.length) return root.replaceChildren("No claims to show.");
    form.replaceChildren(...FILTERS.map(filter),
      control("search", "Search", html("input", { type: "search" })),
      choice("sort", "Sort by", Object.entries(SORTS).map(([name, [words]]) => [name, words])),
      button("Reset", {}, reset));
    order = "";
    table = html("table", { role: "table", "aria-label": "Claims and verdicts" },
      html("thead", { role: "rowgroup" }, html("tr", { role: "row" }, COLUMNS.map(head))),
      claims.map(({ body }) => body));
    root.replaceChildren(form, count, table);
    if (claims.some(({ row }) => !row.counted)) root.append(
      html("p", { class: "tl-ledger-foot" }, "† Listed, but not counted in the totals."));
    if (onPage) readAddress();
    apply();
  }

  build();
  el.replaceChildren(root); // only now, when complete, is the table laid out
  if (onPage) {
    follow();
    addEventListener("hashchange", follow);
  }
  model.on("change:data", build);
  return () => model.off("change:data", build);
}

export default { render };
