"""Find the project modules that the controller imports, to copy them beside it."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

from pipeline.errors import PipelineError

PIPELINE = Path(__file__).resolve().parents[1]
PROGRAM = Path(__file__).resolve().with_name("booster_lab.py")
ELSEWHERE = frozenset({"numpy", "jaxtyping", "controller"})
"""Allowed imports besides the standard library: numpy, Webots' module, and jaxtyping, which gets a shim."""

JAXTYPING_SHIM = '''"""Array shapes for readers; not checked here."""


class _Shape:
    def __class_getitem__(cls, key):
        return cls


class Float(_Shape):
    pass


class Int(_Shape):
    pass


class Bool(_Shape):
    pass
'''


class ForeignImportError(PipelineError):
    """The controller would need a package that Webots' Python may lack."""

    def __init__(self, module: str, package: str):
        super().__init__(
            f"module '{module}' imports '{package}', which the Webots project would then need; the controller may "
            f"use {', '.join(sorted(ELSEWHERE))} and the standard library."
        )


def needed_modules() -> dict[str, Path]:
    """Path below the controller's folder -> source file of each needed module. Raises ForeignImportError."""
    found: dict[str, Path] = {}
    waiting = [PROGRAM]
    while waiting:
        path = waiting.pop()
        for module in _imports(path):
            top = module.partition(".")[0]
            if top == "pipeline":
                waiting += [source for source in _files(module) if _add(found, source)]
            elif top not in ELSEWHERE and top not in sys.stdlib_module_names:
                raise ForeignImportError(path.stem, top)
    return dict(sorted(found.items()))


def _add(found: dict[str, Path], source: Path) -> bool:
    name = source.relative_to(PIPELINE.parent).as_posix()
    new = name not in found
    found[name] = source
    return new


def _files(module: str) -> list[Path]:
    """The file of a module and the `__init__` files of the packages above it."""
    parts = module.split(".")[1:]
    folder, files = PIPELINE, [PIPELINE / "__init__.py"]
    for part in parts:
        if (folder / part).is_dir():
            folder = folder / part
            files.append(folder / "__init__.py")
        elif (folder / f"{part}.py").is_file():
            files.append(folder / f"{part}.py")
    return files


def _imports(path: Path) -> list[str]:
    """Modules that a file imports at run time, without those under `TYPE_CHECKING`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    modules = []
    for node in _run(tree):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules += [f"{node.module}.{alias.name}" for alias in node.names]
    return modules


def _run(node: ast.AST) -> list[ast.AST]:
    nodes = [node]
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and isinstance(child.test, ast.Name) and child.test.id == "TYPE_CHECKING":
            nodes += [each for kept in child.orelse for each in _run(kept)]
        else:
            nodes += _run(child)
    return nodes
