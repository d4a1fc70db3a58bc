"""A folder of measurements: what changed is calibrated anew, and nothing else."""

import shutil
from pathlib import Path

import pytest

from pipeline.actuators.folder import calibrate_folder, read_published
from pipeline.batch import Store
from pipeline.errors import FileError
from pipeline.viewing.plots import calibration_curves
from tests.factories.sweeps import SETTINGS


@pytest.fixture
def folder(root: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(root / "data/actuators/t1", tmp_path / "t1"))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(root=tmp_path / "store")


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_only_motors_whose_question_changed_are_calibrated_anew(folder: Path, store: Store):
    first = calibrate_folder(folder, SETTINGS, "1", store)
    assert len(first.recomputed) == 13
    again = calibrate_folder(folder, SETTINGS, "1", store)
    assert again.recomputed == () and again.calibrations == first.calibrations
    replace(folder / "knee.csv", "48.0", "48.1")
    assert calibrate_folder(folder, SETTINGS, "1", store).recomputed == ("knee",)
    replace(folder / "motors.csv", "161.7e-6", "161.8e-6")
    assert calibrate_folder(folder, SETTINGS, "1", store).recomputed == ("hip_pitch",)
    replace(folder / "motors.csv", "161.8e-6", "161.7e-6")
    assert calibrate_folder(folder, SETTINGS, "1", store).recomputed == ()
    assert len(calibrate_folder(folder, SETTINGS, "2", store).recomputed) == 13


def test_missing_and_broken_files_are_refused_motor_by_motor_and_strangers_named(folder: Path, store: Store):
    (folder / "waist.csv").unlink()
    (folder / "knee.csv").write_bytes(b"\xff\xfe\x00knee")
    (folder / "tail.csv").write_text("what is this")
    found = calibrate_folder(folder, SETTINGS, "1", store)
    refused = {each.motor: each.verdict for each in found.calibrations if not each.accepted}
    assert set(refused) == {"waist", "knee"}
    assert "there is no such measurement file" in refused["waist"]
    assert found.unused == ("tail.csv",)
    assert calibration_curves(found.calibrations, {}).startswith(b"\x89PNG")


def test_a_robot_without_measurements_has_no_motors(tmp_path: Path, store: Store):
    assert calibrate_folder(tmp_path / "none", SETTINGS, "1", store).calibrations == ()


def test_a_folder_without_a_motor_table_is_refused(folder: Path, store: Store):
    (folder / "motors.csv").unlink()
    with pytest.raises(FileError, match="It names the motors"):
        calibrate_folder(folder, SETTINGS, "1", store)


def test_the_curves_are_a_picture_the_same_every_time(folder: Path, store: Store):
    found = calibrate_folder(folder, SETTINGS, "1", store)
    published = {motor.name: read_published(folder)[motor.model] for motor in found.motors}
    pictures = [calibration_curves(found.calibrations, published) for _ in range(2)]
    assert pictures[0] == pictures[1] and pictures[0].startswith(b"\x89PNG")
