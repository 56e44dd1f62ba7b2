"""Fill the form of the rerun page as a reader does, and read what it says."""

import re

# Messages by parameter, status, commands.
FILL = """all => {
  const root = document.querySelector('.tl-rerun'), said = node => node.textContent;
  const happen = (node, ...names) =>
    names.forEach(name => node.dispatchEvent(new Event(name, { bubbles: true })));
  return all.map(([set, texts]) => {
    root.querySelector('.tl-rerun-head button').click();
    const chooser = root.querySelector('.tl-rerun-head select');
    chooser.value = set;
    happen(chooser, 'input', 'change');
    for (const [name, text] of Object.entries(texts)) {
      const row = root.querySelector(`[data-parameter="${name}"]`);
      const boxes = [...row.querySelectorAll('[type=checkbox]')];
      const box = boxes.length ? null : row.querySelector('input, select, textarea');
      if (box) box.value = text;
      const named = boxes[0]?.value[0] === '"';
      const held = box ? [] : [text].flat().flatMap(
        one => named ? one : JSON.parse(`[${one}]`).flat());
      boxes.forEach(one => { one.checked = held.includes(JSON.parse(one.value)); });
      happen(box ?? boxes[0], 'input', 'change');
    }
    const rows = [...root.querySelectorAll('[data-parameter]')];
    const shown = !root.querySelector('.tl-rerun-output').hidden;
    return {
      problems: Object.fromEntries(rows.map(row => [row.dataset.parameter,
        said(row.querySelector('.tl-rerun-problem'))]).filter(([, words]) => words)),
      invalid: rows.filter(row => row.querySelector('[aria-invalid=true]'))
        .map(row => row.dataset.parameter),
      status: said(root.querySelector('.tl-rerun-status')),
      commands: shown ? [...root.querySelectorAll('pre code')].map(said) : [],
    };
  });
}"""


def as_in_page(line):
    """A refusal as a page has it, which writes whole numbers without a point."""
    return re.sub(r"(?<=\d)\.0\b", "", line)


def fill(opened, *all_):
    return opened.page.evaluate(FILL, [list(one) for one in all_])
