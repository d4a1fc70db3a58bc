"""The downstream comparison on a CPU at its smallest: two trackers are trained, held-out clips are rolled out."""

import dataclasses
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.retarget_downstream import GMR, OURS, ROOT, Recipe, bars_of, measured, rollouts, table, train
from benchmarks.retarget_downstream_clips import pieces_of, prepare
from benchmarks.retarget_runs import HandedOn
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import Robot
from pipeline.tracking.__main__ import main as tracking
from pipeline.tracking.bundle import read_tracking_bundle
from pipeline.tracking.nominal_rollout import NominalRollout
from tests.factories.human_clips import standing as person
from tests.factories.robot_clips import standing
from tests.factories.tracking_bundle import tracker_file

RECIPE = Recipe(device="cpu", num_envs=4, iterations=1)
IN_THIS_PROCESS = 1


def recordings(count: int) -> list[HandedOn]:
    human = person(seconds=1.0)
    names = [f"take{number}" for number in range(count)]
    return [HandedOn(file=Path(f"{name}.bvh"), human=dataclasses.replace(human, name=name)) for name in names]


def arms_raised(clip: RobotClip, robot: Robot, angle: float) -> RobotClip:
    joint_pos = clip.joint_pos.copy()
    joint_pos[:, robot.joint("Left_Shoulder_Pitch")] -= angle
    return dataclasses.replace(clip, joint_pos=joint_pos)


@pytest.fixture(scope="module")
def work(tmp_path_factory, robot: Robot) -> Path:
    """What is prepared from four recordings; one retargeter raises an arm, and cannot do the second recording."""
    folder = tmp_path_factory.mktemp("downstream")

    def ours(clip: HandedOn) -> RobotClip:
        return standing(robot, seconds=1.0, name=clip.human.name)

    def theirs(clip: HandedOn) -> RobotClip:
        if clip.human.name == "take1":
            raise ClipError("take1", "no_solution", "nothing is found", 3)
        return arms_raised(ours(clip), robot, 0.4)

    prepare(recordings(4), {OURS: ours, GMR: theirs}, folder, robot)
    return folder


def rolled(*survived: bool, error_m: float = 0.05) -> list[NominalRollout]:
    names = [f"clip{number}" for number in range(len(survived))]
    return [
        NominalRollout(
            clip=name, survived=each, body_error_m=error_m, joint_error_rad=0.1, path_error_m=0.1, seconds=2.0
        )
        for name, each in zip(names, survived, strict=True)
    ]


def test_both_get_the_same_clips_and_none_is_trained_on_and_held_out(work: Path):
    for name in (OURS, GMR):
        trained_on, held_out = (read_tracking_bundle(work / name / part).motions for part in ("trained_on", "held_out"))
        assert trained_on.names == ("take0", "take2"), "what one retargeter cannot do is left out of both"
        assert held_out.names == ("take3",)
    ours, theirs = (read_tracking_bundle(work / name / "held_out").motions.joint_pos for name in (OURS, GMR))
    assert np.abs(ours - theirs).max() == pytest.approx(0.4, abs=1e-6)


def test_fewer_recordings_than_one_is_held_out_of_are_refused(tmp_path: Path, robot: Robot):
    with pytest.raises(SystemExit, match="2 recordings leave nothing for 'held_out'"):
        prepare(recordings(2), {OURS: lambda clip: standing(robot, seconds=1.0)}, tmp_path, robot)


def test_held_out_clips_are_cut_into_pieces_without_a_frame_lost(robot: Robot):
    clip = standing(robot, seconds=5.0)
    clip = dataclasses.replace(clip, joint_pos=clip.joint_pos + np.arange(clip.frame_count)[:, None] * 1e-5)
    pieces = pieces_of(clip)
    assert [piece.name for piece in pieces] == [f"{clip.name}+0", f"{clip.name}+1"]
    assert np.array_equal(np.concatenate([piece.joint_pos for piece in pieces]), clip.joint_pos)
    (whole,) = pieces_of(pieces[0])
    assert whole.name == pieces[0].name
    assert whole.frame_count == pieces[0].frame_count


def run_here(command: list[str], cwd: Path, stdout: int | None) -> subprocess.CompletedProcess:
    """Instead of a process of its own, which imports torch for many seconds."""
    assert command[:3] == [sys.executable, "-m", "pipeline.tracking"]
    return subprocess.CompletedProcess(command, tracking(command[3:]))


def test_each_tracker_is_trained_once_and_follows_its_own_clips(work: Path, monkeypatch):
    monkeypatch.setattr("benchmarks.retarget_downstream.subprocess", SimpleNamespace(run=run_here, DEVNULL=None))
    found = measured(work, RECIPE, 1, IN_THIS_PROCESS)
    assert [each.clip for name in (OURS, GMR) for each in found[name]] == ["take3", "take3"]
    trackers = [work / name / "seed1" / "tracker.npz" for name in (OURS, GMR)]
    weights = [np.load(path)["L0_w"] for path in trackers]
    assert not np.array_equal(*weights), "they were trained on different motions"
    trained_at = [path.stat().st_mtime_ns for path in trackers]
    again = measured(work, RECIPE, 1, IN_THIS_PROCESS)
    assert again == found
    assert [path.stat().st_mtime_ns for path in trackers] == trained_at
    other = dataclasses.replace(RECIPE, iterations=2)
    with pytest.raises(SystemExit, match="has a tracker of another recipe"):
        train(work / OURS / "trained_on", work / OURS / "seed1", other, 1)
    assert table({1: found}).count("\n") == 4


def test_a_robot_that_stands_survives_and_one_thrown_over_does_not(work: Path, tmp_path: Path, robot: Robot):
    thrown_over = np.full(len(robot.controlled), 4.0)
    for name, changed, survives in (("still", {}, True), ("thrown", {"L1_b": thrown_over}, False)):
        tracker = tracker_file(tmp_path / f"{name}.npz", robot, **changed)
        (rolled_out,) = rollouts(work / OURS / "held_out", work / "adapted_robot" / "t1", tracker, IN_THIS_PROCESS)
        assert rolled_out.survived == survives


def test_the_bar_holds_where_ours_survives_a_clip_more():
    found = {
        1: {OURS: rolled(True, True), GMR: rolled(True, False)},
        2: {OURS: rolled(True, False), GMR: rolled(False, True)},
    }
    bars = {bar.name: bar for bar in bars_of(found)}
    assert bars["seed 1: survival, ours minus GMR's"].value == 50.0
    assert bars["seed 1: survival, ours minus GMR's"].holds
    assert not bars["seed 2: survival, ours minus GMR's"].holds, "as many survive"


def test_the_table_has_a_row_a_seed_and_their_mean():
    found = {
        1: {OURS: rolled(True, True, error_m=0.04), GMR: rolled(True, False, error_m=0.06)},
        2: {OURS: rolled(True, False, error_m=0.06), GMR: rolled(False, False, error_m=0.10)},
    }
    rows = table(found).splitlines()
    assert "2 held-out clips" in rows[0]
    assert rows[2:] == ["| 1 | 50 | 100 | 6.0 | 4.0 |", "| 2 | 0 | 50 | 10.0 | 6.0 |", "| mean | 25 | 75 | 8.0 | 5.0 |"]


def test_training_and_rollouts_need_no_package_that_a_gpu_host_lacks():
    absent = ("pyarrow", "placo", "pinocchio", "dagster")
    check = f"import sys; sys.modules.update(dict.fromkeys({absent})); import benchmarks.retarget_downstream"
    subprocess.run([sys.executable, "-c", check], check=True, cwd=ROOT)
