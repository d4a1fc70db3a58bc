"""Another version of a library makes stale what uses it, and nothing else."""

import ast
from pathlib import Path

import pytest

from assets.plan import plans
from pipeline.batch import code_version as module
from pipeline.batch.code_version import BELOW_ALL_STAGES, LIBRARIES, OWN_LIBRARIES, code_version
from pipeline.project import Project

NAMES = {"torch": "torch", "onnx": "onnx", "onnxruntime": "onnxruntime", "dartpy": "dartpy", "mjlab": "mjlab"}
NAMES |= {"rsl_rl": "rsl-rl-lib", "mujoco_warp": "mujoco-warp", "warp": "warp-lang", "mujoco": "mujoco"}
NAMES |= {"scipy": "scipy", "placo": "placo", "pinocchio": "pin", "pyarrow": "pyarrow", "pandas": "pandas"}
NAMES |= {"c3d": "c3d", "mcap": "mcap", "rosbags": "rosbags", "lz4": "lz4", "zstandard": "zstandard"}
"""Libraries that compute answers: how they are imported -> how they are installed."""

TRACKED = ("tracking_policy", "augmented_motions", "expert_db")
"""Assets of the tracking package."""


def versions(root: Path, changed: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The code version of every asset of the T1 where a library is another."""
    known = module.installed
    code_version.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(module, "installed", lambda name: "another" if name == changed else known(name))
        found = {plan.name: plan.code_version() for plan in plans(Project(root)).values()}
    code_version.cache_clear()
    return found


@pytest.mark.parametrize(
    ("library", "stale"),
    [
        ("dartpy", {"amp_policy", "cross_engine_validation", "limit_cycles"}),
        ("torch", {"amp_policy", "exported_policy", "release_report", *TRACKED}),
        ("onnx", {"amp_policy", "exported_policy", "release_report"}),
        ("mjlab", {"amp_policy", *TRACKED}),
        ("c3d", {"motion_catalog"}),
        ("a library of nobody", set()),
    ],
)
def test_another_version_makes_stale_what_uses_it_alone(
    root: Path, monkeypatch: pytest.MonkeyPatch, library: str, stale: set[str]
):
    before, after = (versions(root, changed, monkeypatch) for changed in ("", library))
    assert {name for name in before if before[name] != after[name]} == stale


def test_another_mujoco_makes_everything_stale(root: Path, monkeypatch: pytest.MonkeyPatch):
    before, after = (versions(root, changed, monkeypatch) for changed in ("", "mujoco"))
    assert all(before[name] != after[name] for name in before)


def test_packages_name_the_libraries_that_they_import(root: Path):
    stages = {name for plan in plans(Project(root)).values() for name in plan.packages} | set(BELOW_ALL_STAGES)
    for package in sorted(stages):
        used = set()
        for path in (root / "pipeline" / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
                used |= {NAMES[name.split(".")[0]] for name in names if name.split(".")[0] in NAMES}
        assert used <= {*LIBRARIES, *OWN_LIBRARIES.get(package, ())}, package


def test_a_library_that_is_missing_is_a_version_of_its_own():
    assert module.installed("there-is-no-such-library") == ""
    assert module.installed("numpy")
