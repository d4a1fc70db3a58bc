"""Output of every benchmark: its bars as a table, or with `--json` as one object.

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
    """A number and its bound."""

    name: str
    value: float
    unit: str = ""
    sense: str = ""
    """`>=` or `<=`; empty for a number without a bound."""
    bound: float | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the value is within the bound; None without a bound. A value that is not finite fails."""
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
    """Description of the machine."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "python": platform.python_version(),
        "numpy": metadata.version("numpy"),
    }


def report(bars: list[Bar], *, machine: dict[str, str | int], json: bool) -> bool:
    """Print the bars; return whether all bars with a bound hold."""
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
    """The processor's name, if the system provides it."""
    try:
        with open("/proc/cpuinfo") as stream:  # noqa: PTH123, not a file of this project
            names = [line.partition(":")[2].strip() for line in stream if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown"
