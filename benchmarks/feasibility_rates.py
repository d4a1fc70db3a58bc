"""Rates as bars, and the two tables of rollouts: known-good motion and planted faults."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Sequence

import numpy as np

from benchmarks.feasibility_faults import FAULTS, LABELS
from benchmarks.feasibility_judge import NO_LABELS, TOLD_LABELS, WINDOW_S, Judged
from benchmarks.report import Bar
from pipeline.feasibility import criterion
from pipeline.feasibility.criterion import groups

ELSEWHERE = ("tracking stability", "torque", "contact forces", "likeness to the person", "length")
"""Groups of criteria that the walks are not checked against: other tables have them, and no forces are recorded."""

LEAST = 98.0
"""Least share of correct verdicts, for known-good motion and for faults [%]."""


def rate(name: str, values: Sequence[bool | float], least: float | None = None) -> Bar:
    """Mean of the values in per cent, which must be `least` or more; without values, the bar fails as not measured."""
    value = 100.0 * float(np.mean(values)) if len(values) else math.nan
    told = name if len(values) else f"{name}: not measured"
    return Bar(name=told, value=value, unit="%", sense=">=" if least is not None else "", bound=least)


def _counted(name: str, values: Sequence[bool]) -> Bar:
    """A rate that must be LEAST or more, with the counts in its name."""
    return rate(f"{name} ({sum(values)} of {len(values)})", values, LEAST)


def criteria() -> list[str]:
    """Codes of the criteria for walks, in order. Tracking and likeness have separate tables; force criteria do not
    apply, because these walks are evaluated as recordings without forces."""
    elsewhere = {code for name in ELSEWHERE for code in groups()[name]}
    return [code for code in criterion.codes() if code not in elsewhere]


def known_good_bars(judged: list[Judged], codes: list[str]) -> list[Bar]:
    """Known-good motion: accepted share, and share that passes each criterion; falls are excluded and reported."""
    fallen, judged = sum(one.fell for one in judged), [one for one in judged if not one.fell]
    windows = [held for one in judged for held in one.windows]
    without, told = [one.unlabelled for one in judged], [one.told for one in judged]
    bars = [
        Bar(name="known-good rollouts", value=len(judged), sense=">=", bound=1),
        Bar(name="rollouts that fell, left out", value=fallen),
        rate("known good: seconds accepted", [one.labelled[1] for one in judged], LEAST),
        _counted("known good: accepted whole", [one.labelled[0] for one in judged]),
        _counted("known good: accepted whole, contacts not labelled", without),
        _counted("known good: accepted whole, contacts that KP2 tells", told),
        _counted(f"known good: windows of {WINDOW_S:g} s accepted", windows),
    ]
    return bars + [
        rate(f"known good: hold {code}, labels of any kind or none", [code not in one.broken for one in judged])
        for code in codes
    ]


def fault_bars(judged: list[Judged], asked: Collection[str] = ()) -> list[Bar]:
    """Planted faults that are large enough: found by any criterion, by the designed group, and by each criterion.

    A fault in `asked` that is in no rollout, or is too small in all, counts as not measured.
    """
    found: dict[str, list[set[str]]] = defaultdict(list, {kind: [] for fault in asked for kind in _kinds(fault)})
    for one in judged:
        for fault, codes in one.found.items():
            found[fault].append(codes)
    small = Counter(fault for one in judged for fault in one.small)
    bars = [Bar(name=f"too small to matter, left out: {fault}", value=small[fault]) for fault in sorted(small)]
    by_group: dict[str, list[set[str]]] = defaultdict(list)
    for fault, each in sorted(found.items()):
        group = group_of(fault)
        by_group[group] += each
        bars.append(_counted(f"found: {fault}", [bool(codes) for codes in each]))
        bars.append(rate(f"    by {group}", [bool(codes & set(groups()[group])) for codes in each]))
        counts = Counter(code for codes in each for code in sorted(codes))
        bars += [rate(f"    by {code}", [code in codes for codes in each]) for code, _ in counts.most_common()]
    return bars + [bar for group, each in sorted(by_group.items()) for bar in _group_bars(group, each)]


def _kinds(fault: str) -> list[str]:
    """Names of a fault with each kind of contact labels."""
    return [fault] if fault == LABELS else [fault + kind for kind in ("", NO_LABELS, TOLD_LABELS)]


def group_of(fault: str) -> str:
    """Group of criteria designed to find a fault, with labels of any kind or none."""
    name = fault.removesuffix(NO_LABELS).removesuffix(TOLD_LABELS)
    return FAULTS[name].group


def _group_bars(group: str, each: list[set[str]]) -> list[Bar]:
    """Share of the faults for a group of criteria that the group finds, and that each of its criteria finds."""
    own = set(groups()[group])
    bars = [rate(f"{group}: found, of {len(each)} made for it", [bool(codes & own) for codes in each])]
    return bars + [rate(f"    by {code}", [code in codes for codes in each]) for code in groups()[group]]
