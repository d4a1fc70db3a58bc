"""The code version of a stage: a digest of the sources and libraries its answers depend on.

A number raised by hand is forgotten sooner or later; the sources are not. The price is that a
changed comment recomputes a stage.
"""

import functools
from importlib import metadata
from pathlib import Path

from pipeline.files import digest

PACKAGE = Path(__file__).resolve().parent.parent
BELOW_ALL_STAGES = ("batch", "clips", "files", "quality", "robot", "simulation")
LIBRARIES = ("numpy", "scipy", "mujoco", "pin", "placo", "pyarrow", "pandas")
"""Of every stage."""
OWN_LIBRARIES = {
    "dart": ("dartpy",),
    "expert": ("torch",),
    "export": ("onnx", "onnxruntime", "torch"),
    "learning": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
    "tracking": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
    "training": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
}
"""By package: those of the stages alone that name it. Another version of them leaves all other answers as they are."""


@functools.cache
def code_version(*packages: str) -> str:
    """Digest (12 hex digits) of `pipeline/<package>`, of what lies below all stages, and of library versions."""
    folders = [PACKAGE / name for name in (*packages, *BELOW_ALL_STAGES)]
    paths = sorted(PACKAGE.glob("*.py"))
    for folder in folders:
        paths += sorted(path for path in folder.rglob("*") if path.suffix in {".py", ".yaml"})
    own = {name for package in packages for name in OWN_LIBRARIES.get(package, ())}
    libraries = {name: installed(name) for name in sorted({*LIBRARIES, *own})}
    return digest.of_json([digest.of_files(paths, PACKAGE), libraries])[:12]


def installed(library: str) -> str:
    """The version of a library; empty where it is not there."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""
