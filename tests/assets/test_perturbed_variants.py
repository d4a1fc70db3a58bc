"""Failures in logs become variants in KP4's result: of the skill that failed, and of no other."""

import dataclasses
import logging
from collections.abc import Sequence
from functools import partial

import pytest

from assets.reference_motions import all_variants, with_further_variants
from pipeline.augment import AugmentSettings, Strengths, process
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.clips.robot_clip import RobotClip
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.approved import part_of
from pipeline.files import settings
from pipeline.retarget import RetargetSettings
from pipeline.retarget import process as retarget
from pipeline.robot import Robot, load_robot
from tests.factories.human_clips import Gait, walker
from tests.factories.trial_reports import DATA, failure, proposal, report

VALUES = settings.read(DATA / "augment.yaml", AugmentSettings)
SKILLS = {"left": "side_left", "right": "side_right", "ahead": "walk"}
"""What the clips are called -> what they are said to be."""


class Kp4:
    """The stage on three clips with a store of its own."""

    def __init__(self, store: Store, robot: Robot, clip: RobotClip):
        self.store, self.robot = store, robot
        entries = tuple(
            Entry(clip=name, blob=store.put_clip(clip), numbers={"skill": skill, "seconds": clip.duration_s})
            for name, skill in SKILLS.items()
        )
        self.retargeted = Manifest(stage="retargeted_motions", entries=entries, judged=())

    def variants(self, *reports: TrialReport) -> Manifest:
        """With all that is proposed approved."""
        feedback = part_of(proposal(*reports).changes, "augmentation", "t1")
        return all_variants(self.retargeted, VALUES, feedback, self.make)

    def make(self, wanted: AugmentSettings, entries: Sequence[Entry]) -> Manifest:
        function = partial(process, settings=wanted, robot=self.robot)
        stage = Stage(name="motion_variants", version="1", function=function, settings=settings.plain(wanted))
        pool, log = ClipPool(backend="sequential"), logging.getLogger("test")
        return run_stage(stage, self.retargeted, self.store, pool, log, entries)


@pytest.fixture(scope="module")
def kp4(tmp_path_factory: pytest.TempPathFactory) -> Kp4:
    robot = load_robot("t1")
    limits = settings.read(DATA / "retarget.yaml", RetargetSettings)
    (piece,) = retarget(walker(seconds=3.0, gait=Gait(speed_m_s=1.1)), {}, settings=limits, robot=robot).pieces
    assert isinstance(piece.clip, RobotClip)
    return Kp4(Store(root=tmp_path_factory.mktemp("store")), robot, piece.clip)


def _new(kp4: Kp4, *reports: TrialReport) -> dict[str, dict]:
    """Numbers of the variants that are there because of the reports."""
    there = {entry.clip for entry in kp4.variants().entries}
    made = kp4.variants(*reports)
    assert there < {entry.clip for entry in made.entries}
    return {entry.clip: entry.numbers for entry in made.entries if entry.clip not in there}


@pytest.mark.parametrize(
    ("planted", "mark", "strength"),
    [
        (failure("slip"), "step_length0.9", {"step_length": 0.9}),
        (failure("stumble"), "foot_lift0.02", {"foot_lift_m": 0.02}),
        (failure(direction="left"), "step_width0.02", {"step_width_m": 0.02}),
        (failure(direction="forward"), "trunk_lean-2", {"trunk_lean_deg": -2.0}),
    ],
    ids=["slip", "stumble", "sideways fall", "forward fall"],
)
def test_what_failed_sideways_left_is_perturbed_for_that_skill_alone(kp4: Kp4, planted, mark, strength):
    found = {clip: numbers for clip, numbers in _new(kp4, report(1, planted)).items() if "~x" not in clip}
    assert set(found) == {f"left~{mark}", f"right~mirror~{mark}"}
    for numbers in found.values():
        assert numbers["skill"] == "side_left" and numbers["parent"] in ("left", "right")
        assert strength.items() <= numbers.items()


def test_clips_that_are_not_asked_for_are_not_worked_on_again(kp4: Kp4):
    kp4.variants()
    twice = (report(1, failure("slip")), report(2, failure("slip")))
    assert kp4.variants(*twice).recomputed == 2, "the clips of both sides"
    assert kp4.variants(*twice).recomputed == 0
    assert kp4.variants().recomputed == 0


def test_taking_an_approval_back_gives_the_same_result_as_before(kp4: Kp4):
    before = kp4.variants().to_text()
    assert kp4.variants(report(1, failure("stumble"))).to_text() != before
    assert kp4.variants().to_text() == before


def test_a_perturbation_that_a_clip_cannot_follow_is_a_reason_beside_it(kp4: Kp4):
    asked = dataclasses.replace(VALUES, perturbations=Strengths(foot_lift=(0.08,)))
    made = kp4.make(asked, [entry for entry in kp4.retargeted.entries if entry.clip == "ahead"])
    rows = {row.clip: row for row in with_further_variants(kp4.variants(), made, "walk").judged}
    assert [reason["code"] for reason in rows["ahead"].reasons] == ["joint_limit"] * 2
    assert rows["ahead"].reasons[1]["text"].startswith("mirror~foot_lift0.08 is not made: frame")
    assert not rows["left"].reasons
