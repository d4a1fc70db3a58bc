"""The database in the forms that other programs load, one optional asset each: nothing depends on them."""

from typing import Any

import dagster as dg

from assets.actuators import declared
from assets.plainly import plainly
from assets.plan import Plan, export_plans, named_plans
from assets.policy import result_of
from assets.project import DEFAULT_ROBOT, PROJECT
from pipeline.batch import Manifest
from pipeline.files import digest

EXPORT = "export"
"""Key under which an export's facts are in its manifest."""


def dataset_exports(robot: str) -> list[Any]:
    """An asset for each format of `booster-lab export`."""
    database = named_plans(robot)["expert_db"]
    return [_export(plan, kind, database) for kind, plan in export_plans(robot).items()]


def _export(plan: Plan, kind: str, database: Plan) -> Any:
    @dg.asset(
        **declared(plan, kind, deps=[database.key]),
        description=f"The expert database as `booster-lab export --format {kind}` writes it, with its dataset card.",
    )
    @plainly
    def dataset_export(context: dg.AssetExecutionContext):
        from pipeline.dataset_export import export_database
        from pipeline.expert.swap import replace_folder
        from pipeline.robot import load_robot

        robot = plan.robot or DEFAULT_ROBOT
        folder = PROJECT.exports(robot, kind)
        written: list[int] = []

        def fill(part: Any) -> None:
            source = PROJECT.expert_db(robot)
            written.append(export_database(source, kind, lambda name: load_robot(PROJECT.robot_folder(name)), part))

        replace_folder(folder, fill)
        files = {
            path.relative_to(folder).as_posix(): digest.of_file(path)
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        facts = {
            "stage": plan.name,
            "format": kind,
            "folder": folder.relative_to(PROJECT.root).as_posix(),
            "clips": written[0],
            "files": files,
        }
        context.log.info(f"{written[0]} clips in {folder}")
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={EXPORT: facts})
        metadata = {
            "clips": written[0],
            "files": len(files),
            "size [MB]": sum((folder / name).stat().st_size for name in files) / 1e6,
            "dagster/uri": dg.MetadataValue.path(str(folder)),
        }
        return result_of(plan, manifest, metadata, [])

    return dataset_export
