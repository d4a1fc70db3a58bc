"""What needs no evaluation of its own has the results that it would have had."""

import dataclasses
import functools
import logging
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.augment import AugmentSettings
from pipeline.augment import process as augment
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.clips.robot_clip import RobotClip
from pipeline.deployment import load_policy
from pipeline.feasibility import FeasibilitySettings, criteria_table, image, process
from pipeline.feasibility.criteria_table import with_origins
from pipeline.feasibility.evaluated import criteria_of_pieces, together, with_evaluated, without_evaluated
from pipeline.feasibility.image import LastAssessed, is_image, nothing_assessed, pair
from pipeline.feasibility.judgement import NUMBER, from_text
from pipeline.files import settings
from pipeline.files.sourced import origins
from pipeline.robot import Robot, load_robot
from pipeline.robot.mirror_image import mirror_clip
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.run import run
from pipeline.validation.deployed import deployed
from tests.conftest import ROOT
from tests.factories.policy_walks import steady_command
from tests.factories.robot_clips import standing, wandering

FILE = ROOT / "data" / "feasibility.yaml"
LIMITS, ORIGINS = settings.read(FILE, FeasibilitySettings), origins(settings.read_yaml(FILE))
T1 = load_robot(ROOT / "robots/t1")
HERE, LOG = ClipPool(backend="sequential"), logging.getLogger("test")
SAME_FIGURE = 1e-7
"""[SI units] Criteria of a motion and of its mirror image may differ by so much."""


def bent(clip: RobotClip, robot: Robot, joint: str = "Left_Elbow_Yaw") -> RobotClip:
    """An arm joint 0.2 rad past its limit in the middle."""
    index, frames = robot.joint(joint), np.arange(clip.frame_count)
    level = np.interp(frames, [115, 140, 159, 184], [0.0, 1.0, 1.0, 0.0])
    joints = clip.joint_pos.copy()
    joints[:, index] += level * (robot.joint_upper[index] + 0.2 - joints[:, index])
    return dataclasses.replace(clip, joint_pos=joints)


@functools.cache
def curve() -> RobotClip:
    """The shipped policy of the T1 on a curve to the left, with the simulation's contacts and without its forces."""
    one = deployed(ROOT / "robots/t1", load_policy(ROOT / "robots/t1/policies/walk/policy.npz"))
    plant = MujocoPlant(T1, MujocoOptions(timestep_s=0.005))
    made = run(T1, plant, one.controller(), one.motors(), steady_command(0.5, 0.1, 0.4), 5.0)
    return dataclasses.replace(made.clip("walk", start_s=1.0), forces=None)


def motions(robot: Robot) -> dict[str, RobotClip]:
    """Motions of which some pass, one is cut, and one is rejected."""
    found = {"still": standing(robot), "wandering": wandering(robot, 3.0)}
    if robot.name == "t1":
        found |= {"walk": curve(), "bent": bent(standing(robot, 6.0), robot)}
    return {name: dataclasses.replace(clip, name=name) for name, clip in found.items()}


def kp5(name: str, robot: Robot) -> Stage:
    function = partial(process, settings=LIMITS, robot=robot)
    return Stage(
        name=name,
        version="1",
        function=function,
        prepare=nothing_assessed,
        together=pair,
        settings=settings.plain(LIMITS),
    )


def variants(store: Store, robot: Robot) -> Manifest:
    """Each motion and its mirror image, both at another speed too."""
    values = dataclasses.replace(settings.read(ROOT / "data/augment.yaml", AugmentSettings), time_scales=(1.1,))
    pieces = [
        piece for clip in motions(robot).values() for piece in augment(clip, {}, settings=values, robot=robot).pieces
    ]
    entries = [
        Entry(clip=piece.clip.name, blob=store.put_clip(piece.clip), numbers=dict(piece.numbers)) for piece in pieces
    ]
    return Manifest(stage="variants", entries=tuple(entries), judged=())


@pytest.mark.parametrize("name", ["t1", "k1"])
def test_a_mirror_image_has_the_figures_of_its_own_evaluation(name: str, monkeypatch: pytest.MonkeyPatch):
    robot = load_robot(ROOT / "robots" / name)
    for clip in motions(robot).values():
        mirrored, numbers = mirror_clip(clip, robot, f"{clip.name}~mirror"), {"mirrored": True}
        assert is_image(mirrored, numbers, robot)
        found = process(mirrored, numbers, settings=LIMITS, robot=robot)
        with monkeypatch.context() as patch:
            patch.setattr(image, "is_symmetric", lambda robot: False)
            own = process(mirrored, numbers, settings=LIMITS, robot=robot)
        assert [reason.text for reason in found.reasons] == [reason.text for reason in own.reasons]
        assert [piece.clip.name for piece in found.pieces] == [piece.clip.name for piece in own.pieces]
        for one, other in zip(found.pieces, own.pieces, strict=True):
            assert isinstance(one.clip, RobotClip) and isinstance(other.clip, RobotClip)
            np.testing.assert_array_equal(one.clip.joint_pos, other.clip.joint_pos)
            np.testing.assert_array_equal(one.clip.root_pos_w, other.clip.root_pos_w)
            texts = {key for key, value in other.numbers.items() if isinstance(value, str)}
            assert {key: one.numbers[key] for key in texts} == {key: other.numbers[key] for key in texts}
            figures = {key: value for key, value in other.numbers.items() if key not in texts}
            assert {key: one.numbers[key] for key in figures} == pytest.approx(figures, abs=SAME_FIGURE)
        for one, other in zip(*(from_text(str(each.numbers[NUMBER])) for each in (found, own)), strict=True):
            assert {code: each.broken for code, each in one.found.items()} == {
                code: each.broken for code, each in other.found.items()
            }


def test_an_image_of_a_motion_that_was_evaluated_before_it_is_the_same(robot: Robot):
    for clip in motions(robot).values():
        mirrored, last = mirror_clip(clip, robot, f"{clip.name}~mirror"), LastAssessed()
        process(clip, {}, settings=LIMITS, robot=robot, prepared=last)
        shared = process(mirrored, {"mirrored": True}, settings=LIMITS, robot=robot, prepared=last)
        alone = process(mirrored, {"mirrored": True}, settings=LIMITS, robot=robot)
        assert shared.numbers == alone.numbers and shared.reasons == alone.reasons
        assert [piece.numbers for piece in shared.pieces] == [piece.numbers for piece in alone.pieces]
        own = process(clip, {}, settings=LIMITS, robot=robot)
        after = process(clip, {}, settings=LIMITS, robot=robot, prepared=last)
        assert after.numbers == own.numbers
        assert [piece.clip.name for piece in after.pieces] == [piece.clip.name for piece in own.pieces]


def test_an_image_that_passes_is_not_evaluated(robot: Robot, monkeypatch: pytest.MonkeyPatch):
    walk = motions(robot)["walk"]
    last = LastAssessed()
    assert process(walk, {}, settings=LIMITS, robot=robot, prepared=last).pieces
    monkeypatch.setattr(image, "assess", None)
    mirrored = mirror_clip(walk, robot, "walk~mirror")
    (piece,) = process(mirrored, {"mirrored": True}, settings=LIMITS, robot=robot, prepared=last).pieces
    assert piece.clip.name == "walk~mirror"


def test_limits_of_an_image_are_those_of_its_own_joints(robot: Robot):
    """The upper limit of one knee is lowered: only the image of a walk that bends the other one far breaks it."""
    walk = motions(robot)["walk"]
    knee, other = (robot.joint(f"{side}_Knee_Pitch") for side in ("Left", "Right"))
    upper = robot.joint_upper.copy()
    upper[knee] = walk.joint_pos[:, other].max() - 0.3
    joints = walk.joint_pos.copy()
    joints[:, knee] = np.minimum(joints[:, knee], upper[knee])
    lame = dataclasses.replace(robot, joint_upper=upper)
    walk = dataclasses.replace(walk, joint_pos=joints)
    codes = [
        {reason.code for reason in process(clip, numbers, settings=LIMITS, robot=lame).reasons}
        for clip, numbers in ((walk, {}), (mirror_clip(walk, lame, "image"), {"mirrored": True}))
    ]
    assert "joint_limit_excess" not in codes[0]
    assert "joint_limit_excess" in codes[1]


def test_a_robot_with_one_longer_shank_is_not_symmetric(robot: Robot):
    tree = robot.tree
    pos = tree.pos.copy()
    pos[robot.link("Shank_Left"), 2] -= 1e-4
    lame = dataclasses.replace(robot, tree=dataclasses.replace(tree, pos=pos))
    assert image.asymmetry(robot) < image.TOLERANCE_M < image.asymmetry(lame)


def test_rollouts_are_evaluated_by_themselves(robot: Robot):
    clip = standing(robot)
    assert is_image(clip, {"mirrored": True}, robot)
    assert not is_image(clip, {"mirrored": False}, robot)
    assert not is_image(clip, {"mirrored": True, "reference": "walk~mirror"}, robot)
    assert not is_image(clip, {"mirrored": True, "tracks_content": "ab"}, robot)


def test_what_left_kp5_has_the_same_results_without_a_second_evaluation(robot: Robot, tmp_path: Path):
    store = Store(root=tmp_path)
    references = run_stage(kp5("reference_motions", robot), variants(store, robot), store, HERE, LOG)
    references, criteria = criteria_table.split(references, ORIGINS)
    assert {entry.clip for entry in references.entries} >= {"walk", "walk~mirror", "bent+0", "bent~mirror+1"}
    stage = kp5("feasible_motions", robot)
    expected, rows = criteria_table.split(run_stage(stage, references, store, HERE, LOG), ORIGINS)
    names = [entry.clip for entry in references.entries]
    for at_hand in (names, names[::2]):
        rest, known = without_evaluated(references, stage, at_hand)
        assert [entry.clip for entry in known] == at_hand and len(rest.entries) == len(names) - len(at_hand)
        own = with_origins(criteria_of_pieces(criteria, known), ORIGINS)
        found, others = criteria_table.split(run_stage(stage, rest, store, HERE, LOG), ORIGINS)
        found = with_evaluated(found, stage, known)
        assert found.to_text() == expected.to_text()
        pd.testing.assert_frame_equal(together([others, own]), rows)


def test_other_thresholds_or_another_robot_evaluate_again(robot: Robot, tmp_path: Path):
    store = Store(root=tmp_path)
    before = Manifest(
        stage="variants", entries=(Entry(clip="still", blob=store.put_clip(standing(robot)), numbers={}),), judged=()
    )
    stage = kp5("reference_motions", robot)
    references = run_stage(stage, before, store, HERE, LOG)
    assert len(without_evaluated(references, stage, ["still"])[1]) == 1
    for other in ({"version": "2"}, {"settings": {}}, {"depends": {"robot_files": "other"}}):
        rest, known = without_evaluated(references, dataclasses.replace(stage, **other), ["still"])
        assert len(rest.entries) == 1 and not known
    assert not without_evaluated(references, stage, [])[1]
