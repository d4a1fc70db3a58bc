"""Read a manufacturer's model file, URDF or MJCF."""

from pathlib import Path
from xml.etree import ElementTree as Xml

from pipeline.errors import FileError
from pipeline.robot_import.maker_model import MakerModel
from pipeline.robot_import.read_mjcf import read_mjcf
from pipeline.robot_import.read_urdf import read_urdf

MAX_BYTES = 20_000_000


def read_model(path: Path) -> MakerModel:
    """A URDF or MJCF file. Raises FileError for a file that is neither, or that this project cannot represent."""
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the URDF or MJCF of the robot's maker.")
    if path.stat().st_size > MAX_BYTES:
        raise FileError(path, f"it is larger than {MAX_BYTES:,} bytes.", "Name the model file itself, not an archive.")
    try:
        root = Xml.fromstring(path.read_bytes())
    except (Xml.ParseError, ValueError, LookupError) as error:  # not XML, or an unknown encoding
        raise FileError(path, f"it is not XML ({error}).", "Name the URDF or MJCF of the robot's maker.") from error
    if root.tag == "robot":
        return read_urdf(path, root)
    if root.tag == "mujoco":
        return read_mjcf(path)
    raise FileError(path, f"its root element is '{root.tag}'.", "A URDF has 'robot', an MJCF 'mujoco'.")
