"""A headless Chromium, hostile texts, and a listener that notes what the texts' scripts ask it for."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL without a GPU; only pages of this machine are opened."""
WAIT_S = 30.0


@contextmanager
def chromium() -> Iterator:
    """A browser of Playwright; skips the test where Playwright or Chromium is not installed."""
    api = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install playwright")
    installed = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if installed is None:
        pytest.skip(f"needs a browser: one of {', '.join(CHROMIUM)} on the PATH")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=installed, args=list(OPTIONS))
        try:
            yield browser
        finally:
            browser.close()


class Listener:
    """A web server on 127.0.0.1 that notes the paths that it is asked for."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        listener = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                listener.asked.append(self.path)
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                """Nothing is printed."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self._server.server_port}"

    def hostile(self, mark: str) -> str:
        """A file name that asks the listener for `/<mark>...` where it is taken for HTML, in two ways."""
        url = f"http:&#47;&#47;{self.address}&#47;{mark}"
        image = f"<img src=x onerror='fetch(&quot;{url}-image&quot;)'>"
        return f"{image}<iframe srcdoc='&lt;script&gt;fetch(&quot;{url}-script&quot;)&lt;&#47;script&gt;'>"

    def waits_for(self, mark: str, seconds: float) -> bool:
        """Whether it is asked for something with the mark within a time."""
        stop = time.monotonic() + seconds
        while time.monotonic() < stop:
            if any(mark in path for path in self.asked):
                return True
            time.sleep(0.1)
        return False

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@contextmanager
def listening() -> Iterator[Listener]:
    """A listener that ends with the block."""
    listener = Listener()
    try:
        yield listener
    finally:
        listener.close()
