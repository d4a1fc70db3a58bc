"""A headless Chromium, and the curator's page of a checkout in it."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.curation_page.app import CurationServer
from tests.factories.browser import chromium
from tests.factories.checkout import Checkout

PICTURES_VARIABLE = "BOOSTER_LAB_PICTURES"
"""Folder that the screenshots of the browser tests are written into."""


@contextmanager
def curation_server(checkout: Checkout) -> Iterator[str]:
    """`booster-lab curate` in a checkout; the address that it prints."""
    process = checkout.start("booster-lab", "curate", "--no-browser", "--port", "0")
    try:
        assert process.stdout is not None
        printed = process.stdout.readline()
        match = re.match(r"http://127\.0\.0\.1:\d+/#token=\S+", printed)
        assert match, printed + process.stdout.read()
        yield match[0]
    finally:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)


@contextmanager
def served(folder: Path, port: int = 0, robot: str = "t1") -> Iterator[CurationServer]:
    """The curator's page of a project, served by a thread of this process."""
    server = CurationServer(folder, robot, port)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join()


@dataclass
class Browser:
    """A page in Chromium; everything the console complains about is kept."""

    page: Any
    complaints: list[str] = field(default_factory=list)

    def until(self, condition: str, seconds: float = 30.0) -> None:
        """Wait until a JavaScript expression is true; the page's security policy refuses Playwright's own wait."""
        script = (
            f"async () => {{ const end = performance.now() + {1000 * seconds}; "
            f"while (!({condition})) {{ if (performance.now() > end) throw new Error('never true'); "
            "await new Promise(requestAnimationFrame); } }"
        )
        self.page.evaluate(script)

    def other_tab(self, url: str) -> Browser:
        """Another page of the same browser window, with the same storage."""
        return _opened(self.page.context.new_page(), url)

    def picture(self, name: str) -> None:
        """Write a screenshot into the folder of `BOOSTER_LAB_PICTURES`, if that is set."""
        from PIL import Image

        image = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        assert image.getextrema() != ((255, 255),) * 3, "the page is empty"
        folder = os.environ.get(PICTURES_VARIABLE)
        if folder:
            image.quantize(128, dither=Image.Dither.NONE).save(Path(folder) / f"{name}.png", optimize=True)


@contextmanager
def browser(url: str, **options: Any) -> Iterator[Browser]:
    """A headless Chromium that has opened an address. Skips where it or Playwright is missing.

    Args:
        options: of the browser's context, as Playwright has them
    """
    with chromium() as running:
        context = running.new_context(viewport={"width": 1360, "height": 820}, **options)
        yield _opened(context.new_page(), url)


def _opened(page: Any, url: str) -> Browser:
    found = Browser(page)
    page.on("console", lambda each: each.type in ("error", "warning") and found.complaints.append(each.text))
    page.on("pageerror", lambda error: found.complaints.append(str(error)))
    page.on("dialog", lambda each: found.complaints.append(f"dialog: {each.message}"))
    page.goto(url)
    return found
