"""The message about a skeleton that no map fits, and a map to start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.clips.human_clip import BODIES
from pipeline.readers.roles import Roles
from pipeline.readers.skeleton_map import BodyMap, shipped_maps

LISTED = 12
"""Names that a message lists at most."""

OPEN = "FILL_IN"
"""Stands in a map to start from for a joint that a person has to name."""

AXES: dict[str, dict[str, str]] = {
    "hip": {"down": "knee", "left": "x"},
    "knee": {"down": "ankle", "left": "x"},
    "ankle": {"ahead": "z", "left": "x"},
    "toe": {"ahead": "z", "left": "x"},
    "shoulder": {"down": "elbow", "ahead": "z"},
    "elbow": {"down": "wrist", "ahead": "z"},
    "wrist": {"down": "x", "ahead": "z"},
}
"""Directions of the limbs' bodies in a y-up file with stretched arms; names of parts stand for their joints."""


def unknown_skeleton(names: Sequence[str], roles: Roles) -> tuple[str, str]:
    """Problem and remedy: the closest map, the joints that differ, and what the tree contradicts."""
    have = set(names)
    closest = max(shipped_maps().values(), key=lambda one: (len(one.joints & have) / len(one.joints), one.name))
    missing = ", ".join(sorted(closest.joints - have)) or "none"
    extra = [name[:40] for name in names if name not in closest.joints]
    more = f" and {len(extra) - LISTED} more" if len(extra) > LISTED else ""
    needed = [body for body in roles.missing if not body.endswith(("toe", "wrist"))]
    unfound = [body for body in needed if "_" in body or body == "head"] or needed
    parts = [f"no joint is known as {', '.join(unfound)}"] if unfound else list(roles.faults[:3])
    if not parts:
        parts = ["its rest pose is none that a person could stand in"]
    problem = (
        f"unknown skeleton of {len(names)} joints: {'; '.join(parts)}. Closest is '{closest.name}'; "
        f"missing: {missing}; not in it: {', '.join(extra[:LISTED]) or 'none'}{more}."
    )
    do = (
        "Print a map to start from with `booster-lab inspect FILE --write-map`, complete it (docs/sources.md) and "
        "state it as `skeleton:` in data/sources.yaml."
    )
    return problem, do


def map_text(title: str, bodies: Mapping[str, BodyMap]) -> str:
    """A skeleton map as YAML."""
    lines = ['# Axes and pitch_deg: see docs/sources.md, "Skeleton maps".', f"title: {title}", "bodies:"]
    for body in BODIES:
        each = bodies[body]
        parts = {"joint": each.joint, **each.directions()}
        fields = [f"{key}: {_quoted(value)}" for key, value in parts.items()]
        if each.pitch_deg:
            fields.append(f"pitch_deg: {each.pitch_deg:g}")
        if any(each.offset):
            fields.append(f"offset: [{', '.join(f'{value:g}' for value in each.offset)}]")
        lines.append(f"  {body}: {{{', '.join(fields)}}}")
    return "\n".join(lines) + "\n"


def map_to_start_from(names: Sequence[str], roles: Roles) -> str:
    """A map with the joints that are known filled in and `FILL_IN` for the others."""
    joint = {body: names[index] for body, index in roles.joints.items()}
    bodies = {}
    for body in BODIES:
        side, _, part = body.partition("_")
        directions = AXES.get(part, {"up": "y", "left": "x"})
        known = {
            way: joint.get(f"{side}_{value}", OPEN) if value in AXES else value for way, value in directions.items()
        }
        if (side, part) == ("right", "wrist"):
            known["down"] = "-x"
        bodies[body] = _body(joint.get(body, OPEN), known)
    listed = "".join(f"#   {name}\n" for name in names)
    return f"# Joints of the file:\n{listed}{map_text('What this skeleton is', bodies)}"


def _body(joint: str, directions: Mapping[str, str]) -> BodyMap:
    return BodyMap(
        joint=joint,
        ahead=directions.get("ahead"),
        left=directions.get("left"),
        up=directions.get("up"),
        down=directions.get("down"),
    )


def _quoted(value: str) -> str:
    """A YAML scalar; quoted where it is not a plain word."""
    return value if value.replace("_", "").replace("-", "").isalnum() else '"' + value.replace('"', "'") + '"'
