"""Open a local page in a real browser without a network, and write down what it tried."""

import os
import re
import shutil
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from weakref import WeakKeyDictionary

LOCAL = ("file:", "data:", "blob:", "about:")
FLAGS = ["--disable-gpu", "--disable-quic"]  # besides those that Playwright gives by itself


def write_page(file, *fragments):
    """Write fragments of HTML, or widgets as a page shows them, as a page, and return its file."""
    head = (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Page</title>'
        '<meta name="viewport" content="width=device-width">'
    )
    texts = [
        one if isinstance(one, str) else one._repr_mimebundle_()[0]["text/html"]
        for one in fragments
    ]
    file.write_text(f"{head}<body>{''.join(texts)}", encoding="utf-8")
    return file


def find_browser():
    """Path of Chromium or Chrome on this machine, or None."""
    own = os.environ.get("CHROME_BIN", "chromium")
    names = (own, "chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if (path := shutil.which(name))), None)


@contextmanager
def browser():
    """A headless browser for as long as the context lasts."""
    from playwright.sync_api import sync_playwright  # others read this file without the package

    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=find_browser(), args=FLAGS)
        try:
            yield running
        finally:
            running.close()


@dataclass
class Opened:
    """A page, and what went wrong while it was opened and used."""

    page: Any  # of playwright
    external: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    console: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)  # in the console, without being an error

    @property
    def trouble(self):
        """Requests beyond this machine, failed requests, console errors and page errors."""
        return [*self.external, *self.failed, *self.console]

    def sideways_px(self):
        """How far the page itself scrolls sideways."""
        return self.page.evaluate("""() => {
            const e = document.scrollingElement;
            return Math.max(e.scrollWidth, document.body.scrollWidth) - innerWidth; }""")


@contextmanager
def server(folder):
    """Serve a folder on this machine alone, for as long as the context lasts."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = partial(Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{running.server_address[1]}"
        finally:
            running.shutdown()
            thread.join()


FOCUSED = """name => { const e = document.activeElement, style = getComputedStyle(e);
  const ring = getComputedStyle(e.querySelector('circle') ?? e);
  const after = e.type === 'radio' && getComputedStyle(e.nextElementSibling).boxShadow;
  const outlined = style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2;
  if (!outlined && ring.stroke === 'none' && (after || 'none') === 'none') return 'no outline';
  return e.closest('[data-parameter]')?.dataset.parameter ?? e.getAttribute('aria-label') ??
    e.closest('fieldset')?.querySelector('legend').innerText ??
    (e.labels?.[0] ?? e).innerText.split('\\n')[0]; }"""


def focused(opened):
    """Name of what has the focus, or that it is not seen to have it."""
    return opened.page.evaluate(FOCUSED)


def tab_through(opened, times):
    """Names of what gets the focus when Tab is pressed."""
    seen = []
    for _ in range(times):
        opened.page.keyboard.press("Tab")
        seen.append(focused(opened))
    return seen


@contextmanager
def open_offline(
    running, path, width=1280, height=900, dark=False, query="", served="", fresh=False, still=True
):
    """Open the file `path` with no network, and wait until it and its equations are there.

    With `served`, the address at which a server on this machine has the file, only that server is
    reached. A window that was left in order is used again, since a new one takes half a second;
    `fresh` wants one that has seen nothing yet. Nothing moves by itself unless it is not `still`.
    There must have been no trouble when the page is left.
    """
    server = re.match(r"http://127\.0\.0\.1:\d+/", served)
    kind = (width < 600, server[0] if server else "")
    windows = _WINDOWS.setdefault(running, {})
    opened = None if fresh else windows.pop(kind, None)
    opened = opened or _window(running, *kind)
    page = opened.page
    in_order = False
    try:
        page.set_viewport_size({"width": width, "height": height})
        motion = "reduce" if still else "no-preference"
        page.emulate_media(color_scheme="dark" if dark else "light", reduced_motion=motion)
        address = served or path.resolve().as_uri()
        page.goto(address + (f"?{query}" if query else ""), wait_until="load")
        page.wait_for_function("() => !document.querySelector('meta[http-equiv=Refresh]')")
        page.wait_for_load_state("load")
        page.evaluate("() => window.MathJax?.startup?.promise")
        page.wait_for_timeout(100)
        yield opened
        assert opened.trouble == [], opened.trouble
        in_order = not fresh and kind not in windows
    finally:
        if in_order:
            windows[kind] = _emptied(opened)
        else:
            page.context.close()


_WINDOWS = WeakKeyDictionary()
"""Windows that may be used again, by whether they have a touch screen and by their server."""


def _window(running, touch, server):
    """A window that reaches nothing, or one server on this machine, and what it tried."""
    local = (*LOCAL, server) if server else LOCAL
    context = running.new_context(offline=not server, has_touch=touch)
    if server:
        context.route(lambda url: not url.startswith(local), lambda route: route.abort())
    opened = Opened(context.new_page())

    def on_request(request):
        if not request.url.startswith(local):
            opened.external.append(f"external request: {request.url}")

    def on_message(message):
        told = opened.console if message.type == "error" else opened.said
        told.append(f"console: {message.text}")

    def on_response(response):
        if response.status >= 400:
            opened.failed.append(f"{response.status}: {response.url}")

    def on_failure(request):
        if request.failure != "net::ERR_ABORTED":  # as when its page is left
            opened.failed.append(f"failed: {request.url}: {request.failure}")

    page = opened.page
    page.on("request", on_request)
    page.on("requestfailed", on_failure)
    page.on("console", on_message)
    page.on("response", on_response)
    page.on("pageerror", lambda error: opened.console.append(f"page error: {error}"))
    return opened


def _emptied(opened):
    """A window as it was before it was used."""
    page = opened.page
    page.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
    page.goto("about:blank")
    page.mouse.move(0, 0)
    page.emulate_media(media="null", reduced_motion="null")
    page.context.clear_permissions()
    for told in (opened.external, opened.failed, opened.console, opened.said):
        told.clear()
    return opened
