"""The K1's tables against the figures that were read from its maker's files independently (../shared/facts/K1)."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from pipeline.robot import load_robot
from pipeline.robot.load import ROBOTS
from tests.conftest import shared_folder

JOINTS = {
    "lower": "urdf_lower_rad",
    "upper": "urdf_upper_rad",
    "torque": "urdf_effort_Nm",
    "urdf_speed": "urdf_velocity_rad_s",
    "motor_speed": "velocity@booster_train_b77e0e9",
    "armature": "armature@booster_train_b77e0e9",
    "kp": "kp@booster_deploy_K1WalkControllerCfg",
    "kd": "kd@booster_deploy_K1WalkControllerCfg",
    "default_pos": "q0@booster_deploy_K1WalkControllerCfg",
}
"""Column of joints.csv -> column of the facts."""
ARMS = ("Head", "Shoulder", "Elbow")
"""Parts of the names of joints whose gains are those of the motor models of booster_train."""
MOTOR_MODELS = "{}@booster_train_later(actuator.py:motor models;legs 4Hz,zeta1.5(knee 1.0);arms/head 10Hz,zeta2)"
"""Column of the facts with the gains of these models; kp and kd are computed from their rule."""
LINKS = {
    "mass": "mass_kg",
    **{axis: f"origin_{axis}" for axis in ("x", "y", "z", "roll", "pitch", "yaw")},
    **{name: name for name in ("com_x", "com_y", "com_z", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
}


@pytest.fixture(scope="module")
def facts() -> Path:
    return shared_folder("facts", "the tables of the makers' figures") / "K1"


def column_of(facts_column: str, column: str, name: str) -> str:
    """Where the facts have a figure of a joint or link."""
    arm = column in ("kp", "kd") and any(part in name for part in ARMS)
    return MOTOR_MODELS.format(column) if arm else facts_column


def table(path: Path, key: str) -> dict[str, dict[str, str]]:
    with path.open() as stream:
        return {row[key]: row for row in csv.DictReader(stream)}


@pytest.mark.shared
@pytest.mark.parametrize(("file", "key", "columns"), [("joints.csv", "joint", JOINTS), ("links.csv", "link", LINKS)])
def test_every_number_of_a_table_is_the_makers(facts: Path, file: str, key: str, columns: dict[str, str]):
    ours, theirs = table(ROBOTS / "k1" / file, key), table(facts / file, key)
    assert list(ours) == list(theirs)
    wrong = {
        (name, column): (row[column], theirs[name][column_of(other, column, name)])
        for name, row in ours.items()
        for column, other in columns.items()
        if float(row[column] or 0.0)
        != pytest.approx(float(theirs[name][column_of(other, column, name)] or 0.0), rel=1e-6, abs=1e-9)
    }
    assert wrong == {}


def test_its_mass_is_the_published_one():
    assert load_robot("k1").total_mass == pytest.approx(19.7, abs=0.05)
