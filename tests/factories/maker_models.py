"""A maker's URDF and MJCF for tests: the T1's own model files, changed."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import trimesh

ROOT = Path(__file__).resolve().parents[2]
T1 = ROOT / "robots" / "t1"


def t1_urdf() -> Xml.Element:
    """The root element of the T1's URDF."""
    return Xml.fromstring((T1 / "t1.urdf").read_text())


def t1_mjcf() -> Xml.Element:
    """The root element of the T1's MJCF."""
    return Xml.fromstring((T1 / "t1.xml").read_text())


def write(path: Path, root: Xml.Element) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(Xml.tostring(root))
    return path


def joint(urdf: Xml.Element, name: str) -> Xml.Element:
    return next(each for each in urdf.iter("joint") if each.get("name") == name)


def link(urdf: Xml.Element, name: str) -> Xml.Element:
    return next(each for each in urdf.iter("link") if each.get("name") == name)


def without_sites(urdf: Xml.Element) -> Xml.Element:
    """The URDF without the fixed links of sites."""
    fixed = [each for each in urdf.findall("joint") if each.get("type") == "fixed"]
    sites = {each.find("child").get("link") for each in fixed}  # type: ignore[union-attr]
    for each in fixed:
        urdf.remove(each)
    for each in [each for each in urdf.findall("link") if each.get("name") in sites]:
        urdf.remove(each)
    return urdf


def put_mesh(urdf: Xml.Element, owner: str, filename: str, tag: str = "collision") -> None:
    """Replace all shapes of a link by one mesh."""
    element = link(urdf, owner)
    for each in [*element.findall("collision"), *element.findall("visual")]:
        element.remove(each)
    geometry = Xml.SubElement(Xml.SubElement(element, tag), "geometry")
    Xml.SubElement(geometry, "mesh", filename=filename)


def write_mesh(path: Path, extents: tuple[float, float, float], centre: tuple[float, float, float]) -> None:
    """A box as a mesh file [m]."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh = trimesh.creation.box(extents=extents)
    mesh.apply_translation(np.array(centre))
    mesh.export(path)
