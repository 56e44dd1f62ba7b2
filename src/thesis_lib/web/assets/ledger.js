// The ledger: the claims of the thesis with their verdicts, as a table to filter, search and sort.
// Front end of thesis_lib.figure_sets.claims.figures.LedgerTable.
import { asked, button, copyButton, fill, html, keep, linkButton, options, svg } from "./parts.js";

// A mark for each verdict, told apart by shape first; the order is that of sorting and of the count.
const MARKS = {
  agrees: "M6 1a5 5 0 1 0 .01 0Z", // disc
  "within scatter": "M6 .6 11.4 6 6 11.4 .6 6Z", // diamond
  differs: "M6 1 11.6 11H.4Z", // triangle
  "no material change": "M1 4h10v4H1Z", // bar
  undefined: "M1.8 1.8h8.4v8.4h-8.4Z", // hollow square
};
const VERDICTS = Object.keys(MARKS);
const WORDS = { agrees: "agree", differs: "differ" }; // of several claims

// Control, label, and the values of a row, any of which may be chosen.
const FILTERS = [
  ["chapter", "Chapter", (row) => [row.chapter]],
  ["case", "Case", (row) => row.case.split(/,\s*/)],
  ["mode", "Mode", (row) => row.modes],
  ["verdict", "Verdict", (row) => [row.verdict]],
  ["kind", "Kind", (row) => [row.kind]],
];
const COLUMNS = [["place", "Place"], ["case", "Case"], ["mode", "Mode"], ["what", "Claim"],
  ["stated", "Stated"], ["got", "We get"], ["verdict", "Verdict"], ["ratio", "Ratio"], ["more", "More"]];
const { compare } = new Intl.Collator("en", { numeric: true }); // figure 3.4 before figure 3.10
const rank = (verdict) => VERDICTS.indexOf(verdict);
const SORTS = {
  place: (a, b) => a.chapter - b.chapter || compare(a.place, b.place),
  verdict: (a, b) => rank(a.verdict) - rank(b.verdict),
  ratio: (a, b) => a.ratio - b.ratio,
};

const columnOf = (order) => order.replace(/^-/, "");
const plain = (words) => words.replace(/\s+/g, " ").trim().toLowerCase(); // also of no-break spaces

function link(words, href) {
  const node = html("a", { href }, words);
  return href && node.protocol !== "javascript:" ? node : words;
}

// --- one claim: a body with a row, and a second row once it is opened. The roles are written out,
// for the style makes grids of the rows, which some browsers then no longer report as a table.
const drawVerdict = (verdict) => svg("svg", { width: 12, height: 12, viewBox: "0 0 12 12",
  "aria-hidden": "true", "data-verdict": verdict }, svg("path", { d: MARKS[verdict] ?? MARKS.undefined }));
function secondLine(row) {
  const code = html("code", {}, row.command ?? ""), more = link("More on this", row.note_href);
  const copy = copyButton("Copy", null, () => row.command, code);
  return html("tr", { class: "tl-ledger-second", id: `claim-${row.id}-more`, role: "row" },
    html("td", { colspan: COLUMNS.length, role: "cell" },
      row.note && html("p", {}, row.note, row.note_href && [" ", more]),
      row.command && html("p", {}, "Run again: ", code, " ", copy),
      html("p", { class: "tl-ledger-id" }, "Link: ", html("a", { href: `#claim-${row.id}` }, row.id))));
}
const SHORT = /^[<>≤≥~≈ ]*\d.{0,26}$/; // a number with a band or a unit, better on one line
// Padding that puts the units of numbers below each other, in digits.
const pad = (words, widest) => {
  const digits = /^\d+/.exec(words)?.[0].length;
  return digits && digits < widest ? `; --pad: ${widest - digits}` : "";
};
function claimOf(row, widest) {
  const body = html("tbody", { id: `claim-${row.id}`, role: "rowgroup" });
  const word = row.note_href ? "why" : row.note ? "note" : "more"; // in the name, too, for those who speak to the browser
  const toggle = button(word, { "aria-expanded": false, "aria-label": `${word} about ${row.place}: ${row.what}` },
    () => {
      const open = toggle.ariaExpanded === "true";
      const second = body.rows[1] ?? body.appendChild(secondLine(row));
      second.hidden = open;
      fill(toggle, { "aria-expanded": !open, "aria-controls": second.id });
    });
  const words = row.verdict + (row.step_back ? ", not monotonic" : "");
  const shown = { ...row, mode: row.modes.join(", "), ratio: row.ratio?.toFixed(2), more: toggle,
    place: [link(row.place, row.href), !row.counted && html("sup", { title: "not counted" }, "†")],
    verdict: [drawVerdict(row.verdict), html("span", {}, words)] };
  const cells = COLUMNS.map(([name, label]) => html(name === "what" ? "th" : "td", {
    class: `tl-ledger-${name}`, "data-label": label, role: name === "what" ? "rowheader" : "cell",
    "data-number": name in widest && SHORT.test(row[name]) ? "" : null,
    style: `--area: ${name}${name in widest ? pad(row[name], widest[name]) : ""}`,
  }, shown[name]));
  body.append(html("tr", { role: "row" }, cells));
  const text = [row.id, row.what, row.stated, row.note, row.place].map(plain).join("\n");
  return { row, body, text, values: FILTERS.map(([, , of]) => of(row).map(String)) };
}

function render({ model, el }) {
  const onPage = Boolean(model.get("page")); // a page by static_html: its address keeps the filters
  const root = html("section", { class: "tl-ledger", "aria-label": "Claims of the thesis" });
  const count = html("p", { class: "tl-ledger-count", "aria-live": "polite" });
  const form = html("form", { class: "tl-ledger-controls", "aria-label": "Filters",
    oninput: change, onchange: writeAddress, onsubmit: (event) => event.preventDefault() });
  const chosen = () => Object.fromEntries(new FormData(form)); // of the filters and the search
  const heads = {};
  const more = button("", { class: "tl-ledger-fold", "aria-expanded": false }, () => { unfolded = !unfolded; apply(); });
  let claims = [], folded = new Set(), unfolded = false; // the last ones, and whether they are shown
  let table = null, linked = null, sorted = "";

  // --- what is shown
  function apply() {
    const { search, ...filters } = chosen(), wanted = plain(search), choices = Object.values(filters);
    const all = unfolded || Boolean(wanted) || choices.some(Boolean);
    const fits = claims.filter((claim) => (all || !folded.has(claim)) && claim.text.includes(wanted) &&
      choices.every((value, i) => !value || claim.values[i].includes(value)));
    const shown = new Set(linked ? [...fits, linked] : fits);
    for (const claim of claims) claim.body.hidden = !shown.has(claim);
    const counted = [...shown].filter(({ row }) => row.counted), others = shown.size - counted.length;
    more.hidden = !folded.size || (all && !unfolded);
    more.textContent = `${unfolded ? "Hide" : "Show"} ${folded.size} counts and roots that no total counts`;
    fill(more, { "aria-expanded": unfolded });
    const parts = VERDICTS.map((one) => {
      const number = counted.filter(({ row }) => row.verdict === one).length;
      return `${number} ${number === 1 ? one : WORDS[one] ?? one}`;
    });
    count.textContent = `${shown.size} of ${claims.length} shown: ${parts.join(", ")}` +
      (others ? `; ${others} not counted†` : "") +
      (shown.size > fits.length ? "; one is shown by its link" : "");
  }
  function change() { // by the reader: the linked claim is no longer an exception
    unlink();
    apply();
  }
  function sort(order) { // by a column, "-" before its name from the last to the first; "": as given
    sorted = order;
    const column = columnOf(order), sign = column === order ? 1 : -1;
    const missing = ({ row }) => column === "ratio" && row.ratio == null;
    const those = column ? claims.toSorted((a, b) =>
      missing(a) - missing(b) || sign * SORTS[column](a.row, b.row)) : claims;
    table.append(...those.map(({ body }) => body));
    for (const [name, head] of Object.entries(heads))
      head.setAttribute("aria-sort", name !== column ? "none" : sign > 0 ? "ascending" : "descending");
  }
  const nextSort = (name) => // up, down, as given
    sorted === name ? `-${name}` : sorted === `-${name}` ? "" : name;

  // --- the address: ?chapter=3&verdict=differs for the filters, #claim-… for one claim
  function readAddress() { // what is unknown is ignored
    for (const name of Object.keys(chosen())) {
      const box = form.elements[name], value = asked(name) ?? "";
      if (!box.options || [...box.options].some((option) => option.value === value)) box.value = value;
    }
    const order = asked("sort") ?? "";
    if (Object.hasOwn(SORTS, columnOf(order))) sort(order);
  }
  function writeAddress() {
    if (!onPage) return;
    const isOld = !linked && location.hash.startsWith("#claim-");
    const values = Object.entries({ ...chosen(), sort: sorted });
    keep(Object.fromEntries(values.map(([name, value]) => [name, value || null])),
      isOld ? "" : location.hash);
  }
  function unlink() {
    linked?.body.removeAttribute("aria-current");
    linked = null;
  }
  function follow() {
    if (!claims.length) return;
    let name = location.hash.slice(1);
    try { name = decodeURIComponent(name); } catch { /* not one of ours */ }
    unlink();
    linked = claims.find(({ body }) => body.id === name) ?? null;
    linked?.body.setAttribute("aria-current", "true");
    linked?.body.querySelector("button[aria-expanded=false]")?.click();
    apply();
    const show = () => linked?.body.scrollIntoView({ block: "center" });
    show();
    requestAnimationFrame(() => requestAnimationFrame(show)); // the rows around it have their true heights now
  }

  // --- building, once per data
  const control = (name, label, node) =>
    html("label", { class: `tl-ledger-${name}` }, html("span", {}, label), fill(node, { name }));
  function filter([name, label], i) {
    const values = [...new Set(claims.flatMap((claim) => claim.values[i]))].filter(Boolean);
    values.sort(name === "verdict" ? (a, b) => rank(a) - rank(b) : compare);
    return control(name, label,
      html("select", {}, options([["", "all"], ...values.map((value) => [value, value])])));
  }
  function head([name, label]) {
    const names = { role: "columnheader", class: `tl-ledger-${name}`, "data-label": label };
    if (!SORTS[name]) return html("th", names, html("span", {}, label));
    const press = () => { sort(nextSort(name)); writeAddress(); };
    return heads[name] = html("th", { ...names, "aria-sort": "none" }, button(label, {}, press));
  }
  function build() {
    const rows = model.get("data").rows ?? [];
    linked = null;
    sorted = "";
    const most = (name) => Math.min(3, Math.max(0, ...rows.map((row) => /^\d*/.exec(row[name])[0].length)));
    const widest = { stated: most("stated"), got: most("got") };
    claims = rows.map((row) => claimOf(row, widest));
    folded = new Set(claims.slice(claims.length - (model.get("data").folded ?? 0)));
    if (!claims.length) return root.replaceChildren("No claims to show.");
    form.replaceChildren(...FILTERS.map(filter),
      control("search", "Search", html("input", { type: "search" })),
      button("Reset", {}, () => {
        form.reset();
        sort("");
        change();
        writeAddress();
      }), ...(onPage ? linkButton(writeAddress) : []));
    table = html("table", { role: "table", "aria-label": "Claims and verdicts" },
      html("thead", { role: "rowgroup" }, html("tr", { role: "row" }, COLUMNS.map(head))),
      claims.map(({ body }) => body));
    root.replaceChildren(form, count, table, more);
    if (claims.some(({ row }) => !row.counted)) root.append(
      html("p", { class: "tl-ledger-foot" }, "† Listed, but not counted in the totals."));
    if (onPage) readAddress();
    apply();
  }

  build();
  el.replaceChildren(root); // at once, complete: the table is laid out only here
  if (onPage) {
    follow();
    addEventListener("hashchange", follow);
  }
  model.on("change:data", build);
  return () => model.off("change:data", build);
}

export default { render };
