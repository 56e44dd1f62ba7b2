// The search: MiniSearch reads the entries of all pages when the search is first opened.
(() => {
  const { root, load, element, closes } = window.thesisBook;
  const dialog = document.getElementById("pst-search-dialog");
  const input = dialog?.querySelector("input[name=q]");
  if (!input) return;

  const SHORT = { eq: "equation", eqs: "equation", eqn: "equation", fig: "figure", figs: "figure", tab: "table", sec: "section", ch: "chapter" };
  const ENDING = /(?:ations?|ingly|edly|ings?|ions?|ments?|ers?|ies|ied|ed|es|ly|e|s|y)$/;
  const KINDS = { section: "text", figure: "figure", equation: "equation", name: "library", term: "word", source: "source", claim: "claim", thesis: "thesis" };
  const WEIGHT = { section: 1.2, figure: 1.3, equation: 1.2, term: 1.5, thesis: 1.3, name: 0.5, source: 1, claim: 0.4 };
  // Prose and figures come first, then tables of tests and claims, then the library, unless its name is searched for.
  const behind = (one, query) => /[._]/.test(query) && one.title.endsWith(query.trim()) ? 0 : one.page.startsWith("api/") ? 2 : one.kind === "claim" || /^(developers|benchmarks)\./.test(one.page) ? 1 : 0;
  const MAX_TEXT_LENGTH = 200, MAX_RESULTS = 20, TERMS = 12;
  const MAX_FEW_RESULTS = 2; // results with one typo, up to which those with two are also searched

  // Words, numbers such as 3.24, and names such as focal_px, indexed as a whole and in parts.
  const wholes = (text) => text.match(/[\p{L}\p{N}]+(?:[._'-][\p{L}\p{N}]+)*/gu) ?? [];
  const parts = (word) => (/^[\d.]+$/.test(word) ? [] : word.split(/[._-]/).filter((part) => part !== word));
  const words = (text) => wholes(text).flatMap((word) => [...new Set([word, ...word.split("."), ...parts(word)])]);
  const asked = (text) => wholes(text.slice(0, MAX_TEXT_LENGTH)).slice(0, TERMS).map((word) => (parts(word).length
    ? { combineWith: "OR", queries: [word, { combineWith: "AND", queries: parts(word) }] } : word));
  const lower = (word) => SHORT[word.toLowerCase()] ?? word.toLowerCase();
  const stem = (word) => {
    const low = lower(word);
    if (!/^\p{L}{5,}$/u.test(low)) return low;
    const cut = low.replace(ENDING, "");
    return cut.length < 4 ? low.replace(/s$/, "") : cut;
  };
  const typed = (term) => /^\p{L}{4,}$/u.test(term);

  let finder = null;
  const ready = () => (finder ??= Promise.all([
    window.thesisBook.entries(), load("_static/minisearch/index.js"),
  ]).then(async ([all]) => {
    const pages = new Map();
    const entries = all.map((entry, id) => {
      const first = !pages.has(entry.page);
      if (first) pages.set(entry.page, entry.title);
      return { ...entry, id, first, place: entry.places[0] ?? "", of: pages.get(entry.page) };
    });
    const index = new MiniSearch({
      fields: ["title", "of", "text"], tokenize: words,
      processTerm: (word) => [...new Set([stem(word), lower(word)])],
      searchOptions: {
        tokenize: (word) => [word], prefix: typed, boost: { title: 4, of: 2 },
        boostDocument: (id) => WEIGHT[entries[id].kind] * (entries[id].first ? 1.5 : 1),
      },
    });
    await index.addAllAsync(entries, { chunkSize: 200 });
    return { index, entries };
  }));

  const find = ({ index, entries }, query) => {
    const queries = asked(query);
    const shown = (found) => found.map((one) => ({ ...entries[one.id], terms: one.terms })).sort((a, b) => behind(a, query) - behind(b, query));
    for (const typos of [0, 1, 2]) { // two swapped letters count as two
      const fuzzy = typos && ((term) => (typed(term) && term.length > 2 + typos ? typos : false));
      const found = index.search({ combineWith: "AND", queries }, { fuzzy, processTerm: typos ? lower : stem });
      if (found.length > (typos === 1 ? MAX_FEW_RESULTS : 0)) return { found: shown(found) };
    }
    const some = index.search({ combineWith: "OR", queries }, { processTerm: stem }); // results with most of the words come first
    const most = Math.max(0, ...some.map((one) => new Set(one.queryTerms).size));
    return { found: shown(some.filter((one) => new Set(one.queryTerms).size === most)), partly: true };
  };

  // The part of a text around the first match, with all matches marked.
  const plain = (text) => text.replace(/\\[()[\]]/g, "").replace(/\\(?:mathbf|mathrm|tfrac|frac|text)?\{?([A-Za-z]*)\}?/g, "$1");
  const snippet = (text, terms) => {
    const whole = plain(text), any = terms.map((term) => term.replaceAll(".", "\\.")).join("|");
    const pattern = new RegExp(`((?<![\\p{L}\\p{N}])(?:${any})[\\p{L}]*)`, "giu");
    const at = Math.max(0, whole.search(pattern));
    const from = at < 80 ? 0 : whole.indexOf(" ", at - 60) + 1, to = from + 190;
    const parts = whole.slice(from, to).split(pattern); // every second one is a match
    return element("span", {}, from ? "… " : "",
      ...parts.map((part, i) => (i % 2 ? element("mark", {}, part) : part)),
      whole.length > to ? " …" : "");
  };
  const result = ({ title, text, terms, page, place, first, kind, of }) => {
    const href = root + page + (place && !first ? `#${place}` : "");
    return element("li", {}, element("a", { className: "tl-found", href },
      element("span", "tl-found-title", snippet(title, terms)),
      element("span", "tl-found-where", KINDS[kind] + (first ? "" : ` · ${of}`)),
      element("span", "tl-found-text", snippet(text, terms))));
  };

  const list = element("ul", { className: "tl-results", hidden: true,
    onclick: (event) => event.target.closest("a") && dialog.close() });
  const status = element("p", { className: "tl-results-status", role: "status" });
  dialog.append(status, list);
  closes(dialog);
  input.maxLength = MAX_TEXT_LENGTH;
  const show = async () => {
    const book = await ready().catch(() => null), query = input.value;
    const { found, partly } = book ? find(book, query) : { found: [] };
    list.replaceChildren(...found.slice(0, MAX_RESULTS).map(result));
    list.hidden = !found.length;
    const count = `${found.length} place${found.length === 1 ? "" : "s"}.`;
    const many = found.length > MAX_RESULTS ? `The best ${MAX_RESULTS} of ${count}` : count;
    status.textContent = !book ? "The book's index is missing." : !query.trim() ? ""
      : !found.length ? "Nothing found."
        : `${partly ? "No place has all of these words. With most of them: " : ""}${many}`;
    list.scrollTop = 0;
  };
  input.addEventListener("focus", () => ready().catch(() => null));
  input.addEventListener("input", show);
  input.form.addEventListener("submit", (event) => {
    event.preventDefault();
    show().then(() => list.querySelector("a")?.click());
  });
  dialog.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    const stops = [input, ...list.querySelectorAll("a")];
    stops[stops.indexOf(document.activeElement) + step]?.focus();
    event.preventDefault();
  });
})();
