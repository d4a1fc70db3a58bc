"""Which cell shows each fault that is planted into a policy, and the verdict on some cells."""

from __future__ import annotations

from pipeline.batch import ClipPool
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import measure
from pipeline.validation.suites import named
from pipeline.validation.verdict import Verdict, judge

CAUGHT_BY = {
    "gyro in the world frame": "curve vx +0.6 yaw +0.8",
    "gyro in deg/s": "stand",
    "left and right swapped": "vx +0.6",
    "reversed history": "vx +0.6",
    "wrong joint order": "stand",
    "action scale halved": "vx +0.6",
    "60 % torque": "vx +2.0",
    "half Kp": "stand",
    "normalizer left out": "vx +0.6",
}
"""A cell that shows it; others do too."""


def judged(one: Deployed, bars: ValidationSettings, cells: list[str]) -> Verdict:
    """The first trial of each of these cells, held against the bars."""
    found = measure(one, named(one.robot, dict.fromkeys(cells, 1)), ClipPool(workers=1))
    return judge(found, bars, suite="test", policy="", robot="")
