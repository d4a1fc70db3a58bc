"""Inputs of a campaign of faults, run as in their `expected.md`. The cases of whole runs have tests elsewhere:

database_folder_is_symlink (tests/expert/test_database_history), emptied_source_folder (tests/expert/test_database),
log_digests_null (tests/assets/test_hardware_trials), log_folder_named_txt and log_long_name_refused
(tests/hardware_logs/test_quarantine), store_blobs_gone (tests/batch/test_memory), viewer_html_in_name
(tests/viewing/test_viewer_in_browser, tests/command/test_web_ui).
"""

import json
import os
import shutil
import subprocess
import sys

import pytest

from pipeline.actuators.motor_table import read_motors
from pipeline.actuators.settings import ActuatorSettings
from pipeline.cli.main import main
from pipeline.errors import FileError
from pipeline.files import settings

pytestmark = pytest.mark.shared


def test_errors_keep_their_text_across_processes(root, cases):
    script, environment = cases / "errors_cross_processes/check.py", {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


@pytest.mark.parametrize(
    ("case", "sentence"),
    [
        ("policy_0d_joint_names", "'joint_names' is not a list of names."),
        ("policy_wrong_size", "the policy has 8 observations and 3 actions; robot 't1' takes 720 and 21"),
    ],
)
def test_a_policy_that_can_not_be_used_is_one_sentence(cases, capsys, case, sentence):
    assert main(["validate", str(cases / case / "policy.npz")]) == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("parts of the trials")]
    assert len(lines) == 1 and sentence in lines[0]  # a slow machine shows progress before


@pytest.mark.parametrize(("case", "note"), [("index_csv_long_field", "broken_index"), ("licence_file_of_holes", None)])
def test_a_motion_beside_a_bad_licence_file_is_read_without_a_licence(root, cases, tmp_path, capsys, case, note):
    subprocess.run(["sh", cases / case / "make.sh"], cwd=tmp_path, check=True)
    shutil.copy(root / "data/motions/walk.bvh", tmp_path / "a.bvh")
    assert main(["inspect", str(tmp_path / "a.bvh"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["licence"] == "unknown"
    assert [reason["code"] for reason in found["reasons"]] == ([note] if note else [])


def test_a_motor_table_in_latin_1_is_named_with_its_line(root, cases):
    values = settings.read(root / "data/actuators.yaml", ActuatorSettings)
    with pytest.raises(FileError, match=r"motors\.csv, line 1: the byte 0xb1 is no UTF-8 text"):
        read_motors(cases / "motors_csv_latin1/motors.csv", values.model)
