"""Robot folders for tests: a small robot whose frames are turned every way, and copies of a robot to spoil.

The small robot has a root `base` and, on each side, thigh, foot and arm. All three angles of its joint
origins are set and its axes lie along no coordinate axis, so that a wrong order of rotations shows;
the T1 has a single small pitch. Its sides are exact mirror images in the x-z plane.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from pipeline.robot import render

LINKS = (
    "link,parent,joint,x,y,z,roll,pitch,yaw,axis_x,axis_y,axis_z,mass,com_x,com_y,com_z,ixx,ixy,ixz,iyy,iyz,izz\n"
    "base,,,0,0,0,0,0,0,0,0,0,5,0.01,0,0.1,0.05,0,0.002,0.06,0,0.04\n"
)
JOINTS = "joint,controlled,lower,upper,urdf_speed,motor_speed,torque,armature,kp,kd,default_pos\n"
SHAPES = (
    "shape,link,kind,role,colour,x,y,z,roll,pitch,yaw,size_a,size_b,size_c\n"
    "body,base,box,both,grey,0,0,0.1,0,0,0,0.05,0.04,0.1\n"
)
SITES = "site,link,x,y,z,source\n"
CONFIG = """
root_link = "base"
key_links = ["base", "l_foot", "r_foot"]
hands = ["l_hand", "r_hand"]
feet = ["l_sole", "r_sole"]
sole_corners = [["l_sole_a", "l_sole_b", "l_sole_c", "l_sole_d"], ["r_sole_a", "r_sole_b", "r_sole_c", "r_sole_d"]]
mirror_names = [["l_", "r_"]]
contact_excludes = [["l_thigh", "r_thigh"]]
[colours]
grey = [0.5, 0.5, 0.5]
[human_links]
trunk = "base"
pelvis = "base"
"""


def write_small_robot(folder: Path) -> Path:
    """Write the small robot into the new folder `folder` and render it; returns the folder."""
    links, joints, shapes, sites, config = LINKS, JOINTS, SHAPES, SITES, CONFIG
    for side, word, s in (("l", "left", 1), ("r", "right", -1)):
        links += f"""\
{side}_thigh,base,{side}_hip,0.02,{s * 0.1},-0.05,{s * 0.3},-0.4,{s * 0.5},0,1,0,2,0.01,{s * 0.02},-0.1,0.03,{s * 0.001},0,0.03,{s * -0.002},0.01
{side}_foot,{side}_thigh,{side}_ankle,0,{s * 0.01},-0.3,{s * -0.2},0.1,{s * 0.15},{s * 0.6},0,{s * -0.8},1,0.02,0,-0.02,0.002,0,0.0001,0.003,0,0.004
{side}_arm,base,{side}_shoulder,0,{s * 0.15},0.2,{s * -0.7},0.2,{s * 1.1},0.36,{s * 0.48},0.8,1.5,0,{s * 0.1},0,0.01,0,0,0.002,{s * 0.0003},0.011
"""  # noqa: E501, a row is a line
        joints += f"""\
{side}_hip,yes,-1.5,1,9,8,40,0.05,100,3,-0.2
{side}_ankle,yes,-0.5,0.4,7,8,20,0.02,50,1,0
{side}_shoulder,no,-1,1,5,6,10,0.01,20,1,{s * 0.1}
"""
        shapes += f"""\
{side}_leg,{side}_thigh,capsule,both,grey,0,0,-0.15,0,{0.2},0,0.04,0.1,0
{side}_shoe,{side}_foot,box,collision,grey,0.02,0,-0.03,0,0,0,0.1,0.04,0.02
{side}_sleeve,{side}_arm,cylinder,visual,grey,0,{s * 0.1},0,1.5708,0,0,0.03,0.1,0
{side}_fist,{side}_arm,sphere,both,grey,0,{s * 0.25},0,0,0,0,0.03,0,0
"""
        points = {"hip": "thigh", "knee": "thigh", "ankle": "foot", "shoulder": "arm", "elbow": "arm", "wrist": "arm"}
        sites += "".join(f"{word}_{name},{side}_{link},0,0,0,test\n" for name, link in points.items())
        sites += f"{side}_hand,{side}_arm,0,{s * 0.25},0,test\n{side}_sole,{side}_foot,0.02,0,-0.05,test\n"
        for name, x, y in (("a", 0.12, 0.04), ("b", 0.12, -0.04), ("c", -0.08, -0.04), ("d", -0.08, 0.04)):
            sites += f"{side}_sole_{name},{side}_foot,{x},{s * y},-0.05,test\n"
        parts = {"thigh": "thigh", "shank": "thigh", "foot": "foot", "upper_arm": "arm", "forearm": "arm"}
        config += "".join(f'{word}_{part} = "{side}_{link}"\n' for part, link in parts.items())
    folder.mkdir(parents=True)
    tables = {"links.csv": links, "joints.csv": joints, "shapes.csv": shapes, "sites.csv": sites, "robot.toml": config}
    for name, text in tables.items():
        (folder / name).write_text(text)
    assert render.main([str(folder)]) == 0
    return folder


def copy_robot(folder: Path, to: Path) -> Path:
    """A copy of a robot's folder below `to`, under its own name."""
    return Path(shutil.copytree(folder, to / folder.name))


def replace(path: Path, old: str, new: str) -> None:
    """Replace the one place in a file where `old` stands."""
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {path.name}"
    path.write_text(text.replace(old, new))
