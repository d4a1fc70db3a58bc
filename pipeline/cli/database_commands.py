"""`booster-lab database`, `sources`, `export`, `store`: versions, sources of runs, other formats, size of the store."""

import contextlib
import textwrap
from pathlib import Path

from pipeline.batch.collect import Part, alone, collect
from pipeline.batch.store import MOST_ASKINGS
from pipeline.cli.arguments import Database, Export, Sources, Store
from pipeline.cli.text_table import name_values, text_table
from pipeline.curation_page.clip_table import DATABASE, asset_of
from pipeline.curation_page.compare_databases import versions
from pipeline.dataset_export import export_database
from pipeline.dataset_export.export import CARD
from pipeline.errors import FileError, PipelineError
from pipeline.expert import history, manifest
from pipeline.files.csv_json import read_json
from pipeline.files.swap import current
from pipeline.project import DEFAULT_ROBOT, Project, find_project
from pipeline.readers.remembered import forget, read_remembered


def database(args: Database) -> int:
    """Summarize the database, list its versions, or restore one. Raises UnknownNameError, FileError."""
    project = find_project()
    folder = project.expert_db(project.robot(args.robot).name)
    if args.action == "restore":
        if args.version is None:
            raise PipelineError("name the version to restore; to list them: booster-lab database list")
        store, holder = project.store.root, f"booster-lab database restore {args.version}"
        with alone(store, holder) if store.is_dir() else contextlib.nullcontext():
            made = history.restore(folder, args.version, project.feedback.approved)
        print(f"{folder}: {made.name} is now the current database, {made.clips} clips, {made.seconds:.1f} s.")
        print(
            f"It stays until the next run, for example `{_materialize_command(args.robot)}`, writes the database again."
        )
        return 0
    if args.action == "summary":
        print(summary(folder, args.robot, (project.robot_folder(args.robot) / "policies" / "walk").is_dir()))
        return 0
    rows = [[each.name, each.clips, each.seconds] for each in versions(folder)]
    if [name for name, *_ in rows[:1]] != ["current"]:
        print(f"{folder}: there is no current database")
    if rows:
        print(text_table(["version", "clips", "seconds"], rows))
    return 0


def summary(folder: Path, robot: str, ships_policy: bool) -> str:
    """Summary of the current database (clips, seconds, skills, folder) and next steps. Raises PipelineError."""
    if not (folder / manifest.FILE).is_file():
        raise PipelineError(f"there is no database of '{robot}' yet; make it with: {_materialize_command(robot)}")
    version = history.describe(folder, "current")
    seconds = read_json(folder / manifest.FILE)["seconds_by_skill"]
    skills = ", ".join(f"{skill} {value:.0f} s" for skill, value in seconds.items())
    option = "" if robot == DEFAULT_ROBOT else f" --robot {robot}"
    steps = {
        f"booster-lab curate{option}": "watch, accept and exclude clips in the browser",
        "dagster dev": "the graph and each stage's report: http://localhost:3000",
    }
    if ships_policy:
        steps[f"booster-lab play robots/{robot}/policies/walk{option}"] = "command the shipped policy"
    steps["docs/sources.md"] = "bring your own recordings"
    return (
        f"\nThe expert database of the {robot} has {version.clips} clips, {version.seconds:.0f} s.\n"
        f"  skills   {skills}\n"
        f"  sources  {', '.join(f'{source} {clips}' for source, clips in version.by_source.items())}\n"
        f"  folder   {folder}\n\n"
        "Next, with the environment active (source .venv/bin/activate):\n"
        f"{textwrap.indent(name_values(steps), '  ')}"
    )


def _materialize_command(robot: str) -> str:
    """The command that materializes a robot's database."""
    return f"dagster asset materialize --select {asset_of(DATABASE, robot)}"


def sources(args: Sources) -> int:
    """List the sources that runs have used, or remove some from the record."""
    record = find_project().remembered_sources
    if args.action == "forget":
        if not args.names:
            raise PipelineError("name the sources to forget; to list them: booster-lab sources list")
        for each in forget(record, args.names):
            print(f"forgotten: {each.text()}")
        return 0
    known = read_remembered(record)
    if not known:
        print("no run has used a source yet")
        return 0
    rows = [[each.name, each.files, each.named_in, each.folder] for each in known]
    print(text_table(["source", "files", "named in", "folder"], rows))
    return 0


def export(args: Export) -> int:
    """Write the database's clips in another format and print how many."""
    project, name = find_project(), args.database.name
    if not args.database.is_dir():
        robot = name if name in project.robots else DEFAULT_ROBOT
        raise FileError(args.database, "it is not a folder.", f"Make the database: {_materialize_command(robot)}")
    if args.out.resolve().is_relative_to(current(args.database).resolve()):
        raise FileError(args.out, "it is inside the database, which must not be changed.", "Name another folder.")
    if any(args.out.glob("*")):
        raise FileError(args.out, "it is not empty.", "Name an empty folder.")
    written = export_database(args.database, args.format, project.robot, args.out, args.skill, args.naming)
    print(f"{written} clips and {CARD} in {args.out}")
    return 0


MB = 1e6


def store_size(args: Store) -> int:
    """Print a table of sizes; with `--delete`, delete unneeded results. Raises StoreInUseError, FileError."""
    project, is_gc = find_project(), args.action == "gc"
    parts = collect(project.store, args.keep if is_gc else MOST_ASKINGS, delete=is_gc and args.delete)
    print(project.store.root)
    print(_table(parts, project, is_gc))
    if is_gc:
        found = f"{sum(len(part.old) for part in parts)} files, {sum(part.old_size for part in parts) / MB:.1f} MB"
        again = f"booster-lab store gc --keep {args.keep} --delete"
        print(f"deleted: {found}" if args.delete else f"nothing was deleted; to delete {found}: {again}")
    return 0


def _table(parts: tuple[Part, ...], project: Project, is_gc: bool) -> str:
    rows = [[part.what, part.files, part.size / MB, len(part.old), part.old_size / MB] for part in parts]
    databases = _files(project.root / "data" / "expert_db")
    size = sum(path.stat().st_size for path in databases)
    rows.append(["databases with earlier versions", len(databases), size / MB, 0, 0.0])
    shown = [[name, files, round(size, 1), old, round(old_size, 1)] for name, files, size, old, old_size in rows]
    columns = 5 if is_gc else 3
    header = ["", "files", "MB", "files not needed", "MB not needed"]
    return text_table(header[:columns], [row[:columns] for row in shown])


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
