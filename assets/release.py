"""`release_report`: one page from the stored results, for a person to sign. It runs no check itself."""

import base64
import re
from collections.abc import Mapping
from typing import Any

import dagster as dg
import numpy as np

from assets.bootstrap import cause, stale_now
from assets.plan import RELEASED, Plan, plans
from assets.policy import export_facts, stored_policy
from assets.report import check_result, page_link, result_of, robot_asset
from assets.sources import DATA_VERSION_TAG
from pipeline.batch import Manifest
from pipeline.errors import PipelineError
from pipeline.export.card import card_rows, read_card
from pipeline.files import atomic, digest
from pipeline.files.shown_text import markdown_list
from pipeline.project import DEFAULT_ROBOT, PROJECT, Project
from pipeline.release.dossier import Dossier, Origin, Picture, Verdict, verdict_of
from pipeline.release.page import page
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.validation.deployed import deployed

READY = "ready_to_sign"
VERDICTS = ("mujoco_validation", "cross_engine_validation", "webots_validation", "limit_cycles")
"""Assets that evaluate the policy; each stores whether it passed under the key `passed`."""
DATABASE = "expert_db"
SPEEDS_M_S = (0.6, 2.0)
"""Commanded forward speeds of the pictures [m/s]."""
LONGEST_FACT = 90
"""Maximum length of a metadata value in the lineage, in characters."""
FACTS = 8
"""Maximum number of metadata values per asset in the lineage."""

PICTURE = re.compile(r"data:image/(png|gif);base64,([A-Za-z0-9+/=]+)")


@robot_asset("html", deps=RELEASED, checks={READY: "Every check was run on this policy and passed."})
def release_report(context: dg.AssetExecutionContext, plan: Plan):
    """Release report: policy card, data lineage, verdicts with reasons, pictures, missing checks, signature block."""
    robot = plan.robot or DEFAULT_ROBOT
    dossier = gather(context.instance, PROJECT, robot, released(robot), stale_now(context.instance, PROJECT))
    path = PROJECT.release_report(robot)
    text = page(dossier)
    atomic.write_text(path, text)
    points = dossier.open_points
    for point in points:
        context.log.info(f"open: {point}")
    facts = {
        "stage": plan.name,
        "policy": dossier.policy,
        "page": digest.of_bytes(text.encode()),
        "open": [*points],
    }
    check = check_result(plan, READY, not points, "; ".join(points) or "every check was run and passed")
    metadata = {
        "policy": dossier.policy or "none",
        "open points": dg.MetadataValue.md(markdown_list(points)),
        "digest of the page": facts["page"],
        **page_link(f"release/{robot}", "the page to sign"),
        "dagster/uri": dg.MetadataValue.path(str(path)),
    }
    return result_of(plan, {"release": facts}, metadata, [check])


def gather(
    instance: dg.DagsterInstance,
    project: Project,
    robot: str,
    known: Mapping[str, Plan],
    stale: Mapping[dg.AssetKey, str],
) -> Dossier:
    """Collect the stored results for the page.

    Args:
        instance: Dagster instance with the history
        project: project with the store
        robot: name of the robot
        known: name -> plan of each asset on the page
        stale: key of each stale asset -> the reason
    """
    exported = _stored(project, known.get("exported_policy"))
    facts = export_facts(exported) if exported is not None else {}
    events = {name: _last(instance, plan.key) for name, plan in known.items()}
    card, conditions = _card(project, robot, facts)
    return Dossier(
        title=f"Release report: {facts.get('name', 'no policy')} on {robot}",
        policy=facts.get("digest", ""),
        card=card,
        conditions=conditions,
        lineage=tuple(
            _lineage(plan, events[name], stale, facts.get("database", "") if name == DATABASE else "")
            for name, plan in known.items()
        ),
        verdicts=tuple(
            _verdict(instance, name, project, known.get(name), events.get(name), facts.get("digest", ""), stale)
            for name in VERDICTS
        ),
        pictures=_walks(exported, robot) if exported is not None else (),
    )


def _verdict(
    instance: dg.DagsterInstance,
    name: str,
    project: Project,
    plan: Plan | None,
    event: dg.AssetMaterialization | None,
    policy: str,
    stale: Mapping[dg.AssetKey, str],
) -> Verdict:
    if plan is None:
        return verdict_of(name, None, policy)
    failure = failed_since(instance, plan.key)
    try:
        stored = project.store.load(plan.key.to_user_string())
    except PipelineError as error:
        unread = project.store.manifest_path(plan.key.to_user_string()).is_file()
        broken = [failure] if failure else [str(error)] if unread else []
        result = {"passed": None, "policy": policy, "failed_to_run": broken}
        return verdict_of(name, result if broken else None, policy)
    outdated = f"it is stale: {stale[plan.key]}" if plan.key in stale else ""
    return verdict_of(name, result_in(stored), policy, failure or outdated, pictures_in(event))


def failed_since(instance: dg.DagsterInstance, key: dg.AssetKey) -> str:
    """A message if the last run of an asset failed in the asset's own step; empty if it did not."""
    planned = instance.get_latest_planned_materialization_info(key)
    made = instance.get_latest_materialization_event(key)
    if planned is None or (made is not None and made.run_id == planned.run_id):
        return ""
    steps = instance.all_logs(planned.run_id, of_type=dg.DagsterEventType.STEP_FAILURE)
    for each in steps:
        event = each.dagster_event
        if event is not None and event.step_key == "__".join(key.path):
            return f"its last run ({planned.run_id[:8]}) failed: {cause(event)}"
    return ""


def result_in(manifest: Manifest) -> dict[str, Any]:
    """Verdict of a validation: the entry of its manifest with the key `passed`. Not exactly one: it was not run."""
    results = [value for value in manifest.settings.values() if isinstance(value, dict) and "passed" in value]
    if len(results) == 1:
        return results[0]
    return {"passed": None, "not_run": f"its result has {len(results)} verdicts instead of one"}


def pictures_in(event: dg.AssetMaterialization | None) -> tuple[Picture, ...]:
    """The pictures in the metadata of an asset's last materialization."""
    found = []
    for name, value in (event.metadata if event is not None else {}).items():
        if isinstance(value, dg.MarkdownMetadataValue):
            for kind, data in PICTURE.findall(value.md_str or ""):
                found.append(Picture(caption=name, data=base64.b64decode(data), kind=kind))
    return tuple(found)


def _stored(project: Project, plan: Plan | None) -> Manifest | None:
    """The stored result of an asset; None if there is none or it is unreadable."""
    if plan is None:
        return None
    try:
        return project.store.load(plan.key.to_user_string())
    except PipelineError:
        return None


def _last(instance: dg.DagsterInstance, key: dg.AssetKey) -> dg.AssetMaterialization | None:
    event = instance.get_latest_materialization_event(key)
    return event.asset_materialization if event is not None else None


def _lineage(
    plan: Plan, event: dg.AssetMaterialization | None, stale: Mapping[dg.AssetKey, str], trained_on: str
) -> Origin:
    """Row of the lineage for an asset.

    Args:
        plan: plan of the asset
        event: its last materialization; None without one
        stale: key of each stale asset -> the reason
        trained_on: for the database, the digest of the version that the policy was trained on; else empty
    """
    asset = plan.key.to_user_string()
    if event is None:
        return Origin(asset=asset, version="none", remark="never materialized here")
    facts = []
    for key, value in event.metadata.items():
        plain = value.value if isinstance(value, (dg.TextMetadataValue, dg.IntMetadataValue)) else None
        plain = f"{value.value:.4g}" if isinstance(value, dg.FloatMetadataValue) and value.value is not None else plain
        if plain is not None and "/" not in key and len(str(plain)) <= LONGEST_FACT:
            facts.append((key, str(plain)))
    version = (event.tags or {}).get(DATA_VERSION_TAG, "not stated")
    remarks = [f"stale: {stale[plan.key]}"] if plan.key in stale else []
    if trained_on and trained_on != version:
        remarks.append(f"the policy was trained on another database: {trained_on[:12]}")
    return Origin(asset=asset, version=version[:12], remark="; ".join(remarks), facts=tuple(facts[:FACTS]))


def _card(
    project: Project, robot: str, facts: Mapping[str, Any]
) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Rows of the model card, and the conditions for the use of the policy."""
    if not facts:
        return (("policy", "none was exported"),), ()

    card = read_card(project.root / facts["folder"])
    rows = {"origin": facts["origin"], **card_rows(card)}
    licence = card.data.get("licence", {})
    conditions = [
        f"licence of its data, {licence.get('strictest', 'unknown')}: {licence.get('allowed_use', 'not stated')}",
        f"may ship with the project: {'yes' if card.shippable else 'no'}",
        "all figures are from simulation, unless a robot log is named",
    ]
    return tuple((name, str(value)) for name, value in rows.items()), tuple(conditions)


def _walks(exported: Manifest, robot: str) -> tuple[Picture, ...]:
    """Pictures of the policy in MuJoCo at `SPEEDS_M_S`: an animation of two seconds and a contact sheet for each."""
    from pipeline.viewing.contact_sheet import LARGE, contact_sheet, walk_gif
    from pipeline.viewing.playlist import Shown

    one = deployed(PROJECT.adapted_robot(robot), stored_policy(exported))
    pictures = []
    for speed in SPEEDS_M_S:
        walked = one.walk(
            MujocoPlant(one.robot, MujocoOptions(timestep_s=0.005)),
            lambda time_s, speed=speed: np.array([min(speed, time_s), 0.0, 0.0]),
            6.0,
            stop_on_fall=True,
        )
        ended = f"fell after {walked.fell_s:.1f} s" if walked.fell_s is not None else "no fall in 6 s"
        clip = walked.clip(f"{speed:g} m/s")
        ends_s = (len(clip.joint_pos) - 1) / clip.fps
        start_s = max(ends_s - 2.0, 0.0)
        name = f"{speed:g} m/s, last 1.5 s"
        last = Shown(name=name, robot_clip=walked.clip(name, start_s=min(start_s + 0.5, ends_s)))
        sheet = contact_sheet([last], one.robot, dots_per_m=LARGE)
        caption = f"forward {speed:g} m/s in MuJoCo, {ended}"
        pictures.append(Picture(caption=caption, data=walk_gif(clip, one.robot, start_s), kind="gif"))
        pictures.append(Picture(caption=caption, data=sheet))
    return tuple(pictures)


def released(robot: str) -> dict[str, Plan]:
    """Name -> plan of each asset on the page, in the order of the page."""
    by_name = {plan.name: plan for plan in plans(PROJECT).values() if plan.robot in (None, robot)}
    return {name: by_name[name] for name in RELEASED if name in by_name}
