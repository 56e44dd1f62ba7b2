"""Debian's browsers beside Chromium: Firefox by WebDriver BiDi, WebKit by WebDriver.

Both reach no network, and write down what pages ask of one and what stands in their consoles.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Coroutine, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Protocol, TypeVar

from tornado.websocket import WebSocketClientConnection, websocket_connect

T = TypeVar("T")
PATIENCE = 120  # seconds; other jobs may have the machine
MINIBROWSER = Path("/usr/lib")  # where Debian has it, below the architecture's folder
PREFERENCES = {
    "network.proxy.type": 0,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "ui.prefersReducedMotion": 1,
}


class Other(Protocol):
    """A browser with one window."""

    def open(self, address: str) -> None:
        """Go there, and wait until all is loaded."""

    def evaluate(self, body: str) -> Any:
        """What the body of a function returns in the page; a promise is waited for."""

    def told(self) -> list[str]:
        """What was asked of the network, and all messages, since this was last called."""


def absent(name: str) -> str:
    """Why there is no such browser; empty if there is one."""
    needed = {"firefox": ["firefox-esr"], "webkit": ["WebKitWebDriver", "Xvfb"]}[name]
    missing = [one for one in needed if shutil.which(one) is None]
    if name == "webkit" and not missing and minibrowser() is None:
        missing = ["MiniBrowser"]
    return f"no {name}: {', '.join(missing)} is not installed" if missing else ""


def minibrowser() -> Path | None:
    """WebKit's own small browser, which the driver comes with."""
    return next(iter(sorted(MINIBROWSER.glob("*/webkit2gtk-*/MiniBrowser"), reverse=True)), None)


# --- Firefox


class Firefox:
    """A window of Firefox at the other end of a socket."""

    def __init__(self, address: str) -> None:
        self.loop = asyncio.new_event_loop()  # in a thread: this one may have another running
        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self.thread.start()
        self.events: list[dict[str, Any]] = []
        self.number = 0
        self.socket = self._done(self._connected(f"{address}/session"))
        self.send("session.new", capabilities={})
        self.send("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self.context = self.send("browsingContext.getTree")["contexts"][0]["context"]

    async def _connected(self, address: str) -> WebSocketClientConnection:
        return await websocket_connect(address, max_message_size=2**28)

    def send(self, method: str, **parameters: Any) -> Any:
        self.number += 1
        return self._done(self._answer(self.number, method, parameters))

    def _done(self, waiting: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(waiting, self.loop).result(2 * PATIENCE)

    async def _answer(self, number: int, method: str, parameters: dict[str, Any]) -> Any:
        message = {"id": number, "method": method, "params": parameters}
        await self.socket.write_message(json.dumps(message))
        while True:
            text = await asyncio.wait_for(self.socket.read_message(), PATIENCE)
            assert text is not None, "Firefox has gone"
            told = json.loads(text)
            if told.get("type") == "event":
                self.events.append(told)
            elif told.get("id") == number:
                assert told["type"] == "success", told
                return told["result"]

    def open(self, address: str) -> None:
        self.send("browsingContext.navigate", context=self.context, url=address, wait="complete")

    def evaluate(self, body: str) -> Any:
        found = self.send(
            "script.evaluate",
            expression=f"(async () => JSON.stringify(await (async () => {{ {body} }})()))()",
            target={"context": self.context},
            awaitPromise=True,
        )
        assert found["type"] == "success", found
        return json.loads(found["result"].get("value", "null"))

    def told(self) -> list[str]:
        self.send("session.status")  # what happened before has been told by then
        events, self.events = self.events, []
        found = []
        for one in events:
            if one["method"] == "log.entryAdded":
                found.append(f"console: {one['params']['text']}")
            elif re.match(r"(https?|wss?):", address := one["params"]["request"]["url"]):
                found.append(f"request: {address}")
        return found

    def close(self) -> None:
        self.loop.call_soon_threadsafe(self.socket.close)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(PATIENCE)


@contextmanager
def firefox() -> Iterator[Firefox]:
    """A headless Firefox with a new profile for as long as the context lasts."""
    with tempfile.TemporaryDirectory(prefix="firefox-") as profile:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items()]
        Path(profile, "user.js").write_text("\n".join(lines), encoding="utf-8")
        command = ["firefox-esr", "--headless", "--no-remote", "--profile", profile]
        process = subprocess.Popen(
            [*command, "--remote-debugging-port=0", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stderr is not None
            heard = (re.search(r"BiDi listening on (ws://\S+)", line) for line in process.stderr)
            address = next(one[1] for one in heard if one)
            threading.Thread(target=process.stderr.read, daemon=True).start()
            running = Firefox(address)
            try:
                yield running
            finally:
                running.close()
        finally:
            process.terminate()
            process.wait(timeout=PATIENCE)


# --- WebKit, whose driver does not tell what stands in the console: pages note it themselves

NOTES = """<head><script>
var told = [];
for (const kind of ["error", "warn", "log", "info", "debug"]) {
  const say = console[kind];
  console[kind] = (...words) => { told.push(words.join(" ")); say.apply(console, words); };
}
addEventListener("error", (event) => {
  told.push(event.message ?? `missing: ${event.target.src}`);
}, true);
addEventListener("unhandledrejection", (event) => told.push(String(event.reason)));
</script>"""


def noting(book: Path, beside: Path, pages: Iterable[str]) -> None:
    """Put pages that note their messages into a new folder, beside all else that the book has."""
    for page in pages:
        folder = (beside / page).parent
        folder.mkdir(parents=True, exist_ok=True)
        for one in (book / page).parent.iterdir():
            if one.suffix != ".html" and not (folder / one.name).exists():
                (folder / one.name).symlink_to(one.resolve())
        text = (book / page).read_text(encoding="utf-8")
        (beside / page).write_text(re.sub("<head>", lambda _: NOTES, text, count=1), "utf-8")


class WebKit:
    """A window of WebKit's own small browser."""

    def __init__(self, driver: str, session: dict[str, Any], asked: list[str]) -> None:
        self.asked = asked
        self.address = f"{driver}/session/{ask(f'{driver}/session', session)['sessionId']}"

    def open(self, address: str) -> None:
        ask(f"{self.address}/url", {"url": address})

    def evaluate(self, body: str) -> Any:
        script = f"const done = arguments[0]; (async () => {{ {body} }})().then(done)"
        return ask(f"{self.address}/execute/async", {"script": script, "args": []})

    def told(self) -> list[str]:
        asked, self.asked[:] = [*self.asked], []
        console = self.evaluate("const all = told; told = []; return all")
        return asked + [f"console: {one}" for one in console]

    def close(self) -> None:
        ask(self.address, method="DELETE")


def ask(address: str, body: Any = None, method: str | None = None) -> Any:
    """The value that a driver answers with."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address, data=data, method=method)
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        return json.load(answer)["value"]


@contextmanager
def webkit() -> Iterator[WebKit]:
    """WebKit on a screen of its own for as long as the context lasts.

    It is told to ask a proxy on this machine, which refuses, and writes down what it was asked.
    """
    with ExitStack() as after:
        folder = Path(after.enter_context(tempfile.TemporaryDirectory(prefix="webkit-")))
        asked: list[str] = []
        proxy = after.enter_context(_refusing(asked))
        screen = after.enter_context(_running(["Xvfb", "-displayfd", "1", "-nolisten", "tcp"]))
        assert screen.stdout is not None
        display = screen.stdout.readline().decode().strip()
        port = _free_port()
        environment = os.environ | {
            "DISPLAY": f":{display}",
            "HOME": str(folder),
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "GTK_A11Y": "none",
        }
        driver = [shutil.which("WebKitWebDriver") or "", f"--port={port}"]
        after.enter_context(_running(driver, env=environment, stdout=subprocess.DEVNULL))
        _until(lambda: _open(port))
        wanted = {
            "webkitgtk:browserOptions": {"binary": str(minibrowser()), "args": ["--automation"]},
            "proxy": {"proxyType": "manual", "httpProxy": proxy, "sslProxy": proxy},
            "timeouts": {"script": 1000 * PATIENCE},
        }
        session = {"capabilities": {"alwaysMatch": wanted}}
        running = WebKit(f"http://127.0.0.1:{port}", session, asked)
        after.callback(running.close)
        yield running


@contextmanager
def _running(command: list[str], **options: Any) -> Iterator[subprocess.Popen[bytes]]:
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, **(quiet | options))
    try:
        yield process
    finally:
        process.terminate()
        process.wait(timeout=PATIENCE)


@contextmanager
def _refusing(asked: list[str]) -> Iterator[str]:
    """A proxy that lets nothing through, and writes down what it was asked for."""

    class Refusing(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(f"request: {self.path}")
            self.send_error(403)

        do_CONNECT = do_POST = do_HEAD = do_GET  # noqa: N815

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Refusing) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"127.0.0.1:{running.server_address[1]}"
        finally:
            running.shutdown()
            thread.join()


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def _open(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "nothing came of it"
        time.sleep(0.1)
