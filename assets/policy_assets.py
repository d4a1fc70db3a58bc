"""The assets about policies of one robot, from one factory, and the job that trains."""

from typing import Any

import dagster as dg

from assets.ablation import augmentation_ablation
from assets.amp_policy import amp_policy
from assets.limit_cycles import limit_cycles
from assets.plan import policy_plans, robot_plans
from assets.policy import exported_policy
from assets.project import DEFAULT_ROBOT
from assets.release import release_report, released


def policy_assets(robot: str) -> list[Any]:
    """Training, ablation, export, limit cycles and release report of the robot in `robots/<robot>`."""
    of_robot = {plan.name: plan for plan in robot_plans(robot)}
    trained, ablation, exported, cycles, release = policy_plans(robot)
    database, adapted, model = (of_robot[name] for name in ("expert_db", "adapted_robot", "robot_model"))
    known = released(robot)
    trials = known.get("hardware_trials")
    return [
        amp_policy(trained, database, adapted),
        augmentation_ablation(ablation, database, adapted),
        exported_policy(exported, trained, model),
        limit_cycles(cycles, exported, adapted, trials.key if trials else None),
        release_report(release, known),
    ]


def training_jobs(robots: tuple[str, ...]) -> list[Any]:
    """The job `train` of each robot (`train_k1` of another one): started by a person, never by itself."""
    return [
        dg.define_asset_job(
            "train" if robot == DEFAULT_ROBOT else f"train_{robot}",
            selection=dg.AssetSelection.assets(policy_plans(robot)[0].key),
            description="Trains a policy on the expert database, which is brought up to date first.",
        )
        for robot in robots
    ]
