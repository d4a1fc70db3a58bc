"""Model files as makers write them: meshes, fixed links, worlds, and what cannot be used."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.robot_import.maker_model import MakerShape, corner_points
from pipeline.robot_import.propose import propose
from pipeline.robot_import.read import read_model
from pipeline.robot_import.stated import read_stated
from tests.factories.maker_models import T1, joint, link, put_mesh, t1_mjcf, t1_urdf, without_sites, write, write_mesh


def named(rows, name: str):
    return next(row for row in rows if row.shape == name or row.link == name)


def test_a_mesh_becomes_a_capsule_and_a_foots_mesh_a_box(tmp_path: Path):
    urdf = without_sites(t1_urdf())
    for side, sign in (("left", 1.0), ("right", -1.0)):
        write_mesh(tmp_path / "meshes" / f"{side}_foot.STL", (0.2, 0.08, 0.06), (0.03, 0.0, -0.02))
        put_mesh(urdf, f"{side}_foot_link", f"package://t1/meshes/{side}_foot.STL")
        write_mesh(tmp_path / "meshes" / f"{side}_arm.stl", (0.06, 0.2, 0.06), (0.0, 0.1 * sign, 0.0))
        put_mesh(urdf, f"{side}_hand_link", f"meshes/{side}_arm.stl")
    proposal = propose(read_model(write(tmp_path / "urdf" / "t1.urdf", urdf)), "t1")
    foot = named(proposal.description.shapes, "left_foot_link")
    assert (foot.kind, foot.role) == ("box", "both")
    assert (foot.size_a, foot.size_b) == pytest.approx((0.1, 0.04))
    assert foot.z - foot.size_c == pytest.approx(-0.05)
    arm = named(proposal.description.shapes, "right_hand_link")
    assert arm.kind == "capsule"
    assert arm.y == pytest.approx(-0.1)
    assert np.abs(arm.long_axis) == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    assert arm.size_a + arm.size_b == pytest.approx(0.1)
    corners = {row.site: (row.x, row.y, row.z) for row in proposal.description.sites}
    assert corners["left_sole_front_left"] == pytest.approx((0.13, 0.04, -0.05))
    assert corners["right_hand"] == pytest.approx((0.0, -0.2, 0.0))
    assert any("left_foot_link" in text and "primitives stand for the meshes" in text for text in proposal.to_state)


def test_a_foot_of_lying_capsules_has_a_sole_as_long_as_they_are(tmp_path: Path):
    """The feet of the Unitree G1 and H1."""
    root = t1_mjcf()
    for side in ("left", "right"):
        foot = next(each for each in root.iter("body") if each.get("name") == f"{side}_foot_link")
        for child in [each for each in foot if each.tag in ("geom", "site")]:
            foot.remove(child)
        for y, x_max in ((-0.02, 0.12), (0.02, 0.12), (0.0, 0.13)):
            Xml.SubElement(foot, "geom", type="capsule", size="0.01", fromto=f"-0.05 {y} -0.02 {x_max} {y} -0.02")
    rows = propose(read_model(write(tmp_path / "t1.xml", root)), "t1").description.sites
    sites = {row.site: (row.x, row.y, row.z) for row in rows}
    assert sites["left_sole_front_left"] == pytest.approx((0.13, 0.02, -0.03))
    assert sites["right_sole_rear_right"] == pytest.approx((-0.05, -0.02, -0.03))


def test_the_hip_of_a_leg_that_begins_with_yaw_is_at_its_pitch_joint(tmp_path: Path):
    """The Unitree H1's thigh begins 12 cm beside its roll joint."""
    urdf = without_sites(t1_urdf())
    for side in ("Left", "Right"):
        first, third = (joint(urdf, f"{side}_Hip_{part}").find("axis") for part in ("Pitch", "Yaw"))
        assert first is not None and third is not None
        first.attrib["xyz"], third.attrib["xyz"] = third.attrib["xyz"], first.attrib["xyz"]
    plain = read_model(write(tmp_path / "plain.urdf", without_sites(t1_urdf())))
    for model, thigh in ((plain, "Hip_Roll_Left"), (read_model(write(tmp_path / "t1.urdf", urdf)), "Hip_Yaw_Left")):
        hip = next(row for row in propose(model, "t1").description.sites if row.site == "left_hip")
        assert hip.link == thigh


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder"])
def test_points_of_a_round_shape_reach_as_far_as_it_does(kind: str):
    """Against the support function of a turned shape along each axis of the link."""
    pos, quat = np.array([0.1, -0.2, 0.3]), rotation.from_rotvec(np.array([0.7, -0.4, 1.1]))
    size = (0.05,) if kind == "sphere" else (0.05, 0.2)
    shape = MakerShape(name="", link="", kind=kind, collides=True, shown=True, pos=pos, quat=quat, size=size)
    along = np.abs(rotation.rotate(quat, np.array([0.0, 0.0, 1.0])))
    reach = 0.05 * (np.sqrt(1.0 - along**2) if kind == "cylinder" else np.ones(3)) + (0.2 * along if size[1:] else 0.0)
    points = corner_points(shape)
    np.testing.assert_allclose(points.max(axis=0), pos + reach, atol=1e-12)
    np.testing.assert_allclose(points.min(axis=0), pos - reach, atol=1e-12)


def test_a_mesh_that_is_only_shown_gives_a_bare_link_a_shape(tmp_path: Path):
    urdf = t1_urdf()
    write_mesh(tmp_path / "cross.stl", (0.05, 0.05, 0.05), (0.0, 0.0, 0.0))
    for side in ("Left", "Right"):
        put_mesh(urdf, f"Ankle_Cross_{side}", "cross.stl", tag="visual")
    rows = propose(read_model(write(tmp_path / "t1.urdf", urdf)), "t1").description.shapes
    cross = named(rows, "Ankle_Cross_Left")
    assert (cross.kind, cross.role) == ("sphere", "visual")


def test_a_missing_mesh_is_a_note_and_the_rest_goes_on(tmp_path: Path):
    urdf = t1_urdf()
    put_mesh(urdf, "H2", "meshes/head.stl")
    (tmp_path / "broken.stl").write_bytes(b"no mesh at all")
    put_mesh(urdf, "H1", "broken.stl")
    model = read_model(write(tmp_path / "t1.urdf", urdf))
    assert [note for note in model.notes if "'H2'" in note] == [
        "link 'H2': the mesh 'meshes/head.stl' is not there, so its shape is missing."
    ]
    assert any("link 'H1': the mesh 'broken.stl'" in note for note in model.notes)
    assert len(model.links) == 24


def test_a_missing_mesh_of_an_mjcf_is_a_note(tmp_path: Path):
    root = t1_mjcf()
    Xml.SubElement(Xml.SubElement(root, "asset"), "mesh", name="shell", file="shell.stl")
    body = next(each for each in root.iter("body") if each.get("name") == "H2")
    Xml.SubElement(body, "geom", type="mesh", mesh="shell")
    model = read_model(write(tmp_path / "t1.xml", root))
    assert model.notes == ("the mesh 'shell' is not there, so its shapes are missing.",)


def test_links_that_are_fixed_are_merged_into_their_parents(tmp_path: Path):
    """Against MuJoCo's own mass and inertia of the robot."""
    urdf = t1_urdf()
    for name in ("AAHead_yaw", "Head_pitch"):
        joint(urdf, name).set("type", "fixed")
    model = read_model(write(tmp_path / "t1.urdf", urdf))
    assert len(model.joints) == 21
    assert sum(each.mass for each in model.links) == pytest.approx(31.734357782)
    whole = mujoco.MjModel.from_xml_path(str(T1 / "t1.xml"))
    data = mujoco.MjData(whole)
    mujoco.mj_forward(whole, data)
    members = [whole.body(name).id for name in ("Trunk", "H1", "H2")]
    mass = whole.body_mass[members].sum()
    com = whole.body_mass[members] @ data.xipos[members] / mass - data.xpos[members[0]]
    assert model.links[0].mass == pytest.approx(mass)
    np.testing.assert_allclose(model.links[0].com, com, atol=1e-9)
    about = np.zeros((3, 3))
    for body in members:
        turn, away = data.ximat[body].reshape(3, 3), data.xipos[body] - data.xpos[members[0]] - com
        about += turn @ np.diag(whole.body_inertia[body]) @ turn.T
        about += whole.body_mass[body] * (away @ away * np.eye(3) - np.outer(away, away))
    np.testing.assert_allclose(model.links[0].inertia, about, atol=1e-8)
    head = [shape for shape in model.shapes if shape.name == "head" and shape.collides]
    assert head[0].link == "Trunk"
    np.testing.assert_allclose(head[0].pos, [0.0725, 0.0, 0.41485], atol=1e-9)


def test_a_fixed_body_of_an_mjcf_is_merged_alike(tmp_path: Path):
    urdf, mjcf = t1_urdf(), t1_mjcf()
    joint(urdf, "Head_pitch").set("type", "fixed")
    body = next(each for each in mjcf.iter("body") if each.get("name") == "H2")
    body.remove(body.find("joint"))  # type: ignore[arg-type]
    first, second = (
        read_model(write(tmp_path / name, root)).links[1] for name, root in (("a.urdf", urdf), ("a.xml", mjcf))
    )
    assert (first.name, first.mass) == ("H1", pytest.approx(second.mass))
    np.testing.assert_allclose(first.com, second.com, atol=1e-9)
    np.testing.assert_allclose(first.inertia, second.inertia, atol=1e-9)


def test_a_massless_world_link_is_left_out(tmp_path: Path):
    urdf = t1_urdf()
    Xml.SubElement(urdf, "link", name="world")
    floating = Xml.SubElement(urdf, "joint", name="world_joint", type="floating")
    Xml.SubElement(floating, "parent", link="world")
    Xml.SubElement(floating, "child", link="Trunk")
    assert read_model(write(tmp_path / "t1.urdf", urdf)).links[0].name == "Trunk"


def test_gains_and_torques_of_actuators_are_taken(tmp_path: Path):
    root = t1_mjcf()
    actuators = Xml.SubElement(root, "actuator")
    Xml.SubElement(actuators, "position", joint="Left_Knee_Pitch", kp="120", kv="3", forcerange="-50 50")
    Xml.SubElement(actuators, "motor", joint="Right_Knee_Pitch", gear="2", ctrlrange="-30 30")
    model = read_model(write(tmp_path / "t1.xml", root))
    left, right = (
        next(each for each in model.joints if each.name == f"{side}_Knee_Pitch") for side in ("Left", "Right")
    )
    assert (left.torque, left.kp, left.kd) == (50.0, 120.0, 3.0)
    assert (right.torque, right.kp, right.kd) == (60.0, None, None)


def test_the_other_file_gives_the_shapes(tmp_path: Path):
    urdf = t1_urdf()
    for each in list(urdf.iter("link")):
        for shape in [*each.findall("collision"), *each.findall("visual")]:
            each.remove(shape)
    model = read_model(write(tmp_path / "bare.urdf", urdf))
    proposal = propose(model, "t1", shapes=read_model(T1 / "t1.xml"))
    assert len(proposal.description.shapes) == 48
    assert proposal.description.joints[2].torque == 18.0


def test_what_a_person_states_takes_the_place_of_proposals(tmp_path: Path):
    table = tmp_path / "stated.csv"
    table.write_text("joint,kp,torque,controlled\nWaist,200,,no\nLeft_Knee_Pitch,,55,\n")
    model = read_model(T1 / "t1.urdf")
    stated = read_stated(table, tuple(each.name for each in model.joints))
    proposal = propose(model, "t1", stated=stated)
    rows = proposal.description.joint_rows
    assert (rows["Waist"].kp, rows["Waist"].torque, rows["Waist"].controlled) == (200.0, 25.0, False)
    assert (rows["Left_Knee_Pitch"].torque, rows["Left_Knee_Pitch"].kp) == (55.0, 220.0)
    listed = next(text for text in proposal.to_state if text.startswith("joints.csv, kp"))
    assert "Waist" not in listed


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("joint,mass\n", "line 1: its columns are joint, mass"),
        ("joint,kp\nKnee,3\n", "line 2: there is no joint 'Knee'"),
        ("joint,kp\nWaist,much\n", "line 2: 'Waist': kp is 'much'"),
        ("joint,kp\nWaist\n", "line 2: the row has 1 values"),
        ("joint,controlled\nWaist,perhaps\n", "'Waist': controlled is 'perhaps'"),
        ("joint,kp,kd\nWaist,much,more\n", "kp is 'much'. Write a finite number. kd is 'more'. Write a finite number."),
    ],
)
def test_a_faulty_table_of_a_person_is_refused(tmp_path: Path, text: str, told: str):
    path = tmp_path / "stated.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=told):
        read_stated(path, ("Waist", "Left_Knee_Pitch"))


def test_blanks_around_the_cells_of_a_table_are_ignored(tmp_path: Path):
    path = tmp_path / "stated.csv"
    path.write_text("joint, kp, kd, controlled\n Waist , 1.0,  , yes\n")
    stated = read_stated(path, ("Waist",))
    assert stated.numbers == {"kp": {"Waist": 1.0}, "kd": {}}
    assert stated.controlled == {"Waist": True}


def _with(change, root: Xml.Element) -> Xml.Element:
    change(root)
    return root


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda urdf: joint(urdf, "Waist").set("type", "prismatic"), r"no independent hinges: 'Waist' \(prismatic\)"),
        (lambda urdf: Xml.SubElement(joint(urdf, "Waist"), "mimic", joint="Head_pitch"), r"'Waist' \(mimic\)"),
        (lambda urdf: Xml.SubElement(urdf, "link", name="lost"), "it has no single root link"),
        (
            lambda urdf: [
                joint(urdf, f"Left_{name}").set("type", "fixed") for name in ("Hip_Pitch", "Hip_Roll", "Hip_Yaw")
            ],
            "two legs and two arms of at least 4 joints are not found",
        ),
        (lambda urdf: link(urdf, "H1").set("name", "H2"), "Pinocchio cannot read it"),
    ],
)
def test_a_urdf_that_cannot_be_represented_is_refused(tmp_path: Path, change, told: str):
    path = write(tmp_path / "t1.urdf", _with(change, t1_urdf()))
    with pytest.raises(FileError, match=told):
        propose(read_model(path), "t1")


def _slide(root: Xml.Element) -> None:
    next(each for each in root.iter("joint") if each.get("name") == "Waist").set("type", "slide")


def _two(root: Xml.Element) -> None:
    Xml.SubElement(Xml.SubElement(root.find("worldbody"), "body", name="ball"), "freejoint")  # type: ignore[arg-type]
    Xml.SubElement(root.find("worldbody/body[@name='ball']"), "geom", size="0.1")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "told"),
    [(_slide, "body 'Waist' does not move on one hinge"), (_two, "it has 2 bodies with a free joint")],
)
def test_an_mjcf_that_cannot_be_represented_is_refused(tmp_path: Path, change, told: str):
    with pytest.raises(FileError, match=told):
        read_model(write(tmp_path / "t1.xml", _with(change, t1_mjcf())))


@pytest.mark.parametrize(
    ("text", "told"),
    [("", "it is not XML"), ("<sdf/>", "its root element is 'sdf'"), ("<mujoco><worldbody><body", "it is not XML")],
)
def test_a_file_that_is_no_model_is_refused(tmp_path: Path, text: str, told: str):
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(FileError, match=told):
        read_model(path)
    with pytest.raises(FileError, match="there is no such file"):
        read_model(tmp_path / "none.urdf")


def test_fingers_do_not_hide_an_arm(tmp_path: Path):
    urdf = without_sites(t1_urdf())
    for side in ("left", "right"):
        for finger in ("a", "b"):
            name = f"{side}_finger_{finger}"
            element = Xml.SubElement(urdf, "link", name=name)
            inertial = Xml.SubElement(element, "inertial")
            Xml.SubElement(inertial, "mass", value="0.01")
            Xml.SubElement(inertial, "inertia", ixx="1e-6", iyy="1e-6", izz="1e-6", ixy="0", ixz="0", iyz="0")
            hinge = Xml.SubElement(urdf, "joint", name=f"{name}_joint", type="revolute")
            Xml.SubElement(hinge, "parent", link=f"{side}_hand_link")
            Xml.SubElement(hinge, "child", link=name)
            Xml.SubElement(
                hinge, "origin", xyz=f"{0.01 if finger == 'a' else -0.01} {0.2 if side == 'left' else -0.2} 0"
            )
            Xml.SubElement(hinge, "axis", xyz="1 0 0")
            Xml.SubElement(hinge, "limit", lower="-1", upper="1", effort="1", velocity="5")
    proposal = propose(read_model(write(tmp_path / "t1.urdf", urdf)), "t1")
    assert proposal.description.config.human_links["left_forearm"] == "left_hand_link"
    held = [row.joint for row in proposal.description.joints if not row.controlled]
    assert "left_finger_a_joint" in held and "right_finger_b_joint" in held
