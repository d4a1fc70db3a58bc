"""Contact sheets: what is in the picture, how large it is, and that it is the same every time."""

import dataclasses
import io

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from pipeline import rotation
from pipeline.viewing import projection
from pipeline.viewing.contact_sheet import LARGE, contact_sheet
from pipeline.viewing.figure import Figure, Part, Shape
from pipeline.viewing.human_figure import human_figure
from pipeline.viewing.playlist import Shown
from pipeline.viewing.plots import lost_seconds
from tests.factories.figures import gliding_human, standing_robot, tumbling_robot

MAX_BYTES = 100_000


def _pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float) / 255


def _sheet(human, clip, robot, poses: int = 8) -> bytes:
    return contact_sheet([Shown(name="walk", human=human, robot_clip=clip)], robot, poses, LARGE)


def _ball(pos_w) -> Figure:
    """A small sphere per row of `pos_w`, one frame."""
    parts = tuple(
        Part(name=str(index), shapes=(Shape(kind="sphere", size=(0.05,), color=(1.0, index / 2, 0.0)),))
        for index in range(len(pos_w))
    )
    return Figure(
        name="balls",
        fps=50.0,
        parts=parts,
        pos_w=np.array([pos_w], dtype=float),
        quat_w=np.tile(rotation.IDENTITY, (1, len(pos_w), 1)),
        root_pos_w=np.zeros((1, 3)),
        heading=np.zeros(1),
    )


def test_a_sheet_is_small(robot):
    assert len(_sheet(gliding_human(), tumbling_robot(robot), robot)) < MAX_BYTES


def test_the_same_clips_give_the_same_bytes(robot):
    human, clip = gliding_human(), standing_robot(robot)
    assert _sheet(human, clip, robot) == _sheet(human, clip, robot)


def test_human_and_robot_together_are_higher_than_each_alone(robot):
    human, clip = gliding_human(), standing_robot(robot)
    both, one, other = (_pixels(_sheet(*pair, robot)).shape[0] for pair in ((human, clip), (human, None), (None, clip)))
    assert both > one > other


def test_a_shoe_is_green_only_while_the_foot_is_on_the_ground():
    human = gliding_human(frame_count=3)

    def green(contacts) -> int:
        picture = _pixels(_sheet(dataclasses.replace(human, contacts=contacts), None, None, poses=3))
        return int(((picture[..., 1] > 1.8 * picture[..., 0]) & (picture[..., 1] > 1.8 * picture[..., 2])).sum())

    never, always = np.zeros((3, 2), dtype=bool), np.ones((3, 2), dtype=bool)
    once = never.copy()
    once[1, 0] = True
    assert green(None) == green(never) == 0
    assert 0 < green(once) < green(always)


def test_a_frame_without_any_joint_is_called_missing():
    human = gliding_human(frame_count=3)
    pos = human.body_pos_w.copy()
    pos[1] = np.nan
    whole = _pixels(_sheet(human, None, None, poses=3))
    holed = _pixels(_sheet(dataclasses.replace(human, body_pos_w=pos), None, None, poses=3))
    third = whole.shape[1] // 3
    same = np.abs(whole - holed).max(axis=(0, 2)) < 0.4  # the palette moves colours a little
    assert same[: third - 20].all() and same[2 * third + 20 :].all()
    assert not same[third + 20 : 2 * third - 20].all()


def test_several_clips_are_stacked_in_one_picture_that_is_still_small(robot):
    strips = [
        Shown(name=f"clip {index}", note="torque 61 N m at the knee, 40 allowed", robot_clip=tumbling_robot(robot))
        for index in range(6)
    ]
    one, six = (_pixels(contact_sheet(part, robot)) for part in (strips[:1], strips))
    assert six.shape[1] == one.shape[1]
    assert six.shape[0] == pytest.approx(6 * one.shape[0], abs=6)
    assert len(contact_sheet(strips, robot)) < MAX_BYTES


def test_no_clip_at_all_still_gives_a_picture(robot):
    assert _pixels(contact_sheet([], robot)).size > 0


def test_up_is_up_and_forward_is_to_the_right():
    points = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]])
    origin, up, forward = projection.project(points)
    assert up[1] > origin[1] and up[0] == pytest.approx(origin[0])
    assert forward[0] > origin[0] + 0.5


def test_what_is_nearer_to_the_viewer_is_painted_last():
    near, far = projection.TO_VIEWER, -projection.TO_VIEWER
    triangles = projection.pose_triangles(_ball([near, far]), 0, 0.0)
    reds_with_green = [color[1] > 0 for color in triangles.colors]
    assert reds_with_green[0] and not reds_with_green[-1]
    assert reds_with_green == sorted(reds_with_green, reverse=True)


def test_the_initial_heading_is_taken_out():
    heading = 1.1
    turned = rotation.rotate(rotation.about_z(heading), np.array([[0.3, 0.1, 0.5]]))
    straight = projection.pose_triangles(_ball([[0.3, 0.1, 0.5]]), 0, 0.0)
    back = projection.pose_triangles(_ball(turned), 0, heading)
    middle = [np.mean(np.concatenate(each.corners), axis=0) for each in (straight, back)]
    assert np.allclose(middle[0], middle[1], atol=0.01)


def test_no_triangle_of_a_person_on_the_ground_is_below_the_sheet_of_ground():
    pose = projection.pose_triangles(human_figure(gliding_human()), 0, 0.0)
    ground = np.concatenate(projection.ground_triangles(0.36).corners)
    assert np.concatenate(pose.corners)[:, 1].min() > ground[:, 1].min()


def test_a_name_with_signs_of_formulas_is_a_name():
    strip = Shown(name=r"a $\frac{ b$ <c>", human=gliding_human())
    assert _pixels(contact_sheet([strip], None)).size > 0
    judged = pd.DataFrame([{"clip": r"a $\frac{ b$", "seconds_in": 2.0, "seconds_out": 1.0}])
    assert lost_seconds(judged, "lost")[:4] == b"\x89PNG"
