"""Rates as bars, and the two tables of the rollouts: what is known to be good, and what was planted into it."""

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
"""Per cent of either kind that have to be judged rightly."""


def rate(name: str, values: Sequence[bool | float], least: float | None = None) -> Bar:
    """The mean of values as per cent, which has to be `least` or more. Of none it is not measured, and holds no bar."""
    value = 100.0 * float(np.mean(values)) if len(values) else math.nan
    told = name if len(values) else f"{name}: not measured"
    return Bar(name=told, value=value, unit="%", sense=">=" if least is not None else "", bound=least)


def _counted(name: str, values: Sequence[bool]) -> Bar:
    """A rate that has to be LEAST, whose name bears how many of how many."""
    return rate(f"{name} ({sum(values)} of {len(values)})", values, LEAST)


def criteria() -> list[str]:
    """Codes of the criteria that a walk is held to, in their order. Tracking and likeness have tables of their own; of
    forces nothing is asked, as these walks are judged as recordings that have none."""
    elsewhere = {code for name in ELSEWHERE for code in groups()[name]}
    return [code for code in criterion.codes() if code not in elsewhere]


def known_good_bars(judged: list[Judged], codes: list[str]) -> list[Bar]:
    """Known-good motion: accepted, and how many hold each criterion; who fell did not walk, and is told."""
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
    """Planted faults that matter: found at all, by the criteria made for them, and by which criterion.

    A fault that was `asked` for and is in no rollout, or matters in none, was not measured.
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
    """A fault with labels of each kind that it is judged with."""
    return [fault] if fault == LABELS else [fault + kind for kind in ("", NO_LABELS, TOLD_LABELS)]


def group_of(fault: str) -> str:
    """The group of criteria that is made to find a fault, with labels of any kind or none."""
    name = fault.removesuffix(NO_LABELS).removesuffix(TOLD_LABELS)
    return FAULTS[name].group


def _group_bars(group: str, each: list[set[str]]) -> list[Bar]:
    """Of all plants that a group of criteria is made for: found by it, and by each criterion of it."""
    own = set(groups()[group])
    bars = [rate(f"{group}: found, of {len(each)} made for it", [bool(codes & own) for codes in each])]
    return bars + [rate(f"    by {code}", [code in codes for codes in each]) for code in groups()[group]]
