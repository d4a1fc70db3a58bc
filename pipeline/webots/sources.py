"""Find the project modules that the controller imports, to copy them beside it."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import PipelineError

PIPELINE = Path(__file__).resolve().parents[1]
PROGRAM = Path(__file__).resolve().with_name("booster_lab.py")
ELSEWHERE = frozenset({"numpy", "jaxtyping", "controller"})
"""Allowed imports besides the standard library: numpy, Webots' module, and jaxtyping, which gets a shim."""

JAXTYPING_SHIM = '''"""Array shapes for readers; not checked here."""


class Float:
    def __class_getitem__(cls, key):
        return cls


Int = Bool = Float
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
    found: set[Path] = set()
    waiting = [PROGRAM]
    while waiting:
        path = waiting.pop()
        for module in _imports(ast.parse(path.read_text(encoding="utf-8"))):
            top = module.partition(".")[0]
            if top == "pipeline":
                waiting += set(_files(module)) - found
                found.update(_files(module))
            elif top not in ELSEWHERE and top not in sys.stdlib_module_names:
                raise ForeignImportError(path.stem, top)
    return {path.relative_to(PIPELINE.parent).as_posix(): path for path in sorted(found)}


def _files(module: str) -> Iterator[Path]:
    """The file of a module and the `__init__` files of the packages above it."""
    place = PIPELINE
    yield place / "__init__.py"
    for part in module.split(".")[1:]:
        place = place / part
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        if file.is_file():
            yield file


def _imports(node: ast.AST) -> Iterator[str]:
    """Modules that a file imports at run time, without those under `TYPE_CHECKING`."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    only_for_types = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    for child in node.orelse if only_for_types else ast.iter_child_nodes(node):
        yield from _imports(child)
