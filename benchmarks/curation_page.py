"""Time of the curator's page with 5,000 clips: first screen, scrolling, filtering, thumbnails.

    dagster asset materialize --select expert_db
    python benchmarks/curation_page.py [--clips 5000] [--json]

The clips are copies of the project's own clips under other names, each a millisecond shorter than the previous one, so
that no two share a thumbnail. A headless Chromium opens the page; times are the browser's own, from the action to the
second frame after it, when the change is on the screen. Needs Playwright and Chromium.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import Entry, Judged, Manifest, Store  # noqa: E402
from pipeline.curation_page.clip_table import LAST, STAGES  # noqa: E402
from pipeline.feasibility import criteria_table  # noqa: E402

FIRST_SCREEN_S, REACTION_MS = 2.0, 100.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FIGURE = "foot_slip_p95"
DRAWN = """async () => {
  while (document.querySelectorAll('.card:not([hidden]) canvas[data-drawn]').length < 6)
    await new Promise(requestAnimationFrame);
}"""

TIMED = """async ([action, count]) => {
  const frame = () => new Promise(requestAnimationFrame);
  const grid = document.querySelector('.grid'), search = document.querySelector('input[type=search]');
  const set = (element, value, event) => {
    element.value = value;
    element.dispatchEvent(new Event(event, {bubbles: true}));
  };
  const select = (name) => document.querySelector(`select[name=${name}]`);
  const actions = {
    scroll: (n) => { grid.scrollTop = ((n * 7919) % 1000) / 1000 * (grid.scrollHeight - grid.clientHeight); },
    search: (n) => set(search, ['walk', 'walk mirror', '', 'copy3', 'run x0.9'][n % 5], 'input'),
    facet: (n) => set(select('skill'), String(n % select('skill').options.length), 'change'),
    sort: (n) => { document.querySelectorAll('.figure .title button')[n % 20].click(); },
  };
  const times = [];
  for (let n = 0; n < count; n += 1) {
    await frame();
    const start = performance.now();
    actions[action](n);
    const script = performance.now() - start;
    await frame(); await frame();
    times.push([performance.now() - start, script]);
    if (action === 'facet') set(select('skill'), '', 'change');
  }
  set(search, '', 'input');
  return times;
}"""


def main() -> int:
    """Print the times; 0 when all thresholds are met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=5000)
    parser.add_argument("--json", action="store_true")
    parsed = parser.parse_args()
    if not (ROOT / "data/store/manifests" / f"{LAST}.json").is_file():
        print("run first: dagster asset materialize --select expert_db", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(prefix="curation_page_") as folder:
        count = write_project(Path(folder), parsed.clips)
        bars = measure(Path(folder), count)
    return 0 if report(bars, machine=machine(), json=parsed.json) else 1


def write_project(folder: Path, clips: int) -> int:
    """Write a project with at least `count` clips; return their number."""
    (folder / "data").mkdir()
    for name in ("curation.yaml", "feedback_rules.yaml", "feasibility.yaml"):
        shutil.copy2(ROOT / "data" / name, folder / "data" / name)
    shutil.copytree(ROOT / "robots", folder / "robots")
    store, here = Store(root=folder / "data/store"), Store(root=ROOT / "data/store")
    shutil.copytree(here.root / "blobs", store.root / "blobs", copy_function=os.link)
    own = {stage: here.load(stage) for stage in STAGES}
    copies = -(-clips // len(own[LAST].judged))
    for stage, manifest in own.items():
        store.save(stage, _copied(manifest, copies))
    table = criteria_table.read(criteria_table.path_beside(here.manifest_path(LAST)), here.manifest_path(LAST))
    tables = [table.assign(clip=[_name(clip, copy) for clip in table["clip"]]) for copy in range(copies)]
    criteria_table.write(criteria_table.path_beside(store.manifest_path(LAST)), pd.concat(tables), store.load(LAST))
    return copies * len(own[LAST].judged)


def _copied(manifest: Manifest, copies: int) -> Manifest:
    entries, judged = [], []
    for copy in range(copies):
        entries += [_entry(each, copy) for each in manifest.entries]
        judged += [_row(each, copy) for each in manifest.judged]
    return dataclasses.replace(manifest, entries=tuple(entries), judged=tuple(judged))


def _entry(entry: Entry, copy: int) -> Entry:
    return dataclasses.replace(entry, clip=_name(entry.clip, copy), numbers=_numbers(entry.numbers, copy))


def _row(row: Judged, copy: int) -> Judged:
    pieces = tuple(_name(piece, copy) for piece in row.pieces)
    return dataclasses.replace(row, clip=_name(row.clip, copy), pieces=pieces, numbers=_numbers(row.numbers, copy))


def _numbers(numbers: Mapping[str, Any], copy: int) -> dict[str, Any]:
    found = dict(numbers)
    for name in ("parent", "reference", "family"):
        if found.get(name):
            found[name] = _name(str(found[name]), copy)
    if found.get("seconds"):
        found["seconds"] = float(found["seconds"]) - 0.001 * copy
    return found


def _name(clip: str, copy: int) -> str:
    return f"copy{copy}/{clip.partition('/')[2]}"


def measure(folder: Path, count: int) -> list[Bar]:
    """Times of the server and of the page."""
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, BROWSERS)))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}
    start = time.perf_counter()
    server = subprocess.Popen(
        ["booster-lab", "curate", "--no-browser", "--port", "0"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert server.stdout is not None
        url = server.stdout.readline().strip()
        started_s = time.perf_counter() - start
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
            first_s, _ = first_screen(browser, url)
            made_s = wait_for_thumbnails(url, start)
            again_s, page = first_screen(browser, url)
            page.click(f"[data-figure='{FIGURE}'] button")
            times = {
                name: page.evaluate(TIMED, [name, repeats])
                for name, repeats in (("scroll", 200), ("search", 25), ("facet", 22), ("sort", 20))
            }
            browser.close()
    finally:
        os.killpg(server.pid, signal.SIGINT)
        server.wait(timeout=30)
    thumbnails = list((folder / "data/store/thumbnails").rglob("*.bin"))
    size_mb = sum(each.stat().st_size for each in thumbnails) / 1e6
    return [
        Bar(name="clips", value=count, sense=">=", bound=5000),
        Bar(name="start of the server", value=started_s, unit="s"),
        Bar(name="first screen, while thumbnails are made", value=first_s, unit="s", sense="<=", bound=FIRST_SCREEN_S),
        Bar(name="first screen, thumbnails there", value=again_s, unit="s", sense="<=", bound=FIRST_SCREEN_S),
        Bar(name="all thumbnails made", value=made_s, unit="s"),
        Bar(name="thumbnails on the disk", value=size_mb, unit="MB"),
        *(bar for name, found in times.items() for bar in _bars(name, np.array(found))),
    ]


def _bars(name: str, times: np.ndarray) -> list[Bar]:
    """Bars of an action: time to the frame that shows it, and time of the page's script.

    Args:
        times: both times of each action, one row per action [ms]
    """
    shown, script = times.T
    return [
        Bar(name=f"{name}, median", value=float(np.median(shown)), unit="ms"),
        Bar(
            name=f"{name}, 95th percentile",
            value=float(np.percentile(shown, 95)),
            unit="ms",
            sense="<=",
            bound=REACTION_MS,
        ),
        Bar(name=f"{name}, script, 95th percentile", value=float(np.percentile(script, 95)), unit="ms"),
    ]


def first_screen(browser: Any, url: str) -> tuple[float, Any]:
    """Time from opening the page to cards with thumbnails [s], and the page."""
    page = browser.new_page(viewport={"width": 1360, "height": 820})
    start = time.perf_counter()
    page.goto(url)
    page.evaluate(DRAWN)
    return time.perf_counter() - start, page


def wait_for_thumbnails(url: str, start: float) -> float:
    """Time from `start` until all thumbnails are loaded [s]."""
    while True:
        with urllib.request.urlopen(f"{url.partition('#')[0]}api/state") as answer:
            state = json.load(answer)["thumbnails"]
        if state["total"] and state["made"] >= state["total"]:
            return time.perf_counter() - start
        time.sleep(1.0)


if __name__ == "__main__":
    sys.exit(main())
