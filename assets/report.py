"""What assets declare and report: result, checks, metadata, tables, pictures, links, and errors of one sentence."""

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
    """`dg.asset` with what follows from the plan. An error of the project is a Failure with its sentence.

    An argument of the function that is a `Manifest` is an input, the asset of that name; `plan` is the plan.

    Args:
        kind: what it is made with, as the graph shows it
        kp: number of its key problem
        deps: further assets that it depends on, as keys, or as names of assets of the same robot or of all robots
        checks: checks that it declares, name -> description; those of `blocking` stop what is downstream
        specs: further checks by the plan
        others: of `dg.asset`
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
    """`asset_of` for an asset that every robot has: the function, whose name is the asset's, becomes its factory."""

    def decorate(function: Callable[..., Any]) -> Callable[[Plan], dg.AssetsDefinition]:
        return functools.wraps(function)(lambda plan: asset_of(plan, kind, kp, **others)(function))

    return decorate


def assets_of(robot: str, factories: Sequence[Callable[[Plan], dg.AssetsDefinition]]) -> list[dg.AssetsDefinition]:
    """The assets of a robot that factories (`robot_asset`) make."""
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
    """The result that Dagster records: content as data version, fingerprint and faults as tags; tables come last.

    What is made is a manifest, or the settings of one without clips.
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
    """The result of a check.

    Args:
        found: what it found
        more: further metadata
        warn: whether a failed check is a warning, not an error
    """
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=name,
        passed=passed,
        severity=dg.AssetCheckSeverity.WARN if warn else dg.AssetCheckSeverity.ERROR,
        metadata={"found": found, **(more or {})},
    )


MAX_ROWS = 200
"""Rows of a table that are shown; the manifest has all."""


def stage_metadata(manifest: Manifest, columns: Sequence[str], highest_first: str = "") -> dict[str, Any]:
    """Counts, seconds and reasons of a stage, and its clips with the named numbers, the worst first.

    Clips that are kept are in the manifest's order, or those with the largest number `highest_first` come first.
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
        "what went on": table_of(entries, ["clip", "skill", "seconds", *columns]),
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
    """A table of the named columns (those that are there) or of all, at most `MAX_ROWS` rows."""
    frame = rows if isinstance(rows, pd.DataFrame) else pd.DataFrame(rows)
    wanted = dict.fromkeys(frame.columns if columns is None else columns)
    shown = frame[[name for name in wanted if name in frame.columns]].head(MAX_ROWS)
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
    """A PNG inside the event, for `Show Markdown`."""
    return dg.MetadataValue.md(f"![picture](data:image/png;base64,{base64.b64encode(png).decode()})")


ADDRESS = "http://127.0.0.1:8090"
"""Where `booster-lab curate` serves unless another port is named."""


def curator_link(page: str) -> dict[str, dg.MarkdownMetadataValue]:
    """The metadata row of a link: `databases`, `proposals`, or `?stage=…` for the clips of a stage."""
    return page_link(f"#/{quote(page, safe='?=&')}", "curator's page")


def page_link(path: str, name: str) -> dict[str, dg.MarkdownMetadataValue]:
    """The metadata row of a link to a path of the curator's server."""
    link = f"{ADDRESS}/{path}"
    return {name: dg.MetadataValue.md(f"[{link}]({link}) (start it with `booster-lab curate`)")}


def joint_table(robot: Robot) -> pd.DataFrame:
    """One row a joint: limits, gains, armature, as joints.csv names them. rad, rad/s, N m, kg m2."""
    columns = {column: getattr(robot, name) for name, column in COLUMNS.items()}
    return pd.DataFrame({"joint": robot.joint_names, **{name: list(values) for name, values in columns.items()}})


def stop(sentence: str) -> NoReturn:
    """Fail a run so that a sentence is what its events begin and end with, in a terminal and in the web UI.

    Dagster lists its own frames below whatever is raised, a dg.Failure too. Of a step's error of user code it leaves
    them out and shows the cause as well, which here has no frames because it is not itself what is raised.
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
    """Stop the run with the message of a PipelineError or TrainingError."""
    try:
        yield
    except (PipelineError, TrainingError) as error:
        stop(str(error))


def _body(function: Callable[..., Any], plan: Plan) -> Callable[..., Any]:
    """The body of an asset within `as_failure`; an argument `plan` is the asset's plan. The body may be a generator."""
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
