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
    "hardware_logs": ("lz4", "mcap", "rosbags", "zstandard"),
    "readers": ("c3d",),
    "export": ("onnx", "onnxruntime", "torch"),
    "learning": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
    "tracking": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
    "training": ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch", "warp-lang"),
}
"""By package: those of the stages alone that name it. Another version of them leaves all other answers as they are."""


@functools.cache
def code_version(*packages: str) -> str:
    """Digest (12 hex digits) of `pipeline/<package>`, of what lies below all stages, and of library versions."""
    sources = [*_digests("*.py")]
    for name in (*packages, *BELOW_ALL_STAGES):
        sources += _digests(f"{name}/**/*")
    own = {name for package in packages for name in OWN_LIBRARIES.get(package, ())}
    libraries = {name: installed(name) for name in sorted({*LIBRARIES, *own})}
    return digest.of_json([digest.of_json(sorted(sources)), libraries])[:12]


@functools.cache
def _digests(pattern: str) -> list[tuple[str, str]]:
    """Path below the package and digest of each source file that fits a pattern. Once a process: stages share most."""
    paths = [path for path in PACKAGE.glob(pattern) if path.suffix in {".py", ".yaml"}]
    return [(path.relative_to(PACKAGE).as_posix(), digest.of_file(path)) for path in paths]


@functools.cache
def installed(library: str) -> str:
    """The version of a library; empty where it is not there. Once a process: finding it takes as long as reading the
    sources of a stage."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""
