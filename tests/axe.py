"""axe-core, the accessibility checker: installed for the tests alone, and asked about a page."""

from functools import cache
from pathlib import Path

from thesis_lib.book.rendering import install_packages
from thesis_lib.text import FailedError

ROOT = Path(__file__).parents[1]
# What folds is opened at once; of many rows, entries and words of code that are alike, some stand
# for all.
PREPARE = """() => {
  const style = document.createElement('style');
  style.textContent = '* { animation: none !important; transition: none !important; }';
  document.head.append(style);
  for (const one of document.querySelectorAll('details')) one.open = true;
  const most = { SECTION: 8 };
  for (const tag of 'A DD DL DT EM LI P SPAN TBODY TR'.split(' ')) most[tag] = 3;
  for (const parent of document.querySelectorAll('.bd-article, .bd-article *')) {
    const seen = {};
    for (const child of [...parent.children]) {
      const kind = `${child.tagName}.${child.getAttribute('class')}.${child.getAttribute('style')}`;
      seen[kind] = (seen[kind] ?? 0) + 1;
      if (seen[kind] > (most[child.tagName] ?? Infinity)) child.remove();
    }
  }
}"""


@cache
def source():
    """The checker's program, installed from ``package-lock.json`` unless it is there.

    Without npm, or without a network the first time, it raises a `FailedError`.
    """
    parts = {"axe-core": ("LICENSE", "axe.min.js")}
    folder = install_packages(ROOT, ROOT / "build" / "axe", parts)
    return next(folder.rglob("axe.min.js")).read_text(encoding="utf-8")


@cache
def absent():
    """Why there is no checker; empty if there is one."""
    try:
        source()
    except FailedError as error:
        return f"no axe-core: {error}"
    return ""


def findings(page, *rules, without=()):
    """What is wrong with a page, minor or not, one line per element; nothing without the checker.

    All rules are checked if none is named; `without` has selectors of parts to leave out.
    """
    if absent():
        return []
    options = {"resultTypes": ["violations"], "preload": False}
    if rules:
        options["runOnly"] = {"type": "rule", "values": list(rules)}
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(source())
    found = page.evaluate(
        "([without, options]) => axe.run({ exclude: without }, options)",
        [[[one] for one in without], options],
    )
    return [
        f"{rule['id']}: {' '.join(map(str, node['target']))}: {node['html'][:200]}"
        for rule in found["violations"]
        for node in rule["nodes"]
    ]


def light_and_dark(page, *, theme=False, without=()):
    """What is wrong with an open page, by any rule in the light, by contrast in the dark.

    The page is cut short where it repeats itself: nothing else can be asked of it afterwards. With
    `theme`, it has a theme of its own that follows the browser's.
    """
    page.evaluate(PREPARE)
    page.emulate_media(color_scheme="light")
    found = findings(page, without=without)
    page.emulate_media(color_scheme="dark")
    if theme:
        page.wait_for_function(
            "() => document.documentElement.dataset.theme === 'dark'", timeout=120_000
        )
    return found + findings(page, "color-contrast", without=without)
