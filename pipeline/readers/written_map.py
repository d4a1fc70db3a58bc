"""The skeleton map of a file as YAML: the one that it is read with, or one to start from."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import FileError
from pipeline.readers.bvh import read_bvh
from pipeline.readers.gltf import read_gltf
from pipeline.readers.joint_names import without_prefix
from pipeline.readers.match_skeleton import match_skeleton
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.roles import find_roles
from pipeline.readers.unknown_skeleton import map_text, map_to_start_from

READERS = {".bvh": read_bvh, ".glb": read_gltf, ".gltf": read_gltf}
"""Readers of formats whose skeletons may need a map of their own."""


def written_map(path: Path, stated: str | None = None) -> str:
    """The map that a file is read with; where there is none a map with the joints that are known filled in.

    Raises FileError for a file that can't be read, or of a format whose skeleton is always the same.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(sorted(READERS))
        raise FileError(path, f"files of this format need no skeleton map; those that may are: {known}.")
    motion: RawMotion = reader(path)
    bare = motion.renamed(without_prefix(motion.joint_names))
    try:
        skeleton = match_skeleton(motion, stated).skeleton
    except FileError:
        roles = find_roles(bare.joint_names, bare.parents, bare.rest_offset)
        return map_to_start_from(bare.joint_names, roles)
    return map_text(skeleton.title, skeleton.bodies)
