"""The T1's model files as its maker writes them in 2026 (booster_assets 45588c7): other names, efforts and ranges."""

from __future__ import annotations

from pathlib import Path

from pipeline.robot import load_robot
from pipeline.robot.load import read_description
from tests.factories.maker_models import T1, joint, t1_mjcf, t1_urdf, write

NAMING = "booster_2026"
LIMITS = {
    "Waist": {"lower": "-1.012", "upper": "1.012"},
    "Left_Hip_Pitch": {"effort": "98.8"},
    "Right_Hip_Pitch": {"effort": "98.8"},
    "Left_Hip_Roll": {"lower": "-0.363"},
    "Right_Hip_Roll": {"upper": "0.363"},
    "Left_Knee_Pitch": {"effort": "130.5", "upper": "2.145"},
    "Right_Knee_Pitch": {"effort": "130.5", "upper": "2.145"},
}
"""Changed limits by the T1's own name of a joint; the right side mirrors the left."""
CHANGES = (
    *("Waist: lower -1.57, there -1.012 rad.", "Waist: upper 1.57, there 1.012 rad."),
    "Left_Hip_Pitch: torque 45, there 98.8 N m.",
    "Left_Hip_Roll: lower -0.2, there -0.363 rad.",
    *("Left_Knee_Pitch: upper 2.1817, there 2.145 rad.", "Left_Knee_Pitch: torque 60, there 130.5 N m."),
    "Right_Hip_Pitch: torque 45, there 98.8 N m.",
    "Right_Hip_Roll: upper 0.2, there 0.363 rad.",
    *("Right_Knee_Pitch: upper 2.1817, there 2.145 rad.", "Right_Knee_Pitch: torque 60, there 130.5 N m."),
)
"""What a comparison with `robots/t1` has to list beside the names, in the robot's order of joints."""


def joint_names() -> dict[str, str]:
    """The T1's own names of joints to the newer ones."""
    t1 = load_robot("t1")
    return dict(zip(t1.joint_names, t1.namings[NAMING], strict=True))


def link_name(old: str) -> str:
    """The newer name of a link: small letters (`Trunk` is `trunk`)."""
    return old.lower()


def newer_urdf(path: Path) -> Path:
    """Write the newer URDF."""
    urdf, names = t1_urdf(), joint_names()
    for name, row in read_description(T1).joint_rows.items():
        joint(urdf, name).find("limit").set("velocity", f"{row.urdf_speed:g}")  # type: ignore[union-attr]
    for name, limits in LIMITS.items():
        joint(urdf, name).find("limit").attrib.update(limits)  # type: ignore[union-attr]
    for each in urdf.iter("joint"):
        each.set("name", names.get(each.get("name", ""), each.get("name", "").lower()))
        for part in ("parent", "child"):
            ref = each.find(part)
            ref.set("link", link_name(ref.get("link")))  # type: ignore[union-attr,arg-type]
    for each in urdf.iter("link"):
        each.set("name", link_name(each.get("name", "")))
    return write(path, urdf)


def newer_mjcf(path: Path, armatures: dict[str, str]) -> Path:
    """Write an MJCF under the newer names, with other armatures [kg m^2] by the T1's own names of joints."""
    root, names = t1_mjcf(), joint_names()
    for each in root.iter("joint"):
        if each.get("name") in armatures:
            each.set("armature", armatures[each.get("name", "")])
        if each.get("name") in names:
            each.set("name", names[each.get("name", "")])
    for each in root.iter("body"):
        each.set("name", link_name(each.get("name", "")))
    for each in root.iter("exclude"):
        for part in ("body1", "body2"):
            each.set(part, link_name(each.get(part, "")))
    return write(path, root)
