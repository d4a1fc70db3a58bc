"""Consistency checks across the tables of a robot folder: names, tree, inertia."""

from collections.abc import Iterable, Iterator

import numpy as np

from pipeline.errors import FileError
from pipeline.robot.description import CONFIG, HUMAN_LINKS, HUMAN_SITES, JOINTS, LINKS, SHAPES, SITES, Description
from pipeline.robot.legs import mirrored_name
from pipeline.robot.tables import SHAPE_ROLES, SHAPE_SIZES, LinkRow, Row

INERTIA_TOLERANCE = 1e-6
"""Tolerance of the triangle inequality as a share of the trace, for rounded published figures."""
AXIS_TOLERANCE = 1e-9
"""Allowed deviation of a joint axis from unit length."""


def faults_of(robot: Description) -> list[FileError]:
    """The faults of the tables. Later checks depend on earlier ones, so the first failing check ends the list."""
    for check in (_tree, _joints, _inertia, _shapes, _sites, _config, _mirror):
        faults = list(check(robot))
        if faults:
            return faults
    return []


def _tree(robot: Description) -> Iterator[FileError]:
    seen: set[str] = set()
    joints: set[str] = set()
    for number, row in enumerate(robot.links):
        if number == 0:
            if row.parent or row.joint or row.link != robot.config.root_link:
                problem = f"the first link is '{row.link}' with parent '{row.parent}' and joint '{row.joint}'."
                do = f"Start with the root link of {CONFIG} ('{robot.config.root_link}'), parent and joint empty."
                yield _fault(robot, LINKS, row, problem, do)
        elif row.parent not in seen:
            problem = f"link '{row.link}' has the parent '{row.parent}', which is not above it."
            yield _fault(robot, LINKS, row, problem, f"Name one of: {', '.join(sorted(seen))}.")
        elif abs(np.linalg.norm(row.numbers("axis_x", "axis_y", "axis_z")) - 1.0) > AXIS_TOLERANCE:
            yield _fault(robot, LINKS, row, f"the axis of joint '{row.joint}' is not a unit vector.", "Normalise it.")
        if row.joint in joints:
            yield _fault(robot, LINKS, row, f"joint '{row.joint}' moves two links.", "Give each link its own joint.")
        seen.add(row.link)
        joints.add(row.joint)


def _joints(robot: Description) -> Iterator[FileError]:
    moved = {row.joint: row for row in robot.links[1:]}
    for name, link in moved.items():
        if name not in robot.joint_rows:
            problem = f"joint '{name}' of link '{link.link}' has no row."
            yield _fault(robot, JOINTS, None, problem, f"Add the row or correct {LINKS}, line {link.line}.")
    for row in robot.joints:
        if row.joint not in moved:
            do = f"Name one of: {', '.join(sorted(moved))}."
            yield _fault(robot, JOINTS, row, f"joint '{row.joint}' moves no link of {LINKS}.", do)
        if row.lower >= row.upper:
            problem = f"joint '{row.joint}': lower limit {row.lower} rad is not below the upper limit {row.upper} rad."
            yield _fault(robot, JOINTS, row, problem, "Swap or correct them.")
        elif not row.lower <= row.default_pos <= row.upper:
            problem = f"joint '{row.joint}': default position {row.default_pos} rad is outside its limits."
            yield _fault(robot, JOINTS, row, problem, f"Choose it in {row.lower} to {row.upper}.")
    walked = [row.joint for row in depth_first(robot)][1:]
    if set(walked) == set(robot.joint_rows) and walked != list(robot.joint_rows):
        problem = "the order of the joints is not a walk down one limb after the other."
        do = f"The simulator needs such an order; with {LINKS} as it is: {', '.join(walked)}."
        yield _fault(robot, JOINTS, None, problem, do)
    if walked != [row.joint for row in robot.links[1:]]:
        problem = "the order of the links is not a walk down one limb after the other."
        yield _fault(robot, LINKS, None, problem, f"Order them: {', '.join(row.link for row in depth_first(robot))}.")


def depth_first(robot: Description) -> list[LinkRow]:
    """Rows of the links table in depth-first order, as in the model files."""
    rows: list[LinkRow] = []
    waiting = [robot.links[0]]
    while waiting:
        row = waiting.pop()
        rows.append(row)
        waiting += reversed(robot.children(row.link))
    return rows


def _inertia(robot: Description) -> Iterator[FileError]:
    for row in robot.links:
        moments = np.linalg.eigvalsh(row.inertia)
        if moments[0] <= 0.0 or moments[0] + moments[1] < moments[2] - INERTIA_TOLERANCE * moments.sum():
            listed = ", ".join(f"{moment:.4g}" for moment in moments)
            problem = f"link '{row.link}': principal moments of inertia {listed} kg m^2 are those of no body."
            do = "All must be above 0 and the largest at most the sum of the others."
            yield _fault(robot, LINKS, row, problem, do)


def _shapes(robot: Description) -> Iterator[FileError]:
    colours = robot.config.colours
    for row in robot.shapes:
        name = f"shape '{row.shape}'"
        yield from _unknown(robot, SHAPES, row, f"{name}: link", row.link, robot.link_names)
        yield from _unknown(robot, SHAPES, row, f"{name}: kind", row.kind, SHAPE_SIZES)
        yield from _unknown(robot, SHAPES, row, f"{name}: role", row.role, SHAPE_ROLES)
        yield from _unknown(robot, SHAPES, row, f"{name}: colour", row.colour, colours)
        sizes = row.numbers("size_a", "size_b", "size_c")
        used = len(row.size)
        if used and (min(row.size) <= 0.0 or any(sizes[used:])):
            do = f"A {row.kind} has {used} sizes above 0; write 0 for the others."
            yield _fault(robot, SHAPES, row, f"{name} has the sizes {sizes}.", do)


def _sites(robot: Description) -> Iterator[FileError]:
    for row in robot.sites:
        yield from _unknown(robot, SITES, row, f"site '{row.site}': link", row.link, robot.link_names)
        if row.site in robot.link_names:
            problem = f"site '{row.site}' is also a link, and both are frames of the URDF."
            yield _fault(robot, SITES, row, problem, "Rename the site.")
    for name in sorted(set(HUMAN_SITES) - {row.site for row in robot.sites}):
        problem = f"site '{name}' is missing, the robot's counterpart of a person's joint."
        yield _fault(robot, SITES, None, problem, "Add the row.")


def _config(robot: Description) -> Iterator[FileError]:
    config = robot.config
    sites = [row.site for row in robot.sites]
    groups: list[tuple[str, Iterable[str], Iterable[str]]] = [
        ("link in key_links", config.key_links, robot.link_names),
        ("link in contact_excludes", [name for pair in config.contact_excludes for name in pair], robot.link_names),
        ("link in human_links", config.human_links.values(), robot.link_names),
        ("site in hands", config.hands, sites),
        ("site in feet", config.feet, sites),
        ("site in sole_corners", [name for corners in config.sole_corners for name in corners], sites),
    ]
    for what, names, known in groups:
        for name in names:
            yield from _unknown(robot, CONFIG, None, what, name, known)
    if set(config.human_links) != set(HUMAN_LINKS):
        problem = f"human_links names {', '.join(config.human_links)}."
        yield _fault(robot, CONFIG, None, problem, f"Name {', '.join(HUMAN_LINKS)}.")


def _mirror(robot: Description) -> Iterator[FileError]:
    pairs = robot.config.mirror_names
    for table, what, rows in ((LINKS, "link", robot.links), (JOINTS, "joint", robot.joints)):
        names = [row.name for row in rows]
        for row in rows:
            partner = mirrored_name(row.name, pairs)
            if partner not in names:
                problem = f"{what} '{row.name}' has the mirror partner '{partner}', which does not exist."
                yield _fault(robot, table, row, problem, f"Add it or correct mirror_names in {CONFIG}.")
    moved_by = {row.link: row.joint for row in robot.links}
    for row in robot.links[1:]:
        link, joint = mirrored_name(row.link, pairs), mirrored_name(row.joint, pairs)
        if moved_by.get(link) not in (joint, None):
            problem = f"link '{row.link}' has the mirror partner '{link}', but its joint has '{joint}'."
            do = f"Let mirror_names in {CONFIG} swap both, or rename one."
            yield _fault(robot, LINKS, row, problem, do)
    config = robot.config
    for left, right in (config.hands, config.feet, *zip(*config.sole_corners, strict=True)):
        if left == right:
            yield _fault(robot, CONFIG, None, f"site '{left}' stands for left and right.", "Name one of each side.")


def _unknown(
    robot: Description, table: str, row: Row | None, what: str, name: str, known: Iterable[str]
) -> Iterator[FileError]:
    if name not in known:
        yield _fault(robot, table, row, f"unknown {what} '{name}'.", f"There are: {', '.join(sorted(known))}.")


def _fault(robot: Description, table: str, row: Row | None, problem: str, do: str) -> FileError:
    return FileError(robot.folder / table, problem, do, row.line if row else None)
