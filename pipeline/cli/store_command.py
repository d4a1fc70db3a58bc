"""`booster-lab store`: how large the store is, and what of it no run needs any more."""

from __future__ import annotations

from pathlib import Path

from pipeline.batch.collect import Part, collect
from pipeline.batch.store import MOST_ASKINGS
from pipeline.cli.arguments import Store
from pipeline.cli.project import Project, find_project
from pipeline.cli.text_table import text_table

MB = 1e6


def run(args: Store) -> int:
    """Print the table of sizes; delete what is old where that is asked for. Raises StoreInUseError, FileError."""
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
    rows.append(["databases and their earlier versions", len(databases), size / MB, 0, 0.0])
    shown = [[name, files, round(size, 1), old, round(old_size, 1)] for name, files, size, old, old_size in rows]
    columns = 5 if is_gc else 3
    header = ["", "files", "MB", "files not needed", "MB not needed"]
    return text_table(header[:columns], [row[:columns] for row in shown])


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
