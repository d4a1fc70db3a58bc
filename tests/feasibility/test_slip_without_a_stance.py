"""Where no foot stands long enough, slip is not asked, and the judgement says why."""

import dataclasses
from pathlib import Path

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings, assess
from pipeline.feasibility.judgement import Judgement, judge
from pipeline.feasibility.motion import motion_of
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing

FILE = Path(__file__).resolve().parents[2] / "data" / "feasibility.yaml"
LIMITS = settings.read(FILE, FeasibilitySettings)


def _judgement(clip: RobotClip, robot: Robot) -> Judgement:
    return judge(assess(motion_of(clip, robot, LIMITS), LIMITS), (), 0)


def test_a_foot_that_is_down_for_two_frames_is_no_stance_to_slip_in(robot: Robot):
    """Slip is not asked of the first and last frame of a contact: a difference there sees the swing."""
    clip = standing(robot)
    contacts = np.zeros((clip.frame_count, 2), dtype=bool)
    for length, said in ((2, "no foot is in contact"), (3, "")):
        contacts[40 : 40 + length] = True
        found = _judgement(dataclasses.replace(clip, contacts=contacts), robot).found
        assert {found[code].not_applicable for code in ("foot_slip_mean", "foot_slip_p95")} == {said}
        assert found["foot_inferred_slip_mean"].not_applicable == "", "the soles tell that both stand"


def test_where_no_sole_is_down_there_is_no_stance_either(robot: Robot):
    clip = standing(robot)
    above = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array([0.0, 0.0, 0.05]))
    for labelled, asked in ((True, "foot_slip_p95"), (False, "foot_glide_s")):
        found = _judgement(above if labelled else dataclasses.replace(above, contacts=None), robot).found
        assert found["foot_inferred_slip_mean"].not_applicable == "no foot is in contact"
        assert found[asked].not_applicable == ""


def test_where_of_two_feet_each_slides_in_its_only_inner_frame_none_is_held_to_stand(robot: Robot):
    """Each is down for three frames, and in the one of which slip may be asked the other is the slower one."""
    motion = motion_of(dataclasses.replace(standing(robot), contacts=None), robot, LIMITS)
    contacts = np.zeros((motion.clip.frame_count, 2), dtype=bool)
    contacts[50:53, 0] = contacts[51:54, 1] = True
    velocity = motion.sole.corner_vel_w.copy()
    velocity[51, 0, :, 0] = velocity[52, 1, :, 0] = 0.5
    soles = dataclasses.replace(motion.sole, corner_vel_w=velocity)
    for fast, said in ((soles, "no foot is in contact"), (motion.sole, "")):
        assessed = assess(dataclasses.replace(motion, sole=fast, contacts=contacts), LIMITS)
        found = judge(assessed, (), 0).found
        assert {found[code].not_applicable for code in ("foot_inferred_slip_mean", "foot_slip_p95")} == {said}
        assert found["foot_slip_mean"].not_applicable == "no contact labels"
