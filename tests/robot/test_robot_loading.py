"""A robot folder with a fault is refused with the file, the row, the problem and what to do."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import UnknownNameError
from pipeline.robot import Robot, RobotError, load_robot
from tests.factories.robot_folder import copy_robot, replace

SHANK = "Shank_Left,Hip_Yaw_Left,Left_Knee_Pitch,"
KNEE = "Left_Knee_Pitch,yes,0,2.1817,"
HEAD = "head,H2,sphere,both,shell,0.01,0,0.11,0,0,0,0.08,0,0"

FAULTS = {
    "a number that is none": ("joints.csv", KNEE, "Left_Knee_Pitch,yes,nan,2.1817,",
        r"joints.csv, line 16: joint 'Left_Knee_Pitch': lower is 'nan'. Write a finite number"),
    "a torque of zero": ("joints.csv", "2.1817,14.7,12.57,60,0.0636012,200,5,0.4\nLeft_Ankle_Pitch",
        "2.1817,14.7,12.57,0,0.0636012,200,5,0.4\nLeft_Ankle_Pitch",
        r"joints.csv, line 16: joint 'Left_Knee_Pitch': torque is 0. Write a number above 0"),
    "limits the wrong way round": ("joints.csv", KNEE, "Left_Knee_Pitch,yes,2.3,2.1817,",
        r"joints.csv, line 16: .*lower limit 2.3 rad is not below the upper limit 2.1817 rad. Swap"),
    "a default outside the limits": ("joints.csv", KNEE, "Left_Knee_Pitch,yes,0.5,2.1817,",
        r"default position 0.4 rad is outside its limits. Choose it in 0.5 to 2.1817"),
    "a word for yes or no": ("joints.csv", KNEE, "Left_Knee_Pitch,true,0,2.1817,",
        r"controlled is 'true'. Write yes or no"),
    "a joint without a row": ("joints.csv", "Waist,yes,-1.57,1.57,7.1,12.57,25,0.0478125,200,5,0\n", "",
        r"joints.csv: joint 'Waist' of link 'Waist' has no row. Add the row or correct links.csv, line 13"),
    "a joint that moves nothing": ("joints.csv", "Waist,yes", "Tail,yes,-1,1,1,1,1,1,1,1,0\nWaist,yes",
        r"joints.csv, line 12: joint 'Tail' moves no link of links.csv. Name one of: AAHead_yaw"),
    "a joint twice": ("joints.csv", "Waist,yes", "Head_pitch,yes,-1,1,1,1,1,1,1,1,0\nWaist,yes",
        r"joints.csv, line 12: 'Head_pitch' stands in line 3 already"),
    "another table": ("joints.csv", "joint,controlled,lower", "joint,lower,controlled",
        r"joints.csv, line 1: the columns are joint, lower, controlled.*They must be joint, controlled, lower"),
    "a row with a value too few": ("sites.csv", "imu,Trunk,0,0,0,", "imu,Trunk,0,0,",
        r"sites.csv, line 2: the row has 5 values. Write 6"),
    "a link without mass": ("links.csv", "0,0,1,0.44391,", "0,0,1,-0.44391,",
        r"links.csv, line 3: link 'H1': mass is -0.44391. Write a number above 0"),
    "an inertia no body has": ("links.csv", "0.034618,1.1e-05,", "0.34618,1.1e-05,",
        r"links.csv, line 17: link 'Shank_Left': principal moments of inertia .* are those of no body"),
    "a parent further down": ("links.csv", SHANK, "Shank_Left,left_foot_link,Left_Knee_Pitch,",
        r"links.csv, line 17: link 'Shank_Left' has the parent 'left_foot_link', which is not above it"),
    "a long axis": ("links.csv", "Head_pitch,0,0,0.06185,0,0,0,0,1,0,", "Head_pitch,0,0,0.06185,0,0,0,0,2,0,",
        r"links.csv, line 4: the axis of joint 'Head_pitch' is not a unit vector. Normalise it"),
    "two links on a joint": ("links.csv", "H2,H1,Head_pitch", "H2,H1,AAHead_yaw",
        r"links.csv, line 4: joint 'AAHead_yaw' moves two links"),
    "another root": ("robot.toml", 'root_link = "Trunk"', 'root_link = "Torso"',
        r"links.csv, line 2: the first link is 'Trunk' .*Start with the root link of robot.toml \('Torso'\)"),
    "a link without a partner": ("robot.toml", ', ["AL", "AR"]', "",
        r"links.csv, line 5: link 'AL1' has the mirror partner 'AL1', but its joint has 'Right_Shoulder_Pitch'"),
    "a partner that is not there": ("robot.toml", '["AL", "AR"]', '["AL", "AX"]',
        r"links.csv, line 5: link 'AL1' has the mirror partner 'AX1', which does not exist"),
    "a shape on no link": ("shapes.csv", "head,H2,", "head,H3,",
        r"shapes.csv, line 7: unknown shape 'head': link 'H3'. There are: AL1"),
    "a shape with a size too many": ("shapes.csv", HEAD, HEAD[:-1] + "0.1",
        r"shapes.csv, line 7: shape 'head' has the sizes .* A sphere has 1 sizes above 0"),
    "a shape in no colour": ("shapes.csv", "head,H2,sphere,both,shell", "head,H2,sphere,both,pink",
        r"unknown shape 'head': colour 'pink'. There are: joint, shell, sole"),
    "a site that is a link": ("sites.csv", "imu,Trunk", "H1,Trunk",
        r"sites.csv, line 2: site 'H1' is also a link"),
    "a human joint without a site": ("sites.csv", "left_knee,Shank_Left", "left_kneecap,Shank_Left",
        r"sites.csv: site 'left_knee' is missing"),
    "a foot that is no site": ("robot.toml", 'feet = ["left_sole_centre"', 'feet = ["left_shoe"',
        r"robot.toml: unknown site in feet 'left_shoe'. There are: imu"),
    "a body part without a link": ("robot.toml", 'pelvis = "Waist"\n', "",
        r"robot.toml: human_links names trunk, left_thigh.*Name trunk, pelvis"),
    "an unknown key": ("robot.toml", "hands = [", "paws = [",
        r"robot.toml: unknown key 'paws'.*'hands' is missing"),
    "no TOML": ("robot.toml", "hands = [", "hands = ][",
        r"robot.toml: it is not TOML .*See docs/robot.md"),
    "model files of other tables": ("joints.csv", KNEE, "Left_Knee_Pitch,yes,0,2.2,",
        r"t1.xml: the file is not what the tables beside it say. Run python -m pipeline.robot.render"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_refused(fault: str, t1_folder: Path, tmp_path: Path):
    file, old, new, message = FAULTS[fault]
    folder = copy_robot(t1_folder, tmp_path)
    replace(folder / file, old, new)
    with pytest.raises(RobotError, match=message):
        load_robot(folder)


@pytest.mark.parametrize("file", ["robot.toml", "links.csv", "joints.csv", "shapes.csv", "sites.csv", "t1.urdf"])
def test_a_missing_file_is_named(file: str, t1_folder: Path, tmp_path: Path):
    folder = copy_robot(t1_folder, tmp_path)
    (folder / file).unlink()
    with pytest.raises(RobotError, match=file):
        load_robot(folder)


def test_every_faulty_row_is_named_at_once(t1_folder: Path, tmp_path: Path):
    folder = copy_robot(t1_folder, tmp_path)
    replace(folder / "joints.csv", KNEE, "Left_Knee_Pitch,yes,inf,2.1817,")
    replace(folder / "joints.csv", "Waist,yes,", "Waist,maybe,")
    with pytest.raises(RobotError) as caught:
        load_robot(folder)
    assert [fault.line for fault in caught.value.faults] == [12, 16]


def test_an_unknown_robot_is_told_which_there_are():
    with pytest.raises(RobotError, match=r"robots/t9: there is no such robot folder\. Name one of .*t1"):
        load_robot("t9")


def test_limbs_that_do_not_follow_each_other_are_refused(t1_folder: Path, tmp_path: Path):
    """The simulator orders joints down one limb after the other; another order would mix up joints."""
    folder = copy_robot(t1_folder, tmp_path)
    lines = (folder / "joints.csv").read_text().splitlines(keepends=True)
    lines[1], lines[3] = lines[3], lines[1]
    (folder / "joints.csv").write_text("".join(lines))
    with pytest.raises(RobotError, match=r"joints.csv: the order of the joints is not a walk down one limb"):
        load_robot(folder)


def test_axes_that_are_no_mirror_images_are_refused(t1_folder: Path, tmp_path: Path):
    folder = copy_robot(t1_folder, tmp_path)
    replace(
        folder / "links.csv", "-0.014,0,-0.134,0,0,0,0,1,0,1.82,-0.006012", "-0.014,0,-0.134,0,0,0,1,0,0,1.82,-0.006012"
    )
    with pytest.raises(
        RobotError, match=r"joints.csv, line 16: the axis of joint 'Left_Knee_Pitch' is no mirror image"
    ):
        load_robot(folder)


def test_names_of_joints_links_and_sites_are_found_or_listed(t1: Robot):
    assert t1.joint_names[t1.joint("Waist")] == t1.link_names[t1.link("Waist")] == "Waist"
    with pytest.raises(UnknownNameError, match=r"unknown joint 'Tail'; there are: AAHead_yaw"):
        t1.joint("Tail")
    with pytest.raises(UnknownNameError, match=r"unknown link 'Left_Knee_Pitch'"):
        t1.link("Left_Knee_Pitch")
    with pytest.raises(UnknownNameError, match=r"unknown site 'tail'"):
        t1.site("tail")


def test_a_robot_survives_the_way_to_another_process(robot: Robot):
    copy = pickle.loads(pickle.dumps(robot))  # noqa: S301, what multiprocessing does
    assert copy.digest == robot.digest and copy.mjcf == robot.mjcf
    assert np.array_equal(copy.tree.quat, robot.tree.quat)


def test_the_digest_is_of_the_contents_not_of_the_place(t1: Robot, t1_folder: Path, tmp_path: Path):
    assert load_robot(copy_robot(t1_folder, tmp_path)).digest == t1.digest


def test_every_human_part_has_a_link_and_every_human_joint_a_site(robot: Robot):
    for part, name in robot.human.items():
        joint = part.split("_", 1)[-1] in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
        assert name in (robot.site_names if joint else robot.link_names)
