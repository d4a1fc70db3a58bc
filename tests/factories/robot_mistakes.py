"""Mistakes planted in a copy of a robot folder: each changes one thing and says what must be named."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Mistake:
    """A mistake, the code of the finding and what its text names. `rendered`: model files follow the tables."""

    plant: Callable[[Path], None]
    code: str
    names: str
    rendered: bool = True


def cell(table: str, row: str, column: str, change: Callable[[float], float] | str) -> Callable[[Path], None]:
    def plant(folder: Path) -> None:
        path = folder / table
        rows = list(csv.reader(path.read_text().splitlines()))
        place = rows[0].index(column)
        (found,) = [each for each in rows[1:] if each[0] == row]
        found[place] = change if isinstance(change, str) else repr(change(float(found[place])))
        path.write_text("\n".join(",".join(each) for each in rows) + "\n")

    return plant


def text(file: str, pattern: str, instead: str) -> Callable[[Path], None]:
    """Replace one pattern in a file."""

    def plant(folder: Path) -> None:
        changed, count = re.subn(pattern, instead, (folder / file).read_text(), count=1)
        assert count == 1, pattern
        (folder / file).write_text(changed)

    return plant


def both(*plants: Callable[[Path], None]) -> Callable[[Path], None]:
    def plant(folder: Path) -> None:
        for each in plants:
            each(folder)

    return plant


MISTAKES = {
    "a mass in grams": Mistake(cell("links.csv", "Shank_Left", "mass", lambda kg: 1000.0 * kg), "mass", "Shank_Left"),
    "an inertia in g m^2": Mistake(
        both(*(cell("links.csv", "AL3", name, lambda value: 1000.0 * value) for name in ("ixx", "iyy", "izz"))),
        "inertia",
        "AL3",
    ),
    "a centre of mass in cm": Mistake(
        cell("links.csv", "left_hand_link", "com_y", lambda y: 100.0 * y), "centre_of_mass", "left_hand_link"
    ),
    "a trunk that leans forward": Mistake(
        cell("links.csv", "Trunk", "com_x", lambda x: x + 0.32), "balance", "centre of mass"
    ),
    "limits exchanged": Mistake(
        both(cell("joints.csv", "Waist", "lower", "1.57"), cell("joints.csv", "Waist", "upper", "-1.57")),
        "tables",
        "Waist",
        rendered=False,
    ),
    "a limit in degrees": Mistake(
        cell("joints.csv", "Left_Knee_Pitch", "upper", lambda rad: 57.3 * rad), "limits", "Left_Knee_Pitch"
    ),
    "a motor speed in rpm": Mistake(
        cell("joints.csv", "Waist", "motor_speed", lambda rad: 9.55 * rad),
        "limits",
        "'Waist' has a motor_speed of 120 rad/s",
    ),
    "a default position outside its limits": Mistake(
        cell("joints.csv", "Left_Knee_Pitch", "default_pos", "-0.4"), "tables", "Left_Knee_Pitch", rendered=False
    ),
    "a mirror map without the arms": Mistake(
        text("robot.toml", r', \["AL", "AR"\]', ""), "tables", "AL1", rendered=False
    ),
    "an axis turned around on one side": Mistake(
        cell("links.csv", "Shank_Left", "axis_y", "-1"), "limits", "Left_Knee_Pitch"
    ),
    "a part of the person that is missing": Mistake(
        text("robot.toml", r'left_shank = "Shank_Left"\n', ""), "tables", "left_shank", rendered=False
    ),
    "thigh and shank exchanged": Mistake(
        both(
            text("robot.toml", r'left_thigh = "Hip_Yaw_Left"', 'left_thigh = "Shank_Left"'),
            text("robot.toml", r'left_shank = "Shank_Left"', 'left_shank = "Hip_Yaw_Left"'),
        ),
        "human_links",
        "left_shank",
    ),
    "key links without the root": Mistake(text("robot.toml", r'    "Trunk",\s*', ""), "key_links", "Trunk"),
    "a sole corner off the ground": Mistake(
        cell("sites.csv", "right_sole_rear_left", "z", lambda z: z + 0.02), "soles", "right_sole_rear_left"
    ),
    "soles above the foot's shape": Mistake(
        both(
            *(
                cell("sites.csv", f"{side}_sole_{each}", "z", lambda z: z + 0.02)
                for side in ("left", "right")
                for each in ("centre", "front_left", "front_right", "rear_left", "rear_right")
            )
        ),
        "soles",
        "left_foot_link",
    ),
    "hands in the trunk": Mistake(
        both(
            cell("joints.csv", "Left_Elbow_Yaw", "default_pos", "-2.1"),
            cell("joints.csv", "Right_Elbow_Yaw", "default_pos", "2.1"),
            cell("joints.csv", "Left_Elbow_Pitch", "default_pos", "1.5"),
            cell("joints.csv", "Right_Elbow_Pitch", "default_pos", "1.5"),
        ),
        "collision",
        "left_hand_link",
    ),
    "a hand on the wrong side": Mistake(cell("sites.csv", "left_hand", "y", lambda y: -y), "sites", "left_hand"),
    "a URDF that was edited": Mistake(
        text("t1.urdf", r'upper="2.1817"', 'upper="2.4"'), "model_files", "Left_Knee_Pitch", rendered=False
    ),
    "gains of another robot": Mistake(
        both(*(cell("joints.csv", f"{side}_Knee_Pitch", "kp", "5") for side in ("Left", "Right"))),
        "gains",
        "Left_Knee_Pitch",
    ),
    "a motor too weak to stand": Mistake(
        both(*(cell("joints.csv", f"{side}_Knee_Pitch", "torque", "2") for side in ("Left", "Right"))),
        "torque",
        "Left_Knee_Pitch",
    ),
    "gains that shake in simulation": Mistake(
        both(*(cell("joints.csv", f"{side}_Elbow_Pitch", "kd", "20") for side in ("Left", "Right"))),
        "gains",
        "Left_Elbow_Pitch' shakes",
    ),
    "gains that let it fall": Mistake(
        both(
            *(
                cell("standing.csv", f"{side}_{part}", "kp", "20")
                for side in ("Left", "Right")
                for part in ("Hip_Pitch", "Knee_Pitch", "Ankle_Pitch")
            )
        ),
        "standing",
        "standing.csv",
    ),
    "one motor unlike its partner": Mistake(
        cell("joints.csv", "Right_Hip_Roll", "torque", "52"), "left_and_right", "Right_Hip_Roll"
    ),
}
"""At the T1."""
