"""Write a proposed robot folder, with a README on the origin of each column and on open points."""

import dataclasses
import tempfile
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files import digest
from pipeline.files.shown_text import cell
from pipeline.robot import Robot, load_robot
from pipeline.robot.adapted import write_robot_folder
from pipeline.robot_import.maker_model import MakerModel
from pipeline.robot_import.propose import Proposal
from pipeline.robot_import.stated import Stated

README = "README.md"


def write_folder(folder: Path, proposal: Proposal, readme: str) -> Robot:
    """Write a new robot folder and load it. The whole folder appears at once.

    Raises FileError if the folder exists, RobotError if it does not load.
    """
    if folder.exists():
        raise FileError(folder, "it exists already.", "Remove it, or choose another name or --out.")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as aside:
        part = Path(aside) / folder.name
        description = dataclasses.replace(proposal.description, folder=part)
        write_robot_folder(part, description)
        (part / README).write_text(readme, encoding="utf-8")
        part.replace(folder)
    return load_robot(folder)


def readme(proposal: Proposal, model: MakerModel, shapes: MakerModel | None, stated: Stated) -> str:
    """Markdown text."""
    source, name = shapes or model, proposal.description.name
    files = {cell(each.path.name): digest.of_file(each.path) for each in (model, source)}
    rows = [
        ("links: tree, origins, axes, masses, centres of mass, inertias", f"`{cell(model.path.name)}`"),
        ("joints: what is not listed below", f"`{cell(model.path.name)}`"),
        ("shapes", f"`{cell(source.path.name)}`, primitives in place of meshes"),
        ("sites", "column `source`"),
        ("`robot.toml`", "proposed from the tree"),
    ]
    if stated.path is not None:
        columns = [*stated.numbers, *(["controlled"] if stated.controlled else [])]
        rows.insert(2, (f"joints: {', '.join(f'`{name}`' for name in columns)}", f"`{cell(stated.path.name)}`"))
    lines = [
        f"# {name}, {len(proposal.description.joints)} joints",
        "",
        f"Imported by `booster-lab import-robot`. `{name}.xml` and `{name}.urdf` are rendered from the tables; "
        "edit the tables, then run",
        f"`python -m pipeline.robot.render robots/{name}`.",
        "",
        "| table, column | source |",
        "|---|---|",
        *(f"| {table} | {origin} |" for table, origin in rows),
        "",
        *(f"- `{file}`: sha256 `{value}`" for file, value in files.items()),
        "",
        "## To state",
        "",
        *(f"- {cell(text)}" for text in proposal.to_state),
    ]
    if proposal.notes:
        lines += ["", "## Not used of the files", "", *(f"- {cell(text)}" for text in proposal.notes)]
    return "\n".join(lines) + "\n"
