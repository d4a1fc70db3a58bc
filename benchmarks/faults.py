"""Mutated inputs of every kind, each read in a separate process: refused, silently wrong, crashed, or out of memory.

    python benchmarks/faults.py [--only motions logs settings policies] [--seed 37] [--json] [--list]

500 motion files, 300 logs, 200 settings files and robot tables, 200 policies, golden vectors, ONNX and TorchScript
files, cards and checkpoints. A result is `silent wrong` where the file itself contradicts a value that was read from
it: by its counts, rows, checksums, digests, velocities, link poses or examples, or by a number whose text did not
change (tests/factories/campaign_*.py). `crashed` is a traceback, a warning, a wrong exit code, a message that is not
a sentence, or a killed process; `capped` took more memory than 1 GB or 200 MB and four times the file's size.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # a library's threads do not survive a fork
ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from tests.factories.campaign import CAPPED, CRASHED, REFUSED, RIGHT, WRONG, run_isolated  # noqa: E402
from tests.factories.campaign_logs import log_cases  # noqa: E402
from tests.factories.campaign_motions import motion_cases  # noqa: E402
from tests.factories.campaign_policies import policy_cases  # noqa: E402
from tests.factories.campaign_settings import settings_cases  # noqa: E402

SEED = 37
KINDS = {
    "motions": (motion_cases, 500),
    "logs": (log_cases, 300),
    "settings": (settings_cases, 200),
    "policies": (policy_cases, 200),
}
"""Kind of input -> its mutations and their number."""
SURPLUS = 1.2
"""Mutations drawn per required one: those that do not change the file are discarded."""


def bars_of(kind: str, count: int, seed: int, listed: bool) -> list[Bar]:
    """Count the results of a kind; with `listed`, print every case that is neither right nor refused to stderr."""
    cases, counts, peak_mb, start_s = KINDS[kind][0], Counter(), 0.0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        drawn = count if kind == "logs" else round(SURPLUS * count)
        for case, _ in zip(cases(seed, drawn, Path(folder)), range(count), strict=False):
            verdict = run_isolated(case)
            counts[verdict.kind] += 1
            peak_mb = max(peak_mb, verdict.peak_mb)
            if listed and verdict.kind not in (RIGHT, REFUSED):
                print(f"{case.name}: {verdict.kind}: {verdict.text}", file=sys.stderr)
    zero = {"unit": "files", "sense": "<=", "bound": 0.0}
    return [
        Bar(name=f"{kind}: mutated", value=float(counts.total()), unit="files", sense=">=", bound=float(count)),
        Bar(name=f"{kind}: right", value=float(counts[RIGHT]), unit="files"),
        Bar(name=f"{kind}: refused", value=float(counts[REFUSED]), unit="files"),
        Bar(name=f"{kind}: silent wrong", value=float(counts[WRONG]), **zero),
        Bar(name=f"{kind}: crashed", value=float(counts[CRASHED]), **zero),
        Bar(name=f"{kind}: capped", value=float(counts[CAPPED]), **zero),
        Bar(name=f"{kind}: memory of the largest process", value=peak_mb, unit="MB"),
        Bar(name=f"{kind}: time", value=time.monotonic() - start_s, unit="s"),
    ]


def main() -> int:
    """Print the table; 0 when all bars hold."""
    parser = argparse.ArgumentParser(description="Mutated motions, logs, settings and policies.")
    parser.add_argument("--only", nargs="+", choices=KINDS, default=list(KINDS), help="kinds of input")
    parser.add_argument("--seed", type=int, default=SEED, help="of the mutations")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--list", action="store_true", help="print each fault to standard error")
    arguments = parser.parse_args()
    bars = [bar for kind in arguments.only for bar in bars_of(kind, KINDS[kind][1], arguments.seed, arguments.list)]
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


if __name__ == "__main__":
    sys.exit(main())
