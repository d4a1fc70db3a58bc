"""The README of an imported robot folder: where each column comes from and what is open."""

from __future__ import annotations

from pipeline.files import digest
from pipeline.files.shown_text import cell
from pipeline.robot_import.maker_model import MakerModel
from pipeline.robot_import.propose import Proposal
from pipeline.robot_import.stated import Stated


def readme(proposal: Proposal, model: MakerModel, shapes: MakerModel | None, stated: Stated) -> str:
    """Markdown text."""
    source = shapes or model
    files = {cell(each.path.name): digest.of_file(each.path) for each in (model, source)}
    rows = [
        ("links: tree, origins, axes, masses, centres of mass, inertias", f"`{cell(model.path.name)}`"),
        ("joints: what is not listed below", f"`{cell(model.path.name)}`"),
        ("shapes", f"`{cell(source.path.name)}`, primitives in place of meshes"),
        ("sites", "column `source`"),
        ("`robot.toml`", "proposed from the tree"),
    ]
    columns = [*stated.numbers, *(["controlled"] if stated.controlled else [])]
    if stated.path is not None:
        rows.insert(2, (f"joints: {', '.join(f'`{name}`' for name in columns)}", f"`{cell(stated.path.name)}`"))
    lines = [
        f"# {proposal.description.name}, {len(proposal.description.joints)} joints",
        "",
        f"Imported by `booster-lab import-robot`. `{proposal.description.name}.xml` and "
        f"`{proposal.description.name}.urdf` are rendered from the tables; edit the tables, then run",
        f"`python -m pipeline.robot.render robots/{proposal.description.name}`.",
        "",
        "| table, column | source |",
        "|---|---|",
        *(f"| {table} | {origin} |" for table, origin in rows),
        "",
        *(f"- `{name}`: sha256 `{value}`" for name, value in files.items()),
        "",
        "## To state",
        "",
        *(f"- {cell(text)}" for text in proposal.to_state),
    ]
    if proposal.notes:
        lines += ["", "## Not used of the files", "", *(f"- {cell(text)}" for text in proposal.notes)]
    return "\n".join(lines) + "\n"
