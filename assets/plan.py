"""What each asset's answer depends on besides its inputs: code, settings, robot. No heavy imports here."""

from dataclasses import dataclass

import dagster as dg

from assets.project import DEFAULT_ROBOT, Project
from pipeline.batch.code_version import code_version
from pipeline.files import digest, settings

FINGERPRINT_TAG = "booster_lab/fingerprint"
"""Tag of a materialization: the asset's fingerprint at that time."""


FAULTS_TAG = "booster_lab/faults"
"""Tag of a materialization: how many clips were lost to a fault of the stage itself, not to a verdict."""

BARS = ("validation.yaml",)
"""A robot's thresholds for policies, in its folder."""

FINGERPRINT_DIGITS = 40
"""Hex digits of a fingerprint; Dagster allows a tag 63 characters."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One asset of the graph."""

    name: str
    """Last part of the asset key."""
    packages: tuple[str, ...]
    """The packages of `pipeline/` that do the work."""
    settings_files: tuple[str, ...] = ()
    """Files of `data/` that parametrise it."""
    robot_settings_files: tuple[str, ...] = ()
    """Files of the robot's folder that parametrise it without being part of its model; a robot may lack them."""
    robot: str | None = None
    """Robot folder it depends on; None for what all robots share."""
    as_they_are: tuple[str, ...] = ()
    """Names of inputs that are taken as they are: never made for this asset, and it is not stale because they are.
    New content of them makes it stale."""
    names_robot: bool = False
    """Whether the key has the robot's name although it is the default robot: a training is started by its name."""
    shipped_policies: bool = False
    """Whether it depends on the policies that ship with the robot."""

    @property
    def key(self) -> dg.AssetKey:
        if self.robot is None or (self.robot == DEFAULT_ROBOT and not self.names_robot):
            return dg.AssetKey([self.name])
        return dg.AssetKey([self.robot, self.name])

    def code_version(self) -> str:
        return code_version(*self.packages)

    def fingerprint(self, project: Project) -> str:
        """Digest of the code, of the settings as the files say them now, and of the robot's folder."""
        values = [settings.read_yaml(project.settings(name)) for name in self.settings_files]
        folder = project.robot_folder(self.robot or DEFAULT_ROBOT)
        own = [path for path in (folder / name for name in self.robot_settings_files) if path.is_file()]
        values += [settings.read_yaml(path) for path in own]
        robot = digest_of_robot(project, self.robot) if self.robot else None
        parts = [self.name, self.code_version(), values, robot]
        if self.shipped_policies:
            parts.append(digest_of_policies(project, self.robot or DEFAULT_ROBOT))
        return digest.of_json(parts)[:FINGERPRINT_DIGITS]

    def takes_as_it_is(self, parent: dg.AssetKey) -> bool:
        """Whether an input is taken as it is."""
        return parent.path[-1] in self.as_they_are


def digest_of_robot(project: Project, robot: str) -> str:
    """Digest of the files in a robot's folder; policies that ship there are not what the robot is."""
    folder, policies = project.robot_folder(robot), project.shipped_policies(robot)
    files = (path for path in folder.rglob("*") if path.suffix in {".xml", ".urdf", ".toml", ".csv"})
    return digest.of_files([path for path in files if policies not in path.parents], folder)


def digest_of_policies(project: Project, robot: str) -> str:
    """Digest of what ships in a robot's `policies/`: of the heads, which state the digests of all else."""
    folder = project.shipped_policies(robot)
    return digest.of_files(sorted(folder.rglob("*.json")), folder)


SHARED = (
    Plan(
        name="motion_catalog",
        packages=("catalog", "readers", "hardware_logs"),
        settings_files=("catalog.yaml", "sources.yaml", "hardware_logs.yaml"),
    ),
    Plan(name="selected_motions", packages=("selection",), settings_files=("curation.yaml",)),
    Plan(name="repaired_motions", packages=("repair",), settings_files=("repair.yaml",)),
)
"""The stages that are the same for every robot."""

RELEASED = (
    "exported_policy",
    "expert_db",
    "actuator_calibration",
    "adapted_robot",
    "mujoco_validation",
    "cross_engine_validation",
    "webots_validation",
    "limit_cycles",
    "augmentation_ablation",
    "hardware_trials",
    "sim_to_real_report",
)
"""What the release report is made from, as it is: it runs nothing, and says what was not run."""


TRIALS = Plan(name="hardware_trials", packages=("hardware_logs",), settings_files=("hardware_logs.yaml",))
"""What is made of each log by itself."""

FIELD = (
    Plan(
        name="failure_modes",
        packages=("failures", "feedback", "virtual_robot", "validation", "hardware_logs", "deployment", "actuators"),
        settings_files=("failures.yaml", "actuators.yaml"),
    ),
    Plan(
        name="curation_feedback",
        packages=("feedback", "failures", "feasibility", "selection"),
        settings_files=("feedback_rules.yaml", "commands.yaml", "curation.yaml"),
    ),
    Plan(name="sim_to_real_report", packages=("feedback",)),
)
"""What is made of the logs of hardware."""


def robot_plans(robot: str) -> tuple[Plan, ...]:
    """The stages of one robot."""
    return (
        Plan(name="robot_model", packages=("robot",), robot=robot),
        Plan(name="actuator_calibration", packages=("actuators",), settings_files=("actuators.yaml",), robot=robot),
        Plan(name="adapted_robot", packages=("actuators",), settings_files=("actuators.yaml",), robot=robot),
        Plan(
            name="retargeted_motions", packages=("retarget", "scoring"), settings_files=("retarget.yaml",), robot=robot
        ),
        Plan(name="motion_variants", packages=("augment",), settings_files=("augment.yaml",), robot=robot),
        Plan(name="reference_motions", packages=("feasibility",), settings_files=("feasibility.yaml",), robot=robot),
        Plan(name="tracking_policy", packages=("tracking", "learning"), robot=robot, shipped_policies=True),
        Plan(
            name="augmented_motions",
            packages=("tracking", "actuators", "deployment"),
            settings_files=("tracking.yaml",),
            robot=robot,
        ),
        Plan(
            name="feasible_motions",
            packages=("feasibility",),
            settings_files=("feasibility.yaml", "commands.yaml", "curation.yaml"),
            robot=robot,
        ),
        Plan(name="expert_db", packages=("expert", "tracking"), robot=robot),
    )


def named_plans(robot: str) -> dict[str, Plan]:
    """The stages of one robot by name."""
    return {plan.name: plan for plan in robot_plans(robot)}


def policy_plans(robot: str) -> tuple[Plan, ...]:
    """What is made of a robot's database: policies, and what is asked of them. Training never starts by itself."""
    export, trained = ("export", "deployment"), ("training", "learning", "expert", "tracking")
    return (
        Plan(name="amp_policy", packages=(*trained, "validation", "dart", *export), robot=robot, names_robot=True),
        Plan(name="augmentation_ablation", packages=trained, robot=robot, shipped_policies=True),
        Plan(
            name="exported_policy",
            packages=export,
            robot=robot,
            robot_settings_files=("deployment.yaml",),
            as_they_are=("amp_policy",),
            shipped_policies=True,
        ),
        Plan(
            name="limit_cycles",
            packages=("validation", "dart", "deployment", "actuators", "hardware_logs"),
            settings_files=("limit_cycles.yaml", "validation.yaml"),
            robot_settings_files=BARS,
            robot=robot,
            as_they_are=("hardware_trials",),
        ),
        Plan(name="release_report", packages=("release",), robot=robot, as_they_are=RELEASED),
    )


EXPORTS = {
    "mjlab": "mjlab_motions",
    "gmr": "gmr_motions",
    "lerobot": "lerobot_dataset",
    "rerun": "rerun_recordings",
}
"""Format of `booster-lab export` -> the asset that holds a robot's database in it."""


def export_plans(robot: str) -> dict[str, Plan]:
    """By format, what a robot's database is exported as. Nothing depends on them."""
    return {kind: Plan(name=name, packages=("dataset_export",), robot=robot) for kind, name in EXPORTS.items()}


def validation_plan(robot: str) -> Plan:
    """What is asked of a robot's policy in MuJoCo."""
    packages = ("validation", "deployment", "actuators", "virtual_robot", "hardware_logs")
    return Plan(
        name="mujoco_validation",
        packages=packages,
        settings_files=("validation.yaml",),
        robot_settings_files=BARS,
        robot=robot,
    )


def engine_plans(robot: str) -> tuple[Plan, ...]:
    """What holds a robot's policy against other physics engines."""
    walked = ("validation", "deployment", "actuators")
    return (
        Plan(
            name="cross_engine_validation",
            packages=(*walked, "dart", "virtual_robot", "hardware_logs"),
            settings_files=("cross_engine.yaml", "validation.yaml"),
            robot_settings_files=BARS,
            robot=robot,
        ),
        Plan(
            name="webots_validation",
            packages=(*walked, "webots"),
            settings_files=("webots.yaml", "validation.yaml"),
            robot_settings_files=BARS,
            robot=robot,
        ),
    )


def plans(project: Project) -> dict[dg.AssetKey, Plan]:
    """Every asset of the graph by key."""
    by_robot = (
        plan
        for robot in project.robots
        for plan in (
            *robot_plans(robot),
            *export_plans(robot).values(),
            *policy_plans(robot),
            *engine_plans(robot),
            validation_plan(robot),
        )
    )
    return {plan.key: plan for plan in (*SHARED, TRIALS, *FIELD, *by_robot)}
