"""A verdict is stale when code changes that it comes from: its plan names every package that its code imports."""

import ast
from pathlib import Path

import pytest

from assets.plan import FIELD, SHARED, Plan, robot_plans
from pipeline.batch.code_version import BELOW_ALL_STAGES

PLANS = {plan.name: plan for plan in (*FIELD, *robot_plans("t1").values())}
RUN_BY = {
    "mujoco_validation": ("validation/figures", "validation/suites", "validation/verdict", "validation/failed_trials"),
    "cross_engine_validation": ("validation/cross_engine", "validation/cross_engine_trials"),
    "webots_validation": ("webots/validate", "webots/project", "validation/deployed"),
    "limit_cycles": ("validation/limit_cycle_walks", "hardware_logs/trial"),
    "failure_modes": ("failures/find", "feedback/sim_to_real"),
    "release_report": ("release/dossier", "release/page", "export/card", "validation/deployed"),
}
"""Modules of `pipeline` that an asset calls."""


def packages_below(pipeline: Path, modules: tuple[str, ...]) -> set[str]:
    """Packages of `pipeline` that modules import, and these in turn."""
    waiting, seen = [pipeline / f"{name}.py" for name in modules], set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pipeline."):
                base = pipeline.joinpath(*str(node.module).split(".")[1:])
                places = [base.with_suffix(".py"), base / "__init__.py"]
                places += [base / f"{alias.name}.py" for alias in node.names]
                waiting += [place for place in places if place.is_file()]
    return {path.relative_to(pipeline).parts[0] for path in seen if path.parent != pipeline}


@pytest.mark.parametrize("name", RUN_BY)
def test_a_plan_names_every_package_that_its_verdict_comes_from(root: Path, name: str):
    plan: Plan = PLANS[name]
    assert packages_below(root / "pipeline", RUN_BY[name]) - {*plan.packages, *BELOW_ALL_STAGES} == set()


@pytest.mark.parametrize("name", ["selected_motions", "adapted_robot", "motion_variants", "feasible_motions"])
def test_what_approved_changes_decide_is_stale_when_their_code_changes(name: str):
    """Windows, motor limits, variants and weights come from `pipeline/feedback`; no other asset stands for it."""
    plans = {plan.name: plan for plan in SHARED} | PLANS
    assert "feedback" in plans[name].packages
