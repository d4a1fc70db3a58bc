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
    robot: str | None = None
    """Robot folder it depends on; None for what all robots share."""

    @property
    def key(self) -> dg.AssetKey:
        return dg.AssetKey([self.name]) if self.robot in (None, DEFAULT_ROBOT) else dg.AssetKey([self.robot, self.name])

    def code_version(self) -> str:
        return code_version(*self.packages)

    def fingerprint(self, project: Project) -> str:
        """Digest of the code, of the settings as the files say them now, and of the robot's folder."""
        values = [settings.read_yaml(project.settings(name)) for name in self.settings_files]
        robot = digest_of_robot(project, self.robot) if self.robot else None
        return digest.of_json([self.name, self.code_version(), values, robot])[:FINGERPRINT_DIGITS]


def digest_of_robot(project: Project, robot: str) -> str:
    """Digest of the files in a robot's folder."""
    folder = project.robot_folder(robot)
    paths = [path for path in folder.rglob("*") if path.suffix in {".xml", ".urdf", ".toml", ".csv"}]
    return digest.of_files(paths, folder)


SHARED = (
    Plan(name="motion_catalog", packages=("catalog", "readers"), settings_files=("catalog.yaml", "sources.yaml")),
    Plan(name="selected_motions", packages=("selection",), settings_files=("curation.yaml",)),
    Plan(name="repaired_motions", packages=("repair",), settings_files=("repair.yaml",)),
)
"""The stages that are the same for every robot."""


def robot_plans(robot: str) -> tuple[Plan, ...]:
    """The stages of one robot."""
    return (
        Plan(name="robot_model", packages=("robot",), robot=robot),
        Plan(name="actuator_calibration", packages=("actuators",), settings_files=("actuators.yaml",), robot=robot),
        Plan(name="adapted_robot", packages=("actuators",), settings_files=("actuators.yaml",), robot=robot),
        Plan(
            name="retargeted_motions", packages=("retarget", "scoring"), settings_files=("retarget.yaml",), robot=robot
        ),
        Plan(name="augmented_motions", packages=("augment",), settings_files=("augment.yaml",), robot=robot),
        Plan(name="feasible_motions", packages=("feasibility",), settings_files=("feasibility.yaml",), robot=robot),
        Plan(name="expert_db", packages=("expert",), robot=robot),
    )


def plans(project: Project) -> dict[dg.AssetKey, Plan]:
    """Every asset of the graph by key."""
    each = SHARED + tuple(plan for robot in project.robots for plan in robot_plans(robot))
    return {plan.key: plan for plan in each}
