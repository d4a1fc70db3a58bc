"""Advice for motion files of unsupported formats."""

from pathlib import Path

from pipeline.errors import FileError

_NAMES = " (docs/sources.md lists the names)."

CONVERT: dict[str, str] = {
    ".fbx": "Import it into Blender and export it as BVH or glTF: blender --background --factory-startup "
    "--python-expr \"import bpy; bpy.ops.import_scene.fbx(filepath='IN.fbx'); "
    "bpy.ops.export_scene.gltf(filepath='OUT.glb')\".",
    ".mvnx": "Open its .mvn in Xsens MVN (MVN Analyze or Animate) and export it as BVH, or as FBX and convert that.",
    ".mvn": "Open it in Xsens MVN (MVN Analyze or Animate) and export it as BVH.",
    ".trc": "Export the markers as C3D under Plug-in Gait's names, or solve a skeleton in the capture program and "
    "export BVH.",
    ".npy": "An array without names: write it into an archive, numpy.savez(FILE, poses=..., trans=..., fps=...).",
    ".pth": "Save it as .pt with torch.save({name: tensor, ...}, FILE).",
    **dict.fromkeys((".pickle", ".joblib"), "Rename it to .pkl."),
    ".tak": "Export the take from Motive as BVH.",
    ".cal": "A calibration; export the take from Nokov Seeker or Motive as BVH.",
    **dict.fromkeys(
        (".usd", ".usda", ".usdc"), "Export the skeleton's animation from Omniverse or Blender as glTF or BVH."
    ),
    ".blend": "Export the armature's action from Blender as BVH or glTF.",
    ".vmd": "Import it into Blender (MMD Tools) and export it as BVH.",
    ".vrma": "It is glTF: rename it to .glb.",
    **dict.fromkeys((".h5", ".hdf5"), f"Write its arrays into an archive with numpy.savez{_NAMES}"),
    ".mat": f"Write its arrays into an archive with scipy.io.loadmat and numpy.savez{_NAMES}",
    ".parquet": "A LeRobot data set holds no human motion; of a robot write root and joints into a CSV.",
    ".mot": "OpenSim coordinates: convert them to BVH.",
    ".v": "Export the trial from Vicon Nexus or Shogun as C3D or BVH.",
    ".x3d": "Convert it to glTF in Blender.",
    ".dae": "Collada: import it into Blender (before 5.0) or Maya and export it as BVH or glTF.",
    ".bip": "Export the Biped from 3ds Max as BVH, or as FBX and convert that.",
    **dict.fromkeys((".zip", ".7z", ".rar", ".tar", ".gz", ".bz2", ".xz"), "Unpack it; what is inside is read then."),
    ".json": "A DeepMimic motion is read when it is named .txt; otherwise write the arrays into an archive with "
    f"numpy.savez{_NAMES}",
    ".txt": f"Numbers without names: write them into a CSV with a header, or into an archive with numpy.savez{_NAMES}",
    ".bag": "A ROS 1 bag: convert it to MCAP.",
    ".db3": "A ROS 2 bag: convert it to MCAP (ros2 bag convert).",
}
"""Suffix -> how to convert it to a supported format."""

NO_MOTION = frozenset(
    (
        *("", ".asf", ".yaml", ".yml", ".toml", ".ini", ".cfg", ".log", ".lock", ".md5", ".sha256"),
        *(".md", ".rst", ".pdf", ".doc", ".docx", ".odt", ".rtf", ".tex", ".bib", ".html", ".htm", ".css", ".ipynb"),
        *(".png", ".jpg", ".jpeg", ".gif", ".svg", ".webp", ".bmp", ".tif", ".tiff", ".ico"),
        *(".mp4", ".mov", ".avi", ".mkv", ".webm", ".wav", ".mp3", ".ogg", ".flac"),
        *(".py", ".pyc", ".sh", ".bat", ".js", ".m", ".c", ".h", ".cpp", ".hpp", ".cs"),
        *(".urdf", ".mjcf", ".xml", ".xacro", ".stl", ".obj", ".mtl", ".ply"),
        *(".bak", ".tmp", ".part", ".swp", ".blend1", ".url", ".lnk"),
    )
)
"""Suffixes of files without motion, which are not counted; all others are."""

POINTER = b"version https://git-lfs"


def how_to_convert(suffix: str) -> str:
    """How to convert a file of an unsupported format; empty if unknown."""
    return CONVERT.get(suffix.lower(), "")


def refuse_pointer(path: Path) -> None:
    """Raise FileError for a Git LFS pointer in place of a file's content."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(POINTER))
    except OSError:
        return  # the reader reports the error
    if start == POINTER:
        problem = "it is a Git LFS pointer: the file itself was not downloaded."
        raise FileError(path, problem, "Run `git lfs pull` in its repository.")
