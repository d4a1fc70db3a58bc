"""The shipped motions as texts by file name."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.generator import sidecar
from pipeline.generator.defects import DEFECTS, make_defect
from pipeline.generator.generate import generate
from pipeline.generator.recipes import RECIPES

README = """# Motions that ship with the project

Made by `python -m pipeline.generator data/motions`, byte for byte the same every time; do not edit them by hand. No
recording of a person went into them. Licence: CC0-1.0, use them for anything. docs/motions.md tells how they are made.

Beside each `<clip>.bvh` lies `<clip>.yaml`: what the clip is, and under `expect` what must happen to it in the
pipeline: its fate (`accepted`, `partly`, `rejected`), the reasons for what is lost, what is repaired, and the seconds
of each skill. The clips `defect_*` were sound and then spoilt; `defects` in their sidecar says how and where.

| clip | seconds | fate | what |
|---|---|---|---|
"""


def texts() -> Iterator[tuple[str, str]]:
    """File name and content of every file, one at a time."""
    rows = []
    for name, recipe in RECIPES.items():
        yield f"{name}.bvh", generate(recipe).bvh
        yield f"{name}.yaml", sidecar.to_text(sidecar.of_sound(recipe))
        rows.append((recipe, "accepted"))
    for name, defect in DEFECTS.items():
        yield f"{name}.bvh", make_defect(defect)[1]
        yield f"{name}.yaml", sidecar.to_text(sidecar.of_defect(defect))
        rows.append((defect.recipe, defect.fate))
    lines = [
        f"| {recipe.name} | {(recipe.frame_count - 1) / recipe.fps:.1f} | {fate} | {recipe.what} |"
        for recipe, fate in rows
    ]
    yield "README.md", README + "\n".join(lines) + "\n"
