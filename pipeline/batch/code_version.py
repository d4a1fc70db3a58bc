"""The code version of a stage: a digest of the sources and libraries that its answers depend on.

Unlike a manually incremented number it can't be forgotten. The price is that a changed comment recomputes a stage.
"""

import functools
from importlib import metadata
from pathlib import Path

from pipeline.files import digest

PACKAGE = Path(__file__).resolve().parent.parent
BELOW_ALL_STAGES = ("batch", "clips", "files", "quality", "robot", "simulation")
LIBRARIES = ("numpy", "scipy", "mujoco", "pin", "placo", "pyarrow", "pandas")
"""Libraries of all stages."""
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
"""Package -> further libraries; a new version of these recomputes only the stages that use the package."""


@functools.cache
def code_version(*packages: str) -> str:
    """Digest (12 hex digits) of `pipeline/<package>`, of the packages below all stages, and of library versions."""
    sources = [*_digests("*.py")]
    for name in (*packages, *BELOW_ALL_STAGES):
        sources += _digests(f"{name}/**/*")
    own = {name for package in packages for name in OWN_LIBRARIES.get(package, ())}
    libraries = {name: installed(name) for name in sorted({*LIBRARIES, *own})}
    return digest.of_json([digest.of_json(sorted(sources)), libraries])[:12]


@functools.cache
def _digests(pattern: str) -> list[tuple[str, str]]:
    """Relative path and digest of each source file that matches a pattern; cached, since stages share most files."""
    paths = [path for path in PACKAGE.glob(pattern) if path.suffix in {".py", ".yaml"}]
    return [(path.relative_to(PACKAGE).as_posix(), digest.of_file(path)) for path in paths]


@functools.cache
def installed(library: str) -> str:
    """The version of a library; empty if it is not installed. Cached, since the lookup takes as long as reading the
    sources of a stage."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""
