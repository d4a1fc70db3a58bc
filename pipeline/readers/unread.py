"""Files that hold motion and are not read: what a person can do about them."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import FileError

CONVERT: dict[str, str] = {
    ".fbx": "Import it into Blender and export it as BVH or glTF: blender --background --factory-startup "
    "--python-expr \"import bpy; bpy.ops.import_scene.fbx(filepath='IN.fbx'); "
    "bpy.ops.export_scene.gltf(filepath='OUT.glb')\"",
    ".mvnx": "Open its .mvn in Xsens MVN (MVN Analyze or Animate) and export it as BVH, or as FBX and convert that.",
    ".mvn": "Open it in Xsens MVN (MVN Analyze or Animate) and export it as BVH.",
    ".trc": "Export the markers as C3D under Plug-in Gait's names, or solve a skeleton in the capture program and "
    "export BVH.",
    ".npy": "An array without names: write it into an archive, numpy.savez(FILE, poses=..., trans=..., fps=...).",
    ".pth": "Save it as .pt with torch.save({name: tensor, ...}, FILE).",
    ".pickle": "Rename it to .pkl.",
    ".joblib": "Rename it to .pkl.",
    ".tak": "Export the take from Motive as BVH.",
    ".cal": "A calibration; export the take from Nokov Seeker or Motive as BVH.",
    ".usd": "Export the skeleton's animation from Omniverse or Blender as glTF or BVH.",
    ".usda": "Export the skeleton's animation from Omniverse or Blender as glTF or BVH.",
    ".usdc": "Export the skeleton's animation from Omniverse or Blender as glTF or BVH.",
    ".blend": "Export the armature's action from Blender as BVH or glTF.",
    ".vmd": "Import it into Blender (MMD Tools) and export it as BVH.",
    ".vrma": "It is glTF: rename it to .glb.",
    ".h5": "Write its arrays into an archive with numpy.savez (docs/sources.md lists the names).",
    ".hdf5": "Write its arrays into an archive with numpy.savez (docs/sources.md lists the names).",
    ".mat": "Write its arrays into an archive with scipy.io.loadmat and numpy.savez (docs/sources.md lists the names).",
    ".parquet": "A LeRobot data set holds no human motion; of a robot write root and joints into a CSV.",
    ".mot": "OpenSim coordinates: convert them to BVH.",
    ".v": "Export the trial from Vicon Nexus or Shogun as C3D or BVH.",
    ".x3d": "Convert it to glTF in Blender.",
}
"""Suffix -> how to make a file of it that is read."""

POINTER = b"version https://git-lfs"


def how_to_convert(suffix: str) -> str:
    """What to do about a file of a format that is not read; empty where it is not known."""
    return CONVERT.get(suffix.lower(), "")


def is_pointer(path: Path) -> bool:
    """A Git LFS pointer stands in the place of the file."""
    try:
        with path.open("rb") as stream:
            return stream.read(len(POINTER)) == POINTER
    except OSError:
        return False


def refuse_pointer(path: Path) -> None:
    """Raises FileError for a Git LFS pointer."""
    if is_pointer(path):
        problem = "it is a Git LFS pointer: the file itself was not downloaded."
        raise FileError(path, problem, "Run `git lfs pull` in its repository.")
