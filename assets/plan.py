"""Table of all assets: group in Dagster's graph, and the code, settings and robot that the result depends on.

All modules of `assets` import it: keep its imports light.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import dagster as dg

from pipeline.batch.code_version import code_version
from pipeline.files import digest, settings
from pipeline.project import DEFAULT_ROBOT, Project

FINGERPRINT_TAG = "booster_lab/fingerprint"
"""Tag of a materialization: the asset's fingerprint at that time."""


FAULTS_TAG = "booster_lab/faults"
"""Tag of a materialization: number of clips lost to an unexpected error in the stage itself."""

FINGERPRINT_DIGITS = 40
"""Hex digits of a fingerprint; Dagster limits the value of a tag to 63 characters."""


@dataclass(frozen=True)
class Plan:
    """One asset of the graph."""

    name: str
    """Last part of the asset key."""
    group: str
    """Group in Dagster's graph, without the prefix of the robot."""
    packages: tuple[str, ...]
    """Packages of `pipeline/` whose code determines the result."""
    settings_files: tuple[str, ...] = ()
    """Settings files in `data/`."""
    _: KW_ONLY
    robot: str | None = None
    """Robot folder it depends on; None for an asset that all robots share."""
    robot_settings_files: tuple[str, ...] = ()
    """Settings files in the robot's folder that are not part of its model. Each is optional."""
    as_they_are: tuple[str, ...] = ()
    """Names of soft inputs. A soft input is used as it is: it is not materialized on demand, and its staleness does not
    propagate. New content of it makes the asset stale."""
    names_robot: bool = False
    """Whether the key has the robot's name also for the default robot, as the key of a training has."""
    shipped_policies: bool = False
    """Whether it depends on the policies shipped with the robot."""
    every_robot: bool = False
    """Whether it depends on the folders of all robots: a hardware log can be of any robot."""
    any_policy: bool = False
    """Whether it depends on all available policies of all robots: a log names its policy by digest."""

    @property
    def key(self) -> dg.AssetKey:
        if self.robot is None or (self.robot == DEFAULT_ROBOT and not self.names_robot):
            return dg.AssetKey([self.name])
        return dg.AssetKey([self.robot, self.name])

    def code_version(self) -> str:
        return code_version(*self.packages)

    def fingerprint(self, project: Project) -> str:
        """Digest of the code, the current settings, the robot's folder and the policies that it depends on."""
        values = [settings.read_yaml(project.settings(name)) for name in self.settings_files]
        folder = project.robot_folder(self.robot or DEFAULT_ROBOT)
        robot_settings = [path for path in (folder / name for name in self.robot_settings_files) if path.is_file()]
        values += [settings.read_yaml(path) for path in robot_settings]
        robot = digest_of_robot(project, self.robot) if self.robot else None
        parts = [self.name, self.code_version(), values, robot]
        if self.shipped_policies:
            parts.append(digest_of_policies(project, self.robot or DEFAULT_ROBOT))
        if self.every_robot:
            parts.append(digest_of_robots(project))
        if self.any_policy:
            paths = {path for name in project.robots for path in project.policy_files(name)}
            found = {digest.of_file_or_fault(path) for path in paths}
            parts.append(sorted(found))
        return digest.of_json(parts)[:FINGERPRINT_DIGITS]

    def is_soft_input(self, parent: dg.AssetKey) -> bool:
        """Whether `parent` is a soft input (`as_they_are`)."""
        return parent.path[-1] in self.as_they_are


def digest_of_robot(project: Project, robot: str) -> str:
    """Digest of the model and table files in a robot's folder, without the shipped policies."""
    folder, policies = project.robot_folder(robot), project.shipped_policies(robot)
    files = (path for path in folder.rglob("*") if path.suffix in {".xml", ".urdf", ".toml", ".csv"})
    return digest.of_files([path for path in files if policies not in path.parents], folder)


def digest_of_robots(project: Project) -> str:
    """Digest of the folders of all robots."""
    return digest.of_json({name: digest_of_robot(project, name) for name in project.robots})


def digest_of_policies(project: Project, robot: str) -> str:
    """Digest of the policies shipped in a robot's `policies/`: of the JSON files, which hold digests of the rest."""
    folder = project.shipped_policies(robot)
    return digest.of_files(sorted(folder.rglob("*.json")), folder)


SOURCES, SELECTION, REPAIR, HARDWARE = "sources", "KP1_selection", "KP2_repair", "hardware_feedback"
ROBOT, RETARGETING, AUGMENTATION, FEASIBILITY = "robot", "KP3_retargeting", "KP4_augmentation", "KP5_feasibility"
DATABASE, TRAINING, VALIDATION = "database", "training", "validation"

SHARED = (
    Plan(
        "motion_catalog",
        SOURCES,
        ("catalog", "readers", "hardware_logs"),
        ("catalog.yaml", "sources.yaml", "hardware_logs.yaml"),
    ),
    Plan("selected_motions", SELECTION, ("selection", "feedback"), ("curation.yaml",)),
    Plan("repaired_motions", REPAIR, ("repair",), ("repair.yaml",)),
)
"""Stages that all robots share."""

TRIALS = Plan("hardware_trials", HARDWARE, ("hardware_logs",), ("hardware_logs.yaml",), every_robot=True)
"""Trials of each hardware log."""

FIELD = (
    Plan(
        "failure_modes",
        HARDWARE,
        ("failures", "feedback", "virtual_robot", "validation", "hardware_logs", "deployment", "actuators"),
        ("failures.yaml", "actuators.yaml"),
        every_robot=True,
        any_policy=True,
    ),
    Plan(
        "curation_feedback",
        HARDWARE,
        ("feedback", "failures", "feasibility", "selection"),
        ("feedback_rules.yaml", "commands.yaml", "curation.yaml"),
    ),
    Plan("sim_to_real_report", HARDWARE, ("feedback",)),
)
"""Assets that evaluate the hardware trials."""

EXPORTS = {
    "mjlab": "mjlab_motions",
    "gmr": "gmr_motions",
    "lerobot": "lerobot_dataset",
    "rerun": "rerun_recordings",
}
"""Format of `booster-lab export` -> asset with a robot's database in this format. No asset depends on them."""

RELEASED = (
    "exported_policy",
    "expert_db",
    "actuator_calibration",
    "adapted_robot",
    "mujoco_validation",
    "cross_engine_validation",
    "webots_validation",
    "limit_cycles",
    "hardware_trials",
    "sim_to_real_report",
)
"""Soft inputs of the release report: it runs nothing, and lists what was not run."""

_WALKS = ("validation", "deployment", "actuators")
_BARS: dict[str, Any] = {"robot_settings_files": ("validation.yaml",)}
"""The settings file with a robot's validation thresholds, in its folder."""

_OF_ROBOT = (
    Plan("robot_model", ROBOT, ("robot",)),
    Plan("actuator_calibration", ROBOT, ("actuators",), ("actuators.yaml",)),
    Plan("adapted_robot", ROBOT, ("actuators", "feedback"), ("actuators.yaml",)),
    Plan("retargeted_motions", RETARGETING, ("retarget", "scoring"), ("retarget.yaml",)),
    Plan("motion_variants", AUGMENTATION, ("augment", "feedback"), ("augment.yaml",)),
    Plan("reference_motions", FEASIBILITY, ("feasibility",), ("feasibility.yaml",)),
    Plan("tracking_policy", AUGMENTATION, ("tracking", "learning"), shipped_policies=True),
    Plan("augmented_motions", AUGMENTATION, ("tracking", "actuators", "deployment"), ("tracking.yaml",)),
    Plan(
        "feasible_motions",
        FEASIBILITY,
        ("feasibility", "feedback"),
        ("feasibility.yaml", "commands.yaml", "curation.yaml"),
    ),
    Plan("expert_db", DATABASE, ("expert", "tracking")),
    *(Plan(name, DATABASE, ("dataset_export",)) for name in EXPORTS.values()),
    Plan(
        "amp_policy",
        TRAINING,
        ("training", "learning", "expert", "tracking", "validation", "dart", "export", "deployment"),
        names_robot=True,
    ),
    Plan(
        "exported_policy",
        VALIDATION,
        ("export", "deployment"),
        robot_settings_files=("deployment.yaml",),
        as_they_are=("amp_policy",),
        shipped_policies=True,
    ),
    Plan("mujoco_validation", VALIDATION, (*_WALKS, "virtual_robot", "hardware_logs"), ("validation.yaml",), **_BARS),
    Plan(
        "cross_engine_validation",
        VALIDATION,
        (*_WALKS, "dart", "virtual_robot", "hardware_logs"),
        ("cross_engine.yaml", "validation.yaml"),
        **_BARS,
    ),
    Plan("webots_validation", VALIDATION, (*_WALKS, "webots"), ("webots.yaml", "validation.yaml"), **_BARS),
    Plan(
        "limit_cycles",
        VALIDATION,
        (*_WALKS, "dart", "hardware_logs"),
        ("limit_cycles.yaml", "validation.yaml"),
        as_they_are=("hardware_trials",),
        **_BARS,
    ),
    Plan("release_report", VALIDATION, ("release", "export", *_WALKS), as_they_are=RELEASED),
)


def robot_plans(robot: str) -> dict[str, Plan]:
    """Name -> plan of each asset of one robot."""
    return {plan.name: dataclasses.replace(plan, robot=robot) for plan in _OF_ROBOT}


def plans(project: Project) -> dict[dg.AssetKey, Plan]:
    """Key -> plan of each asset of the graph, without external ones."""
    of_robots = [plan for robot in project.robots for plan in robot_plans(robot).values()]
    return {plan.key: plan for plan in (*SHARED, TRIALS, *FIELD, *of_robots)}


_EXTERNAL = (
    Plan("raw_motions", SOURCES, ()),
    Plan("hardware_logs", HARDWARE, ()),
    Plan("approved_windows", SELECTION, ()),
)
_EXTERNAL_OF_ROBOT = (
    Plan("actuator_measurements", ROBOT, ()),
    Plan("approved_limits", ROBOT, ()),
    Plan("approved_variants", AUGMENTATION, ()),
    Plan("approved_weights", FEASIBILITY, ()),
    Plan("approved_randomization", TRAINING, ()),
)
_SHARED = {plan.name: plan for plan in (*SHARED, TRIALS, *FIELD, *_EXTERNAL)}
_OWN = {plan.name: plan for plan in (*_OF_ROBOT, *_EXTERNAL_OF_ROBOT)}


def key_of(name: str, robot: str | None) -> dg.AssetKey:
    """Key of an asset by its name; `robot` has no effect for an asset that all robots share."""
    return _SHARED[name].key if name in _SHARED else dataclasses.replace(_OWN[name], robot=robot).key


def group_of(name: str, robot: str | None = None) -> str:
    """Group of an asset by the last part of its key.

    Args:
        robot: robot of the asset; None for an asset that all robots share
    """
    group = (_SHARED | _OWN)[name].group
    return group if robot is None else f"{robot}_{group}"


def external(name: str, robot: str | None, what: str, deps: Sequence[dg.AssetKey] = ()) -> dg.AssetSpec:
    """Specification of an external asset: files from outside the graph, versioned by content.

    Args:
        name: last part of its key
        robot: robot of the asset; None for an asset that all robots share
        what: description in the web UI
        deps: upstream assets
    """
    group = group_of(name, robot)
    return dg.AssetSpec(key_of(name, robot), deps=deps, group_name=group, description=what, kinds={"file"})
