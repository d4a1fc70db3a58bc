"""Run and evaluate a project in Webots and in its stand-ins. A result always names the engine it came from."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pipeline.webots.launch import FINISHED, NOT_RUN, Outcome, launch, launch_webots
from pipeline.webots.project import Project
from pipeline.webots.result import Allowed, WalkResult, WalkSegment, WebotsSettings
from pipeline.webots.sources import PIPELINE
from pipeline.webots.stand_in.ode_engine import NOT_FOUND, OdeNotFoundError, load_ode

WEBOTS, MUJOCO_STAND_IN, ODE_STAND_IN = "webots", "mujoco stand-in", "ode stand-in"
LABELS = {
    WEBOTS: "Webots",
    MUJOCO_STAND_IN: "MuJoCo (stand-in, not Webots)",
    ODE_STAND_IN: "ODE (Webots' engine family, upstream; stand-in, not Webots)",
}
PASSED, FAILED = "passed", "failed"
FAILED_TO_RUN = "failed to run"


@dataclass(frozen=True, kw_only=True)
class WebotsVerdict:
    """Verdict of one engine on a project."""

    engine: str
    status: str
    """`passed`, `failed`, or why there is no verdict: `not run: webots not found` if the program is missing,
    `failed to run: timed out, it was ended after 300 s` if it gave no result."""
    reasons: tuple[str, ...] = ()
    result: WalkResult | None = None

    @property
    def judged(self) -> bool:
        return self.status in (PASSED, FAILED)

    @property
    def failed_to_run(self) -> bool:
        """Whether the program was found but gave no result."""
        return self.status.startswith(FAILED_TO_RUN)

    def to_dict(self) -> dict[str, Any]:
        """JSON types, without the name of the run, which differs each time."""
        result = None if self.result is None else {**asdict(self.result), "run": ""}
        facts = {"engine": LABELS[self.engine], "status": self.status, "reasons": list(self.reasons)}
        return {**facts, "result": result}


def validate(project: Project, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> dict[str, WebotsVerdict]:
    """Verdicts of Webots and both stand-ins; a missing engine gives `not run`. `allowed`: see `verdict`."""
    outcomes = {
        WEBOTS: launch_webots(project, settings),
        MUJOCO_STAND_IN: run_stand_in("mujoco", project, settings),
        ODE_STAND_IN: run_stand_in("ode", project, settings),
    }
    return {engine: verdict(engine, outcome, settings, allowed) for engine, outcome in outcomes.items()}


def run_stand_in(engine: str, project: Project, settings: WebotsSettings) -> Outcome:
    """Run the project in the engine `mujoco` or `ode`, with the world, controller and launcher of Webots."""
    if engine == "ode":
        try:
            load_ode()
        except OdeNotFoundError:
            return Outcome(status=NOT_RUN, reason=NOT_FOUND)
    paths = [str(PIPELINE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    program = [sys.executable, "-m", "pipeline.webots.stand_in", "--engine", engine]
    return launch(program, project, settings, {"PYTHONPATH": os.pathsep.join(paths)})


def verdict(engine: str, outcome: Outcome, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> WebotsVerdict:
    """Compare an outcome with the thresholds by segment name; a segment without thresholds is not required."""
    if outcome.status == NOT_RUN:
        return WebotsVerdict(engine=engine, status=f"{NOT_RUN}: {outcome.reason}")
    if outcome.status != FINISHED or outcome.result is None:
        return WebotsVerdict(engine=engine, status=f"{FAILED_TO_RUN}: {outcome.status}, {outcome.reason}")
    reasons = tuple(_reasons(outcome.result, settings, allowed))
    return WebotsVerdict(engine=engine, status=FAILED if reasons else PASSED, reasons=reasons, result=outcome.result)


def _reasons(result: WalkResult, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> Iterator[str]:
    if not result.policy:
        yield "no policy walked"
    if result.fell_s is not None:
        yield f"fell after {result.fell_s:.2f} s"
    required = [pair for pair in zip(settings.segments, result.segments, strict=True) if pair[0].name in allowed]
    if not required:
        yield "no segment is required: nothing was shown"
    for segment, walked in required:
        figures = (walked.forward_m_s, walked.lateral_m_s, walked.yaw_rate_rad_s)
        if not walked.walked or None in figures:
            yield f"segment '{segment.name}': not walked to its end"
        else:
            yield from (f"segment '{segment.name}': {each}" for each in _off(segment, allowed[segment.name], figures))


def _off(segment: WalkSegment, allowed: Allowed, figures: tuple[float | None, ...]) -> Iterator[str]:
    forward, lateral, yaw_rate = (float(each or 0.0) for each in figures)
    error = math.hypot(forward - segment.command[0], lateral - segment.command[1])
    if error > allowed.velocity_error_m_s:
        got = f"{forward:.2f}, {lateral:.2f} m/s for {segment.command[0]:g}, {segment.command[1]:g}"
        yield f"walks {got}, off by {error:.3f}, allowed is {allowed.velocity_error_m_s:g}"
    off = abs(yaw_rate - segment.command[2])
    if off > allowed.yaw_rate_error_rad_s:
        yield (
            f"turns {yaw_rate:.2f} rad/s for {segment.command[2]:g}, off by {off:.3f}, "
            f"allowed is {allowed.yaw_rate_error_rad_s:g}"
        )
