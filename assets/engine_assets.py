"""The assets of one robot that hold its policy against other physics engines."""

from typing import Any

from assets.cross_engine import cross_engine_validation
from assets.plan import engine_plans, policy_plans, robot_plans
from assets.webots import webots_validation


def engine_assets(robot: str) -> list[Any]:
    """Cross-engine and Webots validation of the robot in `robots/<robot>`."""
    adapted = next(plan for plan in robot_plans(robot) if plan.name == "adapted_robot")
    exported = next(plan for plan in policy_plans(robot) if plan.name == "exported_policy")
    engines, webots = engine_plans(robot)
    return [cross_engine_validation(engines, exported, adapted), webots_validation(webots, exported, adapted)]
