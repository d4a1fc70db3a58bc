"""A small project for the curator's page: one recording, its windows, variants and rollouts, with real motions."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from typing import Any

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.robot import Robot
from tests.factories import human_clips, robot_clips

RECORDING = "lab/walk"
WINDOW = f"{RECORDING}@0-99"
NOT_TAKEN = f"{RECORDING}@100-199"
SKATING = "lab/skate@0-99"
KEPT = f"{WINDOW}~mirror~rollout"
SLIPPING = f"{WINDOW}~x0.9~rollout"
CUT = f"{WINDOW}~rollout"
"""Its first and last second went on, as two pieces."""


def curated_project(root: Path, folder: Path, robot: Robot) -> Path:
    """Settings of the project and a store with every kind of row; the folder."""
    (folder / "data").mkdir(parents=True)
    for name in ("curation.yaml", "feedback_rules.yaml", "feasibility.yaml"):
        shutil.copy2(root / "data" / name, folder / "data" / name)
    shutil.copytree(root / "robots/t1", folder / "robots/t1", ignore=shutil.ignore_patterns("policies"))
    store = Store(root=folder / "data/store")
    for stage, manifest in manifests(store, robot).items():
        store.save(stage, manifest)
    return folder


def manifests(store: Store, robot: Robot) -> dict[str, Manifest]:
    """By stage, what it made. The robot's clips have 150 frames at 50 Hz, the person's 200 at 60 Hz."""
    person = store.put_clip(human_clips.standing(seconds=200 / 60, name=RECORDING))
    machine = store.put_clip(robot_clips.wandering(robot, seconds=3.0))
    recorded = {"source": "lab", "licence": "CC0-1.0", "fps": 60.0, "kind": "human", "file": "walk.bvh"}
    window = {**recorded, "skill": "walk", "seconds": 100 / 60, "start_frame": 0, "stop_frame": 100}
    robots = {**window, "floor_m": 0.0, "seconds": 3.0, "parent": WINDOW}
    catalog = [entry(RECORDING, person, recorded), entry("lab/skate", person, recorded)]
    not_taken = reason("not_taken", f"{NOT_TAKEN}: the 600 s of walk are filled by other windows")
    windows = [entry(WINDOW, person, window), entry(SKATING, person, window)]
    repaired = store.put_clip(human_clips.standing(seconds=100 / 60, name=WINDOW))
    variants = [entry(f"{WINDOW}{mark}", machine, robots) for mark in ("", "~mirror", "~x0.9")]
    rollouts = [
        entry(f"{each.clip}~rollout", machine, {**each.numbers, "reference": each.clip, "reference_frame": 0})
        for each in variants
    ]
    slip = reason("foot_slip_p95", "feet slide", start_s=1.0, stop_s=1.5, value=0.6, limit=0.4, unit="m/s")
    pieces = [
        entry(KEPT, machine, {**robots, "weight": 0.5, "family": WINDOW, "foot_slip_p95": 0.1}),
        entry(f"{CUT}+0", machine, {**robots, "seconds": 1.0, "weight": 0.2, "stretch_start_s": 0.0}),
        entry(f"{CUT}+1", machine, {**robots, "seconds": 1.0, "weight": 0.3, "stretch_start_s": 2.0}),
    ]
    skating = reason("foot_skate", "standing feet slide", start_s=0.5, stop_s=1.0)
    return {
        "motion_catalog": made("motion_catalog", catalog, [judged(each.clip, each.clip) for each in catalog]),
        "selected_motions": made(
            "selected_motions", windows, [judged(RECORDING, WINDOW, not_taken), judged("lab/skate", SKATING)]
        ),
        "repaired_motions": made(
            "repaired_motions",
            [entry(WINDOW, repaired, {**window, "floor_m": 0.0})],
            [judged(WINDOW, WINDOW), judged(SKATING, None, skating)],
        ),
        "retargeted_motions": made("retargeted_motions", variants[:1], [judged(WINDOW, WINDOW)]),
        "motion_variants": made(
            "motion_variants", variants, [dataclasses.replace(judged(WINDOW), pieces=tuple(e.clip for e in variants))]
        ),
        "reference_motions": made("reference_motions", variants, [judged(each.clip, each.clip) for each in variants]),
        "augmented_motions": made(
            "augmented_motions", rollouts, [judged(each.clip, f"{each.clip}~rollout") for each in variants]
        ),
        "feasible_motions": made(
            "feasible_motions",
            pieces,
            [
                judged(KEPT, KEPT, foot_slip_p95=0.1),
                dataclasses.replace(judged(CUT, None, slip, foot_slip_p95=0.5), pieces=(f"{CUT}+0", f"{CUT}+1")),
                judged(SLIPPING, None, slip, foot_slip_p95=0.6),
            ],
        ),
    }


def made(stage: str, entries: list[Entry], rows: list[Judged]) -> Manifest:
    return Manifest(stage=stage, entries=tuple(entries), judged=tuple(rows))


def entry(clip: str, blob: str, numbers: dict[str, Any]) -> Entry:
    return Entry(clip=clip, blob=blob, numbers=numbers)


def judged(clip: str, piece: str | None = None, *reasons: dict[str, Any], **numbers: Any) -> Judged:
    kept = {"seconds_in": 3.0, "seconds_out": 3.0 if piece else 0.0, **numbers}
    return Judged(clip=clip, pieces=(piece,) if piece else (), reasons=reasons, numbers=kept)


def reason(code: str, text: str, **more: Any) -> dict[str, Any]:
    return {"code": code, "text": text, "effect": "rejected", **more}
