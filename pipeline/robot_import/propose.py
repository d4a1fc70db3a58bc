"""Tables of a robot folder from a manufacturer's model: values of the file, and proposals for missing ones."""

import dataclasses
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from pipeline.robot.adapted import files_of
from pipeline.robot.build import build_robot
from pipeline.robot.checks import faults_of
from pipeline.robot.description import SIDES, Config, Description
from pipeline.robot.kinematics import compiled
from pipeline.robot.legs import mirrored_name
from pipeline.robot.robot_error import refuse
from pipeline.robot.tables import JointRow, LinkRow
from pipeline.robot_import.limbs import BEND, Body, Limb, find_body
from pipeline.robot_import.maker_model import MakerJoint, MakerLink, MakerModel, columns, rounded, rpy_of
from pipeline.robot_import.propose_shapes import COLOURS, propose_shapes
from pipeline.robot_import.propose_sites import FEET, HANDS, corner_names, propose_sites
from pipeline.robot_import.stated import NOTHING, Stated

STIFFNESS = 4.0
"""Proposed kp over the torque limit [1/rad]; published gains of the T1 are at 2 to 4.5."""
DAMPING = 1.0 / 40.0
"""Proposed kd over kp [s]."""
ARMATURE = 0.01
"""Proposed armature if the file has none [kg m^2]."""
TORQUE, SPEED = 10.0, 10.0
"""Placeholders for limits that the file lacks [N m], [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A proposed robot folder, not yet written."""

    description: Description
    to_state: tuple[str, ...]
    """Values that the user must still state or check, one sentence each."""
    notes: tuple[str, ...]
    """Parts of the model files that were not used."""


def propose(model: MakerModel, name: str, *, shapes: MakerModel | None = None, stated: Stated = NOTHING) -> Proposal:
    """The folder of a robot called `name`. Raises FileError where legs and arms are not found, RobotError where the
    tables contradict each other.

    Args:
        model: the manufacturer's file: tree, inertias, limits
        name: name of the robot
        shapes: another file of the same robot, for its shapes and sites
        stated: values that override the file's
    """
    body = find_body(model)
    source, todo = shapes or model, []
    joints = _joint_rows(model, body, stated, todo)
    sites, sites_to_check = propose_sites(source, model, body)
    rows, fitted = propose_shapes(source, model, body)
    config = _config(model, body)
    todo += _to_check(model, body, sites_to_check, fitted)
    links = tuple(_link_row(number, link, model) for number, link in enumerate(model.links, start=2))
    description = Description(
        folder=Path(name), config=config, links=links, joints=joints, shapes=rows, sites=sites, contents={}
    )
    refuse(faults_of(description))
    excludes = _overlapping(description)
    if excludes:
        pairs = ", ".join(f"{first} and {second}" for first, second in excludes)
        todo.append(f"robot.toml, contact_excludes: shapes of {pairs} overlap in the default pose and are excluded.")
    description = dataclasses.replace(description, config=dataclasses.replace(config, contact_excludes=excludes))
    description = dataclasses.replace(description, contents=files_of(description))
    notes = (*model.notes, *(shapes.notes if shapes else ()))
    return Proposal(description=description, to_state=tuple(todo), notes=tuple(dict.fromkeys(notes)))


def _link_row(line: int, link: MakerLink, model: MakerModel) -> LinkRow:
    joint = link.joint
    return LinkRow(
        line=line,
        link=link.name,
        parent=model.links[link.parent].name if link.parent >= 0 else "",
        joint=joint.name if joint else "",
        **columns("x y z", rounded(link.pos)),
        **columns("roll pitch yaw", rpy_of(link.quat)),
        **columns("axis_x axis_y axis_z", rounded(joint.axis) if joint else (0.0, 0.0, 0.0)),
        **columns("mass", rounded([link.mass])),
        **columns("com_x com_y com_z", rounded(link.com)),
        **columns("ixx ixy ixz iyy iyz izz", rounded(link.inertia[np.triu_indices(3)])),
    )


def _joint_rows(model: MakerModel, body: Body, stated: Stated, todo: list[str]) -> tuple[JointRow, ...]:
    """The joints table; proposed values are added to `todo`."""
    proposed: dict[str, list[str]] = {}
    others = {model.links[index].name for index in body.others}

    def number(column: str, joint: MakerJoint, of_file: float | None, otherwise: float) -> float:
        value = stated.value(column, joint.name)
        if value is None and of_file is None:
            proposed.setdefault(column, []).append(joint.name)
        return value if value is not None else rounded([of_file if of_file is not None else otherwise])[0]

    rows = []
    for line, link in enumerate(model.links[1:], start=2):
        joint = link.joint
        assert joint is not None
        lower = number("lower", joint, joint.lower, -np.pi)
        upper = number("upper", joint, joint.upper, np.pi)
        torque = number("torque", joint, joint.torque or None, TORQUE)
        speed = number("urdf_speed", joint, joint.speed or None, stated.value("motor_speed", joint.name) or SPEED)
        kp = number("kp", joint, joint.kp, STIFFNESS * torque)
        rows.append(
            JointRow(
                line=line,
                joint=joint.name,
                controlled=stated.controlled.get(joint.name, link.name not in others),
                lower=lower,
                upper=upper,
                urdf_speed=speed,
                motor_speed=number("motor_speed", joint, None, speed),
                torque=torque,
                armature=number("armature", joint, joint.armature, ARMATURE),
                kp=kp,
                kd=number("kd", joint, joint.kd, DAMPING * kp),
                default_pos=number("default_pos", joint, None, min(max(0.0, lower), upper)),
            )
        )
    for column, names in proposed.items():
        shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        joints = "all joints" if len(names) == len(rows) else shown
        todo.append(f"joints.csv, {column}: {_HOW[column]} ({joints}).")
    held = [row.joint for row in rows if not row.controlled and row.joint not in stated.controlled]
    if held:
        todo.append(f"joints.csv, controlled: the policy is proposed not to move {', '.join(held)}.")
    return tuple(rows)


_HOW = {
    "lower": "the file has no limits; -pi is written",
    "upper": "the file has no limits; pi is written",
    "torque": f"the file has no torque limit; {TORQUE:g} N m is written",
    "urdf_speed": "the file has no speed limit; the motor's is written",
    "motor_speed": "a model file has no motor; its speed limit is repeated",
    "armature": f"the file has none; {ARMATURE:g} kg m^2 is written",
    "kp": f"the file has no gains; {STIFFNESS:g} times the torque limit is written",
    "kd": f"the file has no gains; kp times {DAMPING:g} s is written",
    "default_pos": "the zero pose is written; state a pose that stands",
}


def _config(model: MakerModel, body: Body) -> Config:
    def name(index: int) -> str:
        return model.links[index].name

    human = {"trunk": name(body.trunk), "pelvis": name(body.pelvis)}
    for side, leg, arm in zip(SIDES, body.legs, body.arms, strict=True):
        human |= {
            f"{side}_thigh": name(leg[BEND - 1]),
            f"{side}_shank": name(leg[BEND]),
            f"{side}_foot": name(leg[-1]),
            f"{side}_upper_arm": name(arm[BEND - 1]),
            f"{side}_forearm": name(arm[BEND]),
        }
    key = [
        name(0),
        name(body.trunk),
        name(body.pelvis),
        *(name(leg[at]) for leg in body.legs for at in (1, BEND, -1)),
        *(name(arm[at]) for arm in body.arms for at in (1, BEND - 1, -1)),
    ]
    return Config(
        root_link=name(0),
        key_links=tuple(dict.fromkeys(key)),
        hands=HANDS,
        feet=FEET,
        sole_corners=(corner_names("left"), corner_names("right")),
        mirror_names=propose_pairs(_partners(model, body)),
        contact_excludes=(),
        colours=COLOURS,
        human_links=human,
    )


def _partners(model: MakerModel, body: Body) -> Iterator[tuple[str, str]]:
    """Names of mirrored joints and links, and of the sites that are proposed."""
    for left, right in (body.legs, body.arms):
        for first, second in zip(_with_fingers(model, left), _with_fingers(model, right), strict=False):
            joints = model.links[first].joint, model.links[second].joint
            if joints[0] is not None and joints[1] is not None:
                yield joints[0].name, joints[1].name
            yield model.links[first].name, model.links[second].name
    yield "left", "right"


def _with_fingers(model: MakerModel, limb: Limb) -> list[int]:
    links = list(limb)
    for link in links:
        links += [child for child in model.children(link) if child not in links]
    return links


def propose_pairs(partners: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of name parts that turn each left name into its right one.

    Args:
        partners: (left, right) names of links, joints and sites that are mirror images
    """
    pairs: list[tuple[str, str]] = []
    for left, right in partners:
        if left != right and mirrored_name(left, pairs) != right:
            pairs.append(_difference(left, right))
    return tuple(pairs)


def _difference(left: str, right: str) -> tuple[str, str]:
    """The differing parts of two names, extended to whole words: AL1, AR1 differ by AL, AR."""
    start = _alike(left, right)
    end = _alike(left[start:][::-1], right[start:][::-1])
    while start > 0 and re.match(r"[A-Za-z]", left[start - 1]):
        start -= 1
    while end > 0 and re.match(r"[A-Za-z]", left[len(left) - end]):
        end -= 1
    if len(left) - end - start == 1:  # a single letter occurs in other words, too: include a separator
        if end > 0:
            end -= 1
        elif start > 0:
            start -= 1
    return left[start : len(left) - end], right[start : len(right) - end]


def _alike(first: str, second: str) -> int:
    """Length of the common prefix of two texts."""
    differing = (place for place, (a, b) in enumerate(zip(first, second, strict=False)) if a != b)
    return next(differing, min(len(first), len(second)))


def _to_check(model: MakerModel, body: Body, sites: tuple[str, ...], fitted: tuple[str, ...]) -> list[str]:
    trunk, pelvis = (model.links[index].name for index in (body.trunk, body.pelvis))
    meshes = [f"shapes.csv: primitives stand for the meshes of {', '.join(fitted)}: look at them."] if fitted else []
    return [
        f"robot.toml, human_links: trunk '{trunk}', pelvis '{pelvis}', thigh, shank, upper arm and forearm are "
        "proposed from the tree: look at them and at mirror_names.",
        *sites,
        *meshes,
        "standing.csv (optional): pose and gains the robot stands with on hardware.",
    ]


def _overlapping(description: Description) -> tuple[tuple[str, str], ...]:
    """Pairs of links, other than parent and child, whose collision shapes overlap in the default pose."""
    robot = build_robot(description)
    model = compiled(robot.mjcf)
    data = mujoco.MjData(model)
    data.qpos[7:] = robot.default_joint_pos
    mujoco.mj_forward(model, data)
    found = set()
    for contact in data.contact[: data.ncon]:
        if contact.dist < 0.0:
            bodies = sorted(int(model.geom_bodyid[geom]) for geom in contact.geom)
            found.add((model.body(bodies[0]).name, model.body(bodies[1]).name))
    return tuple(sorted(found))
