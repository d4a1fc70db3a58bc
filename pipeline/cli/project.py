"""The project a command works in: settings, robots, sources and store of one checkout."""

import dataclasses
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from pipeline.batch import Store
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.files import settings
from pipeline.readers import Source, Statement, sources_in_use, sources_of_environment
from pipeline.robot import Robot, load_robot
from pipeline.validation.bars import ValidationSettings, read_validation

MOTIONS_VARIABLE = "BOOSTER_LAB_MOTIONS"

T = TypeVar("T")


@dataclass(frozen=True)
class Project:
    """A checkout of the project."""

    root: Path

    @property
    def store(self) -> Store:
        return Store(root=self.root / "data" / "store")

    @property
    def remembered_sources(self) -> Path:
        """File that records the sources that runs have used."""
        return self.store.root / "sources.json"

    def settings(self, name: str, kind: type[T]) -> T:
        """The settings file `data/<name>` as `kind`."""
        return settings.read(self.root / "data" / name, kind)

    def validation(self, robot: str) -> ValidationSettings:
        """Rules and the robot's thresholds for policies. Raises UnknownNameError."""
        return read_validation(self.root / "data" / "validation.yaml", self.robot_folder(robot) / "validation.yaml")

    def robot(self, name: str) -> Robot:
        """The robot in `robots/<name>`. Raises UnknownNameError."""
        return load_robot(self.robot_folder(name))

    def robot_folder(self, name: str) -> Path:
        """The folder `robots/<name>`. Raises UnknownNameError."""
        names = sorted(path.parent.name for path in (self.root / "robots").glob("*/robot.toml"))
        if name not in names:
            raise UnknownNameError("robot", name, names)
        return self.root / "robots" / name

    def source_of(self, path: Path, stated: Statement) -> Source:
        """The source a file belongs to, with what was stated on the command line put over what the source states.

        A file outside all sources makes up a source of its own: its folder.
        """
        path = path.resolve()
        for source in self._sources:
            if path.is_relative_to(source.folder):
                return dataclasses.replace(
                    source,
                    statement=_over(source.statement_of(path), stated),
                    licence=source.stated_licence_of(path),
                    files=(),
                )
        return Source(name=path.parent.name or "file", folder=path.parent, statement=stated)

    @cached_property
    def _sources(self) -> tuple[Source, ...]:
        file, variable = self.root / "data" / "sources.yaml", os.environ.get(MOTIONS_VARIABLE, "")
        if not file.is_file():
            return sources_of_environment(variable)
        return sources_in_use(file, variable, self.remembered_sources).all


def find_project() -> Project:
    """The checkout that is worked in (it has `data` and `robots`), else the one that contains this package.

    Raises PipelineError when there is neither.
    """
    for root in (Path.cwd(), Path(__file__).resolve().parents[2]):
        if (root / "data").is_dir() and (root / "robots").is_dir():
            return Project(root)
    raise PipelineError("this folder has no 'data' and 'robots'; change to the project's folder and try again.")


def _over(below: Statement, above: Statement) -> Statement:
    stated = {name: value for name, value in vars(above).items() if value is not None}
    return dataclasses.replace(below, **stated)
