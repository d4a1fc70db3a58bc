"""The benchmark of the closed loop: its faulty checkout, its commands, and what counts as a failed walk."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import pandas as pd
import pytest

from benchmarks import closed_loop
from pipeline.project import Project
from pipeline.selection import Curation, choose
from tests.factories.training_bundle import small_bundle

SHIPPED = Path("robots/t1/policies/walk/policy.npz")


def test_the_faulty_curation_leaves_out_the_side_steps_until_three_logs_raise_its_limit(tmp_path, root, monkeypatch):
    monkeypatch.setattr("tests.factories.checkout.Checkout.with_answers_of", lambda self, _: self)
    checkout = closed_loop.made(tmp_path / "checkout", faulty=True)
    assert not list((checkout.root / "data/hardware_logs").iterdir())
    curation = Project(checkout.root).read("curation.yaml", Curation)
    rows = [
        {"clip": f"{skill}@90-960", "source": "s", "file": skill, "licence": "CC0-1.0", "skill": skill, "seconds": 14.5}
        for skill in ("side_left", "side_right", "back")
    ]
    chosen = choose(pd.DataFrame(rows), curation)
    assert list(chosen["taken"]) == [False, False, True]
    assert curation.most_seconds["side_left"] * 1.2**3 > 14.5, "data/feedback_rules.yaml: x 1.2 for each policy's log"
    assert closed_loop.made(tmp_path / "checkout", faulty=True) == checkout, "made once"


def test_a_policy_is_distilled_with_the_documented_options(tmp_path, monkeypatch):
    commands: list[list[str]] = []
    started = lambda command, **_: commands.append(command) or argparse.Namespace(returncode=len(commands) - 1)  # noqa: E731
    monkeypatch.setattr("benchmarks.closed_loop.subprocess.run", started)
    assert closed_loop.distilled(tmp_path / "bundle", tmp_path / "run", 2, "cpu") == tmp_path / "run/policy.npz"
    assert commands[0][-6:] == [
        "--stages",
        "distillation",
        "--set",
        closed_loop.SMALL[0],
        "--set",
        closed_loop.SMALL[1],
    ]
    with pytest.raises(SystemExit, match="training of run ended with status 1"):
        closed_loop.distilled(tmp_path / "bundle", tmp_path / "run", 2, "cuda")
    assert commands[1][-2:] == ["--stages", "distillation"]


def test_a_command_that_the_policy_follows_has_no_failures(tmp_path, root, robot, monkeypatch):
    monkeypatch.setattr(closed_loop, "WALKS", 1)
    bundle = small_bundle(tmp_path, root, robot)
    assert closed_loop.failures(bundle, root / SHIPPED, (0.6, 0.0, 0.0)) == 0.0
    assert closed_loop.failures(bundle, root / SHIPPED, (4.0, 0.0, 0.0)) == 1.0


def test_a_walk_that_falls_reaches_nothing_and_both_sides_are_drawn(tmp_path, monkeypatch):
    before, after = tmp_path / "before", tmp_path / "after"
    fell = lambda bundle, policy, walk: {"fell": bundle == before and abs(walk.command[1]) > 0.3, "lateral": 0.2}  # noqa: E731
    monkeypatch.setattr(closed_loop, "walked", fell)
    assert math.isnan(closed_loop.reached(before, tmp_path, (0.0, 0.4, 0.0)))
    assert closed_loop.reached(after, tmp_path, (0.0, 0.4, 0.0)) == pytest.approx(0.5)
    assert [closed_loop.failures(side, tmp_path, (0.0, 0.4, 0.0)) for side in (before, after)] == [1.0, 0.0]
    sides = {side.name: (side, [tmp_path / "after-seed1/policy.npz"]) for side in (before, after)}
    closed_loop.draw(sides, (0.0, 0.4, 0.0), tmp_path / "loop.png")
    assert (tmp_path / "loop.png").stat().st_size > 1000
