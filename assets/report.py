"""Definition of assets from plans, and their results: checks, metadata, tables, pictures, links, errors."""

import base64
import functools
import inspect
import sys
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn
from urllib.parse import quote

import dagster as dg
import pandas as pd

from assets.plan import FAULTS_TAG, FINGERPRINT_TAG, Plan, group_of, key_of, robot_plans
from pipeline.batch import Manifest
from pipeline.errors import PipelineError
from pipeline.files.shown_text import markdown_table
from pipeline.learning.training_error import TrainingError
from pipeline.project import PROJECT
from pipeline.robot import Robot
from pipeline.robot.build import COLUMNS


def asset_of(
    plan: Plan,
    kind: str,
    kp: str = "",
    *,
    deps: Sequence[str | dg.AssetKey] = (),
    checks: Mapping[str, str] | None = None,
    blocking: Mapping[str, str] | None = None,
    specs: Callable[[Plan], list[dg.AssetCheckSpec]] = lambda plan: [],
    **others: Any,
) -> Callable[[Callable[..., Any]], dg.AssetsDefinition]:
    """`dg.asset` with key, group, code version, tags and checks from the plan.

    An argument of the function with the annotation `Manifest` is an input: the asset with the argument's name. The
    argument `plan` is the plan. A PipelineError fails the run with its message and without a traceback.

    Args:
        plan: plan of the asset
        kind: label of the technology in the graph
        kp: number of the key problem that it solves
        deps: further dependencies: keys, or names of assets of the same robot or of all robots
        checks: name -> description of each check
        blocking: the same for checks that block downstream assets if they fail
        specs: makes further checks from the plan
        others: further arguments of `dg.asset`
    """
    named = [(blocking or {}, True), (checks or {}, False)]
    declared = [
        dg.AssetCheckSpec(name, asset=plan.key, blocking=blocks, description=text)
        for texts, blocks in named
        for name, text in texts.items()
    ]

    def decorate(function: Callable[..., Any]) -> dg.AssetsDefinition:
        return dg.asset(
            key=plan.key,
            group_name=group_of(plan.name, plan.robot),
            kinds={kind},
            code_version=plan.code_version(),
            tags={name: value for name, value in (("robot", plan.robot), ("kp", kp)) if value},
            ins={
                name: dg.AssetIn(key_of(name, plan.robot))
                for name, annotation in typing.get_type_hints(function).items()
                if annotation is Manifest and name != "return"
            },
            deps=[key_of(each, plan.robot) if isinstance(each, str) else each for each in deps],
            check_specs=[*specs(plan), *declared],
            **others,
        )(_body(function, plan))

    return decorate


def robot_asset(
    kind: str, kp: str = "", **others: Any
) -> Callable[[Callable[..., Any]], Callable[[Plan], dg.AssetsDefinition]]:
    """`asset_of` for an asset that every robot has: turns the function into a factory that takes the robot's plan.

    The name of the function is the name of the asset. Arguments as for `asset_of`.
    """

    def decorate(function: Callable[..., Any]) -> Callable[[Plan], dg.AssetsDefinition]:
        return functools.wraps(function)(lambda plan: asset_of(plan, kind, kp, **others)(function))

    return decorate


def assets_of(robot: str, factories: Sequence[Callable[[Plan], dg.AssetsDefinition]]) -> list[dg.AssetsDefinition]:
    """The assets of a robot, made by their factories (`robot_asset`)."""
    plans = robot_plans(robot)
    return [make(plans[make.__name__]) for make in factories]


def result_of(
    plan: Plan,
    made: Manifest | dict[str, Any],
    metadata: Mapping[str, Any],
    checks: Sequence[dg.AssetCheckResult] = (),
    *,
    faults: int = 0,
    tags: Mapping[str, str] | None = None,
) -> dg.MaterializeResult:
    """Result for Dagster: the digest of the manifest as data version, fingerprint and faults as tags.

    Args:
        plan: plan of the asset
        made: the manifest, or for an asset without clips only its settings
        metadata: rows of the asset's page; tables are moved to the end
        checks: results of the checks
        faults: number of clips or logs lost to an unexpected error
        tags: further tags
    """
    manifest = made if isinstance(made, Manifest) else Manifest(stage=plan.name, entries=(), judged=(), settings=made)
    return dg.MaterializeResult(
        asset_key=plan.key,
        value=manifest,
        metadata=dict(sorted(metadata.items(), key=lambda item: isinstance(item[1], dg.TableMetadataValue))),
        check_results=checks,
        data_version=dg.DataVersion(manifest.digest),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT), FAULTS_TAG: str(faults), **(tags or {})},
    )


def check_result(
    plan: Plan, name: str, passed: bool, found: str, more: Mapping[str, Any] | None = None, *, warn: bool = True
) -> dg.AssetCheckResult:
    """Result of a check.

    Args:
        plan: plan of the asset
        name: name of the check
        passed: whether it passed
        found: findings, in one line
        more: further metadata
        warn: whether failure is a warning instead of an error
    """
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=name,
        passed=passed,
        severity=dg.AssetCheckSeverity.WARN if warn else dg.AssetCheckSeverity.ERROR,
        metadata={"found": found, **(more or {})},
    )


MAX_ROWS = 200
"""Maximum number of rows of a table in the web UI; the manifest has all rows."""


def stage_metadata(manifest: Manifest, columns: Sequence[str], highest_first: str = "") -> dict[str, Any]:
    """Counts, seconds and reasons of a stage, a table of verdicts (rejected clips first) and one of the kept clips.

    Args:
        manifest: result of the stage
        columns: numbers of the kept clips to show
        highest_first: number by which the kept clips are sorted in descending order; empty: order of the manifest
    """
    fates, judged = manifest.fates(), manifest.judged_table([])
    order = [("rejected", "partly", "accepted").index(fate) for fate in judged["fate"]]
    worst_first = judged.assign(order=order).sort_values(by=["order", "clip"])
    entries = manifest.entry_table(["skill", "seconds", *columns, highest_first])
    if highest_first in entries.columns:
        entries = entries.sort_values(by=[highest_first, "clip"], ascending=[False, True], na_position="last")
    metadata: dict[str, Any] = {
        "clips in": fates.total(),
        "clips out": len(manifest.entries),
        "clips accepted": fates["accepted"],
        "clips partly accepted": fates["partly"],
        "clips rejected": fates["rejected"],
        "seconds in": round(manifest.seconds("seconds_in"), 2),
        "seconds out": round(manifest.seconds("seconds_out"), 2),
        "clips recomputed": manifest.recomputed,
        "dagster/row_count": len(manifest.entries),
        "verdict on each clip": table_of(worst_first, ["clip", "fate", "seconds_in", "seconds_out", "reasons"]),
        "kept clips": table_of(entries, ["clip", "skill", "seconds", *columns]),
    }
    for effect in ("rejected", "repaired", "noted"):
        counts = manifest.reason_counts(effect)
        if counts:
            text = markdown_table(("reason", "times"), sorted(counts.items()))
            metadata[f"reasons {effect}"] = dg.MetadataValue.md(text)
    return metadata


def table_of(
    rows: pd.DataFrame | Sequence[Mapping[str, Any]], columns: Sequence[str] | None = None
) -> dg.TableMetadataValue:
    """A table of the named columns, as far as they exist, or of all columns; at most `MAX_ROWS` rows."""
    frame = rows if isinstance(rows, pd.DataFrame) else pd.DataFrame(rows)
    names_in_order = dict.fromkeys(frame.columns if columns is None else columns)
    shown = frame[[name for name in names_in_order if name in frame.columns]].head(MAX_ROWS)
    names = [str(name) for name in shown.columns]
    records = [
        dg.TableRecord({name: _cell(value) for name, value in zip(names, row, strict=True)})
        for row in shown.itertuples(index=False, name=None)
    ]
    schema = dg.TableSchema(columns=[dg.TableColumn(name, "string") for name in names])
    return dg.MetadataValue.table(records, schema=schema)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def picture(png: bytes) -> dg.MarkdownMetadataValue:
    """A PNG embedded in the metadata; the web UI shows it on `Show Markdown`."""
    return dg.MetadataValue.md(f"![picture](data:image/png;base64,{base64.b64encode(png).decode()})")


ADDRESS = "http://127.0.0.1:8090"
"""Default address of the server of `booster-lab curate`."""


def curator_link(page: str) -> dict[str, dg.MarkdownMetadataValue]:
    """Metadata row with a link to the curator's `databases`, `proposals`, or `?stage=…` for the clips of a stage."""
    return page_link(f"#/{quote(page, safe='?=&')}", "curator's page")


def page_link(path: str, name: str) -> dict[str, dg.MarkdownMetadataValue]:
    """Metadata row with a link to a path of the curator's server."""
    link = f"{ADDRESS}/{path}"
    return {name: dg.MetadataValue.md(f"[{link}]({link}) (start it with `booster-lab curate`)")}


def joint_table(robot: Robot) -> pd.DataFrame:
    """One row per joint: limits, gains and armature under the names of joints.csv [rad, rad/s, N m, kg m^2]."""
    columns = {column: getattr(robot, name) for name, column in COLUMNS.items()}
    return pd.DataFrame({"joint": robot.joint_names, **{name: list(values) for name, values in columns.items()}})


def stop(sentence: str) -> NoReturn:
    """Fail a run with one message and no traceback, in the terminal and in the web UI.

    Dagster prints its own stack frames below any raised exception, also below a dg.Failure. For a
    DagsterUserCodeExecutionError it omits them and prints the cause, which here has no frames because it is not raised
    itself.
    """
    cause = dg.Failure(sentence, allow_retries=False)
    try:
        raise cause from None
    except dg.Failure:
        here = sys.exc_info()  # Dagster requires a traceback; this one has one frame
    error = dg.DagsterUserCodeExecutionError(sentence.rstrip("."), user_exception=cause, original_exc_info=here)
    raise error from cause.with_traceback(None)


@contextmanager
def as_failure() -> Iterator[None]:
    """Turn a PipelineError or TrainingError into a failure of the run with its message."""
    try:
        yield
    except (PipelineError, TrainingError) as error:
        stop(str(error))


def _body(function: Callable[..., Any], plan: Plan) -> Callable[..., Any]:
    """Wrap the function or generator of an asset in `as_failure`, and pass the plan to its argument `plan`."""
    signature = inspect.signature(function)
    given = {"plan": plan} if "plan" in signature.parameters else {}

    @functools.wraps(function)
    def returned(*arguments: Any, **named: Any) -> Any:
        with as_failure():
            return function(*arguments, **named, **given)

    @functools.wraps(function)
    def yielded(*arguments: Any, **named: Any) -> Any:
        with as_failure():
            yield from function(*arguments, **named, **given)

    body: Any = yielded if inspect.isgeneratorfunction(function) else returned
    left = [each for name, each in signature.parameters.items() if name not in given]
    body.__signature__ = signature.replace(parameters=left)
    return body
