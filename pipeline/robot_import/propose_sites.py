"""Rows of sites.csv: the manufacturer's sites, and proposals for soles, hands and the counterparts of human joints."""

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.robot.description import SIDES
from pipeline.robot.tables import SiteRow
from pipeline.robot_import.limbs import BEND, Body, Limb
from pipeline.robot_import.maker_model import MakerModel, columns, corner_points, rounded
from pipeline.robot_import.meshes import FLAT, MESH_DECIMALS

CORNERS = ("front_left", "front_right", "rear_right", "rear_left")
WRIST = 0.86
"""Position of the wrist between elbow and end of the arm, for arms without a wrist joint (as on the T1)."""


HANDS, FEET = ("left_hand", "right_hand"), ("left_sole_centre", "right_sole_centre")
SoleCorners = tuple[str, str, str, str]


def corner_names(side: str) -> SoleCorners:
    """Names of the corners of a sole."""
    first, second, third, fourth = (f"{side}_sole_{corner}" for corner in CORNERS)
    return first, second, third, fourth


Places = dict[str, tuple[str, np.ndarray, str]]
"""Link, position in it [m] and source of each site."""


def propose_sites(source: MakerModel, model: MakerModel, body: Body) -> tuple[tuple[SiteRow, ...], tuple[str, ...]]:
    """Sites of a robot, and sentences on those that are guessed from shapes.

    A site of the file replaces a proposed one with the same name.
    """
    of_file = {site.name: (site.link, site.pos, f"{source.path.name}") for site in source.sites}
    places: Places = {}
    if "imu" not in of_file:
        places["imu"] = (model.links[0].name, np.zeros(3), "proposed: origin of the root link")
    to_check = [] if "imu" in of_file else ["sites.csv, imu: the root link's origin is proposed."]
    guessed = []
    for side, leg, arm in zip(SIDES, body.legs, body.arms, strict=True):
        places |= _leg(source, model, side, leg)
        found, from_shape = _arm(source, model, side, arm)
        places |= found
        guessed += from_shape
    guessed = [name for name in guessed if name not in of_file]
    if guessed:
        to_check.append(f"sites.csv: {', '.join(guessed)} are proposed from the end of the arm's shapes: look at them.")
    places |= of_file
    rows = tuple(
        SiteRow(line=line, site=name, link=link, **columns("x y z", rounded(pos)), source=origin)
        for line, (name, (link, pos, origin)) in enumerate(places.items(), start=2)
    )
    return rows, tuple(to_check)


def _leg(source: MakerModel, model: MakerModel, side: str, leg: Limb) -> Places:
    foot = model.links[leg[-1]].name
    low, high, bottom = _sole(source, foot)
    origin = f"derived: bottom of the foot's shapes in {source.path.name}"
    places: Places = {f"{side}_sole_centre": (foot, np.array([*(0.5 * (low + high)), bottom]), origin)}
    ends = {"front": high[0], "rear": low[0], "left": high[1], "right": low[1]}
    for corner in CORNERS:
        x, y = (ends[part] for part in corner.split("_"))
        places[f"{side}_sole_{corner}"] = (foot, np.array([x, y, bottom]), origin)
    places[f"{side}_ankle"] = (foot, np.zeros(3), "derived: origin of the last ankle joint")
    hip, which = (leg[2], "third") if _is_level(model, leg[2]) else (leg[1], "second")
    places[f"{side}_hip"] = (model.links[hip].name, np.zeros(3), f"derived: origin of the {which} hip joint")
    places[f"{side}_knee"] = (model.links[leg[BEND]].name, np.zeros(3), "derived: origin of the knee joint")
    return places


def _is_level(model: MakerModel, link: int) -> bool:
    """Whether a link's joint axis is horizontal, all joints at zero. A hip of yaw, roll and pitch (Unitree H1)
    ends in its pitch joint, a hip of pitch, roll and yaw in its roll joint: the yaw's origin may be anywhere along the
    thigh."""
    joint = model.links[link].joint
    assert joint is not None
    return abs(float(rotation.rotate(model.origins()[1][link], joint.axis)[2])) < LEVEL


LEVEL = 0.7
"""Vertical component of a unit axis below which it is horizontal."""


def _sole(source: MakerModel, foot: str) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"], float]:
    """Lower and upper bounds of the sole in x and y, and its height, in the foot's frame [m]."""
    solid = [shape for shape in source.shapes if shape.link == foot and shape.collides]
    shapes = solid or [shape for shape in source.shapes if shape.link == foot]
    points = np.vstack([corner_points(shape) for shape in shapes] or [np.zeros((1, 3))])
    bottom = float(points[:, 2].min())
    flat = points[points[:, 2] <= bottom + FLAT][:, :2]
    if any(shape.points is not None for shape in shapes):
        flat, bottom = flat.round(MESH_DECIMALS), round(bottom, MESH_DECIMALS)
    return flat.min(axis=0), flat.max(axis=0), bottom


def _arm(source: MakerModel, model: MakerModel, side: str, arm: Limb) -> tuple[Places, list[str]]:
    """Sites of an arm, and those of them that are guessed from shapes."""
    upper, forearm, end = (model.links[arm[at]].name for at in (1, BEND, -1))
    places: Places = {
        f"{side}_shoulder": (upper, np.zeros(3), "derived: origin of the second shoulder joint"),
        f"{side}_elbow": (forearm, np.zeros(3), "derived: origin of the elbow joint"),
    }
    hand, near = _hand(source, end)
    guessed = [f"{side}_hand"]
    places[f"{side}_hand"] = (end, hand, "proposed: end of the arm's shapes")
    if len(arm) > BEND + 1:
        origin = "derived: origin of the first wrist joint"
        places[f"{side}_wrist"] = (forearm, model.links[arm[BEND + 1]].pos, origin)
    else:
        guessed.append(f"{side}_wrist")
        places[f"{side}_wrist"] = (forearm, near, "proposed: beside the hand")
    return places, guessed


def _hand(source: MakerModel, link: str) -> tuple[np.ndarray, np.ndarray]:
    """Hand and wrist at the end of an arm's last link: centre and near side of a sphere there, else the far end of
    its shapes and a point before it."""
    shapes = [shape for shape in source.shapes if shape.link == link]
    points = np.vstack([corner_points(shape) for shape in shapes] or [np.zeros((1, 3))])
    low, high = points.min(axis=0), points.max(axis=0)
    axis = int(np.argmax(np.maximum(np.abs(low), np.abs(high))))
    reach = high[axis] if high[axis] > -low[axis] else low[axis]
    for shape in shapes:
        if shape.kind == "sphere" and abs(abs(shape.pos[axis]) + shape.size[0] - abs(reach)) < 1e-6:
            near = shape.pos.copy()
            near[axis] -= np.sign(reach) * shape.size[0]
            return shape.pos, near
    hand = np.zeros(3)
    hand[axis] = round(float(reach), MESH_DECIMALS)
    return hand, (WRIST * hand).round(MESH_DECIMALS)
