"""Rows of shapes.csv from a manufacturer's shapes, with primitives in place of meshes."""

from dataclasses import replace

import numpy as np

from pipeline import rotation
from pipeline.robot.tables import ShapeRow
from pipeline.robot_import.limbs import Body
from pipeline.robot_import.maker_model import MakerModel, MakerShape, columns, round_axis, rounded, rpy_of
from pipeline.robot_import.meshes import MESH_DECIMALS, primitive_of, sole_box

COLOURS = {"shell": (0.86, 0.87, 0.88), "sole": (0.35, 0.36, 0.4)}
SUFFIXES = ("_collision", "_visual")
"""Suffixes of geoms in MJCF that this project renders."""


def propose_shapes(source: MakerModel, model: MakerModel, body: Body) -> tuple[tuple[ShapeRow, ...], tuple[str, ...]]:
    """(rows, links whose mesh was replaced by a primitive). Visual meshes are used for links without other shapes."""
    feet = {model.links[leg[-1]].name for leg in body.legs}
    rows: list[ShapeRow] = []
    fitted: list[str] = []
    for link in (each.name for each in model.links):
        own = [shape for shape in source.shapes if shape.link == link]
        primitives = [shape for shape in own if shape.points is None]
        shown = [shape for shape in primitives if shape.shown and not shape.collides]
        used = [(shape, _role(shape, shown)) for shape in primitives if shape not in _repeated(primitives)]
        solid = [shape for shape in own if shape.points is not None and shape.collides]
        used += [(_fitted(shape, link in feet), "both") for shape in solid]
        if not used:
            used = [(_fitted(shape, False), "visual") for shape in own if shape.points is not None][:1]
        if any(shape.points is not None for shape, _ in used) or solid or (used and not primitives):
            fitted.append(link)
        for shape, role in used:
            rows.append(_row(len(rows) + 2, shape, role, "sole" if link in feet else "shell", rows))
    return tuple(rows), tuple(dict.fromkeys(fitted))


def _role(shape: MakerShape, shown: list[MakerShape]) -> str:
    if not shape.collides:
        return "visual"
    return "both" if shape.shown or not shown or any(_same(shape, each) for each in shown) else "collision"


def _repeated(shapes: list[MakerShape]) -> list[MakerShape]:
    """Visual shapes that duplicate a collision shape."""
    solid = [shape for shape in shapes if shape.collides]
    return [shape for shape in shapes if not shape.collides and any(_same(shape, each) for each in solid)]


def _same(first: MakerShape, second: MakerShape) -> bool:
    return (
        first.kind == second.kind
        and np.allclose(first.size, second.size)
        and np.allclose(first.pos, second.pos)
        and np.allclose(np.abs(np.dot(first.quat, second.quat)), 1.0)
    )


def _fitted(shape: MakerShape, is_foot: bool) -> MakerShape:
    """The primitive that replaces a mesh."""
    assert shape.points is not None
    if is_foot:
        pos, size = sole_box(shape.points)
        kind, quat = "box", np.array([1.0, 0.0, 0.0, 0.0])
    else:
        kind, pos, quat, size = primitive_of(shape.points)
    size = tuple(round(float(value), MESH_DECIMALS) for value in size)
    return replace(shape, kind=kind, shown=True, pos=pos.round(MESH_DECIMALS), quat=quat, size=size, points=None)


def _row(line: int, shape: MakerShape, role: str, colour: str, rows: list[ShapeRow]) -> ShapeRow:
    name = shape.name
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    known = {row.shape for row in rows}
    if not name or name in known:
        stem, number = name or f"{shape.link}_shape", 1
        while f"{stem}_{number}" in known:
            number += 1
        name = f"{stem}_{number}"
    turns = {"sphere": rotation.IDENTITY, "box": shape.quat}
    turn = turns[shape.kind] if shape.kind in turns else round_axis(shape.quat)
    return ShapeRow(
        line=line,
        shape=name,
        link=shape.link,
        kind=shape.kind,
        role=role,
        colour=colour,
        **columns("x y z", rounded(shape.pos)),
        **columns("roll pitch yaw", rpy_of(turn)),
        **columns("size_a size_b size_c", (*rounded(shape.size), 0.0, 0.0)[:3]),
    )
