"""KP4's perturbations of this checkout's motions: amount applied, side effects, and share accepted by KP5.

    dagster asset materialize --select expert_db
    python benchmarks/augmentation.py [--json] [--kinds foot_lift] [--no-kp5]

Applies every variant of `VARIANTS` to every clip of KP3 (`data/store`) and compares it with its original: stance feet,
requested amount, peak accelerations. Then KP5 evaluates original and variant.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline import time_series  # noqa: E402
from pipeline.augment import AugmentSettings  # noqa: E402
from pipeline.augment.perturb import Gait, gait_of, perturb  # noqa: E402
from pipeline.batch import Store  # noqa: E402
from pipeline.clips.outcome import Reason  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.feasibility import FeasibilitySettings, process  # noqa: E402
from pipeline.files import settings  # noqa: E402
from pipeline.quality.planar_motion import command_velocity  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402

VARIANTS = [
    *(("step_length", factor) for factor in (0.8, 0.9, 1.1)),
    *(("step_width", metres) for metres in (0.02, 0.04)),
    *(("foot_lift", metres) for metres in (0.02, 0.04)),
    *(("trunk_lean", degrees) for degrees in (-4.0, -2.0, 2.0, 4.0)),
]
"""First and last strengths of data/feedback_rules.yaml, and longer steps."""


@dataclass
class Found:
    """Results of one variant over all clips."""

    made: int = 0
    refused: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    stance_m: float = 0.0
    """Largest displacement of a stance foot relative to its constant offset."""
    off: float = 0.0
    """Largest share of the requested amount that was not reached."""
    sharper: list[float] = field(default_factory=list)
    """Peak joint acceleration relative to the original's."""
    lowered_m: list[float] = field(default_factory=list)
    kept_s: float = 0.0
    original_s: float = 0.0
    """Duration that KP5 accepts of the variants, and of their originals [s]."""


def main() -> int:
    options = _options()
    robot = load_robot("t1")
    limits = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
    contact = settings.read(ROOT / "data/augment.yaml", AugmentSettings).contact
    store = Store(root=ROOT / "data/store")
    entries = store.load("retargeted_motions").entries
    found = {variant: Found() for variant in VARIANTS if not options.kinds or variant[0] in options.kinds}
    spent_s = worked_s = 0.0
    for entry in entries:
        clip = store.get_clip(entry.blob, entry.clip)
        assert isinstance(clip, RobotClip)
        gait = gait_of(clip, robot, contact)
        original_s = 0.0 if options.no_kp5 else _kept_s(clip, entry.numbers, limits, robot)
        for (kind, strength), one in found.items():
            start = time.process_time()
            new = perturb(clip, robot, kind, strength, f"{clip.name}~new", contact)
            spent_s, worked_s = spent_s + time.process_time() - start, worked_s + clip.duration_s
            if isinstance(new, Reason):
                one.refused[new.code] += 1
                continue
            _look(one, kind, strength, gait, gait_of(new, robot, contact))
            if not options.no_kp5:
                one.kept_s += min(_kept_s(new, entry.numbers, limits, robot), original_s)
                one.original_s += original_s
    bars = [bar for variant, one in found.items() for bar in _bars(variant, one)]
    bars.append(Bar(name="processor time of a second of a variant", value=1e3 * spent_s / worked_s, unit="ms"))
    return 0 if report(bars, machine=machine(), json=options.json) else 1


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--kinds", nargs="*", default=[])
    parser.add_argument("--no-kp5", action="store_true")
    return parser.parse_args()


def _look(one: Found, kind: str, strength: float, before: Gait, after: Gait) -> None:
    one.made += 1
    moved = after.foot_pos_w - before.foot_pos_w
    for side in range(2):
        for start, stop in time_series.runs(before.contacts[:, side]):
            one.stance_m = max(one.stance_m, float(np.abs(moved[start:stop, side] - moved[start, side]).max()))
    one.sharper.append(_peak(after.clip) / _peak(before.clip) if _peak(before.clip) > 1.0 else 1.0)
    sunk = before.hips_w[:, 2] - after.hips_w[:, 2]
    one.lowered_m.append(float(np.median(sunk)))
    one.off = max(one.off, _missed(kind, strength, before, after))


def _missed(kind: str, strength: float, before: Gait, after: Gait) -> float:
    """Share of the requested amount that was not reached."""
    if kind == "step_length":
        was, now = (
            command_velocity(each.clip.root_pos_w, each.clip.root_quat_w, each.clip.fps) for each in (before, after)
        )
        speed = float(np.hypot(was.forward_m_s, was.lateral_m_s))
        return abs(float(np.hypot(now.forward_m_s, now.lateral_m_s)) - strength * speed) / max(speed, 0.05)
    if kind == "step_width":
        lateral = np.stack([-np.sin(before.heading), np.cos(before.heading)], axis=1)
        apart = [
            np.sum((each.foot_pos_w[:, 0] - each.foot_pos_w[:, 1])[:, :2] * lateral, axis=1) for each in (before, after)
        ]
        return abs(float(np.mean(apart[1] - apart[0])) / strength - 1.0)
    if kind == "trunk_lean":
        return 0.0
    raised = (after.foot_pos_w - before.foot_pos_w)[..., 2].max()
    return abs(float(raised) / strength - 1.0)


def _peak(clip: RobotClip) -> float:
    return float(np.abs(np.diff(clip.joint_pos, n=2, axis=0)).max() * clip.fps**2)


def _kept_s(clip: RobotClip, numbers: dict, limits: FeasibilitySettings, robot: Robot) -> float:
    return sum(piece.clip.duration_s for piece in process(clip, numbers, settings=limits, robot=robot).pieces)


def _bars(variant: tuple[str, float], one: Found) -> list[Bar]:
    name = f"{variant[0]} {variant[1]:g}"
    refused = {code: count for code, count in one.refused.items() if code != "nothing_to_perturb"}
    wanted = one.made + sum(refused.values())
    bars = [Bar(name=f"{name}: clips made", value=one.made), Bar(name=f"{name}: of clips it changes", value=wanted)]
    if not one.made:
        return bars
    bars += [
        Bar(name=f"{name}: standing feet move by", value=one.stance_m, unit="m", sense="<=", bound=1e-6),
        Bar(name=f"{name}: amount off by", value=100 * one.off, unit="%"),
        Bar(name=f"{name}: peak joint acceleration", value=float(np.median(one.sharper)), unit="x"),
        Bar(name=f"{name}: the same, worst clip", value=max(one.sharper), unit="x"),
        Bar(name=f"{name}: hips lower by, worst clip", value=100 * max(one.lowered_m), unit="cm"),
    ]
    if one.original_s:
        bars.append(Bar(name=f"{name}: seconds that pass KP5", value=100 * one.kept_s / one.original_s, unit="%"))
    return bars


if __name__ == "__main__":
    sys.exit(main())
