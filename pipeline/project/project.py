"""Paths, settings and robots of the project. No other module builds paths."""

import dataclasses
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from pipeline.batch import Store
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.feedback.approve import FeedbackFiles
from pipeline.files import settings
from pipeline.readers import Source, SourcesInUse, Statement, sources_in_use, sources_of_environment
from pipeline.readers.remembered import VARIABLE
from pipeline.robot import Robot, load_robot
from pipeline.validation.bars import ValidationSettings, read_validation

DEFAULT_ROBOT = "t1"
"""The robot whose asset keys have no robot prefix."""

POLICIES_VARIABLE = "BOOSTER_LAB_POLICIES"
"""Environment variable with a folder of further policies, whose logs are compared with simulation."""

T = TypeVar("T")


@dataclass(frozen=True)
class Project:
    """A checkout of the project."""

    root: Path

    @property
    def data(self) -> Path:
        return self.root / "data"

    @cached_property
    def store(self) -> Store:
        return Store(root=self.data / "store")

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the folders in `robots/`, the default robot first."""
        names = sorted(path.parent.name for path in (self.root / "robots").glob("*/robot.toml"))
        return tuple(sorted(names, key=lambda name: name != DEFAULT_ROBOT))

    def robot_folder(self, robot: str) -> Path:
        """The folder `robots/<robot>`, whether or not it exists; `robot` raises UnknownNameError."""
        return self.root / "robots" / robot

    def robot(self, name: str) -> Robot:
        """The robot in `robots/<name>`. Raises UnknownNameError."""
        if name not in self.robots:
            raise UnknownNameError("robot", name, self.robots)
        return load_robot(self.robot_folder(name))

    def settings(self, name: str) -> Path:
        """A settings file in `data/`."""
        return self.data / name

    def read(self, name: str, kind: type[T]) -> T:
        """The settings file `data/<name>` as `kind`. Raises SettingsError."""
        return settings.read(self.settings(name), kind)

    def validation(self, robot: str) -> ValidationSettings:
        """Rules and a robot's thresholds for policies. Raises SettingsError, for an unknown robot too."""
        return read_validation(self.settings("validation.yaml"), self.robot_folder(robot) / "validation.yaml")

    def expert_db(self, robot: str) -> Path:
        return self.data / "expert_db" / robot

    def exports(self, robot: str, kind: str) -> Path:
        """Folder of a robot's database in a format of `booster-lab export`."""
        return self.data / "exports" / robot / kind

    def actuators(self, robot: str) -> Path:
        """Folder of a robot's torque-speed measurements."""
        return self.data / "actuators" / robot

    @property
    def hardware_logs(self) -> Path:
        """Folder that logs of the robot are dropped into."""
        return self.data / "hardware_logs"

    def simulated_failures(self, robot: str, engine: str) -> Path:
        """Folder among the logs for failed trials of a robot's policy in simulation."""
        return self.hardware_logs / "simulation" / robot / engine

    @property
    def log_digests(self) -> Path:
        """Cache of the digests of logs."""
        return self.store.root / "log_digests.json"

    def adapted_robot(self, robot: str) -> Path:
        """Folder of the robot with calibrated motors, in the format of `robots/<robot>`."""
        return self.data / "adapted_robot" / robot

    @property
    def feedback(self) -> FeedbackFiles:
        """The files of proposed, approved and declined changes."""
        return FeedbackFiles(
            store=self.store,
            rules_file=self.settings("feedback_rules.yaml"),
            approved=self.data / "feedback" / "approved.yaml",
            declined=self.data / "feedback" / "declined.yaml",
        )

    @property
    def proposed_feedback(self) -> Path:
        """The file of proposed changes, in the format of `approved.yaml`."""
        return self.data / "feedback" / "proposed.yaml"

    @property
    def approval_token(self) -> Path:
        """File with the token that the approval jobs require."""
        return self.data / "feedback" / "approval_token"

    def policies(self, robot: str) -> Path:
        """Folder of a robot's policies that are trained and exported here."""
        return self.data / "policies" / robot

    def policy_runs(self, robot: str) -> Path:
        """Folder of a robot's training runs, one folder each."""
        return self.policies(robot) / "runs"

    def exported_policy(self, robot: str) -> Path:
        """Folder of the exported policy, trained here or shipped, in all formats."""
        return self.policies(robot) / "exported"

    def shipped_policies(self, robot: str) -> Path:
        """Folder of the policies that ship with the project."""
        return self.robot_folder(robot) / "policies"

    @property
    def training_lock(self) -> Path:
        """Lock file of trainings, held while one runs."""
        return self.data / "policies" / "lock"

    def release_report(self, robot: str) -> Path:
        """File of the release report."""
        return self.data / "release" / robot / "release_report.html"

    def policy_files(self, robot: str) -> tuple[Path, ...]:
        """Files of all available policies: shipped, exported here, and in the folder of the environment variable."""
        folders = [self.shipped_policies(robot), self.exported_policy(robot)]
        if os.environ.get(POLICIES_VARIABLE):
            folders.append(Path(os.environ[POLICIES_VARIABLE]).expanduser())
        found = (path for folder in folders for path in sorted(folder.rglob("*.npz")))
        return tuple(path for path in found if path.name != "golden.npz")

    @property
    def remembered_sources(self) -> Path:
        """File that records the sources of earlier runs."""
        return self.store.root / "sources.json"

    def sources(self) -> SourcesInUse:
        """The source folders of `data/sources.yaml`, of the environment variable, and of earlier runs."""
        return sources_in_use(self.settings("sources.yaml"), os.environ.get(VARIABLE, ""), self.remembered_sources)

    def source_of(self, path: Path, stated: Statement) -> Source:
        """The source of a file. Properties stated on the command line override those of the source.

        For a file outside all sources, the source is its folder.
        """
        path = path.resolve()
        for source in self._existing_sources:
            if path.is_relative_to(source.folder):
                below, above = source.statement_of(path), vars(stated).items()
                statement = dataclasses.replace(below, **{name: each for name, each in above if each is not None})
                licence = source.stated_licence_of(path)
                return dataclasses.replace(source, statement=statement, licence=licence, files=())
        return Source(name=path.parent.name or "file", folder=path.parent, statement=stated)

    @cached_property
    def _existing_sources(self) -> tuple[Source, ...]:
        """Sources whose folders exist; missing ones do not matter for a single file."""
        if (file := self.settings("sources.yaml")).is_file():
            variable = os.environ.get(VARIABLE, "")
            return sources_in_use(file, variable, self.remembered_sources, only_there=True).all
        return sources_of_environment(os.environ.get(VARIABLE, ""))


PROJECT = Project(Path(__file__).resolve().parents[2])


def find_project() -> Project:
    """The checkout around the working directory (with `data` and `robots`), else the one that contains this package.

    Raises PipelineError if there is neither.
    """
    for project in (Project(Path.cwd()), PROJECT):
        if project.data.is_dir() and (project.root / "robots").is_dir():
            return project
    raise PipelineError(
        "this folder has no 'data' and 'robots'; change to the project's folder and run the command again."
    )
