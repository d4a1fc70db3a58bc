"""What every benchmark prints: its bars as a table, or with `--json` as one object.

{"bars": [{"name", "value", "unit", "bound", "holds"}], "machine": {...}}
"""

from __future__ import annotations

import json as json_format
import math
import os
import platform
from dataclasses import dataclass
from importlib import metadata


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A number and what it has to be."""

    name: str
    value: float
    unit: str = ""
    sense: str = ""
    """`>=` or `<=`; empty for a number that is only reported."""
    bound: float | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the value is within the bound; None without one. A value that is not finite never is."""
        if self.bound is None:
            return None
        if not math.isfinite(self.value):
            return False
        return self.value >= self.bound if self.sense == ">=" else self.value <= self.bound

    def to_dict(self) -> dict:
        value = self.value if math.isfinite(self.value) else None
        bound = None if self.bound is None else f"{self.sense} {self.bound:g}"
        return {"name": self.name, "value": value, "unit": self.unit, "bound": bound, "holds": self.holds}


def machine() -> dict[str, str | int]:
    """What the numbers were measured on."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "python": platform.python_version(),
        "numpy": metadata.version("numpy"),
    }


def report(bars: list[Bar], *, machine: dict[str, str | int], json: bool) -> bool:
    """Print the bars; whether all that have a bound hold."""
    if json:
        print(json_format.dumps({"bars": [bar.to_dict() for bar in bars], "machine": machine}, allow_nan=False))
    else:
        _print_table(bars, machine)
    return all(bar.holds is not False for bar in bars)


def _print_table(bars: list[Bar], machine: dict[str, str | int]) -> None:
    rows = [("", "value", "unit", "bound", "")]
    for bar in bars:
        bound = "" if bar.bound is None else f"{bar.sense} {bar.bound:g}"
        verdict = {None: "", True: "holds", False: "FAILS"}[bar.holds]
        rows.append((bar.name, f"{bar.value:.4g}", bar.unit, bound, verdict))
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    for name, value, unit, bound, verdict in rows:
        line = f"{name:<{widths[0]}}  {value:>{widths[1]}}  {unit:<{widths[2]}}  {bound:<{widths[3]}}  {verdict}"
        print(line.rstrip())
    print("; ".join(f"{name} {value}" for name, value in machine.items()))


def _processor() -> str:
    """The processor's name where the system tells it."""
    try:
        with open("/proc/cpuinfo") as stream:  # noqa: PTH123, no file of ours
            names = [line.partition(":")[2].strip() for line in stream if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown"
