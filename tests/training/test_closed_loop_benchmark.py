"""The benchmark of the closed loop: its faulty checkout, the order of its steps, and what counts as a failed walk."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import pandas as pd
import pytest

from benchmarks import closed_loop
from benchmarks.closed_loop import MIRRORED, PLANTED, SMALL
from pipeline.feedback.rules import FeedbackRules
from pipeline.project import Project
from pipeline.selection import Curation, choose
from tests.factories.checkout import Checkout
from tests.factories.training_bundle import small_bundle

SHIPPED = Path("robots/t1/policies/walk/policy.npz")
WINDOW_S = 14.5
"""Length of the one window of a side step in the shipped motions (data/motions/side_left.yaml)."""


def test_the_fault_excludes_side_steps_until_three_logs_raise_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(Checkout, "with_answers_of", lambda self, _: self)
    checkout = closed_loop.faulty_checkout(tmp_path / "checkout", [1, 2, 3])
    assert not list((checkout.root / "data/hardware_logs").iterdir())
    project = Project(checkout.root)
    curation, rule = (
        project.read("curation.yaml", Curation),
        project.read("feedback_rules.yaml", FeedbackRules).selection,
    )
    skills = ("side_left", "side_right", "back")
    same = {"source": "s", "licence": "CC0-1.0", "seconds": WINDOW_S}
    rows = [{"clip": f"{skill}@90-960", "file": skill, "skill": skill, **same} for skill in skills]
    assert list(choose(pd.DataFrame(rows), curation)["taken"]) == [False, False, True]
    assert curation.most_seconds["side_left"] * min(rule.per_experiment**3, rule.most) > WINDOW_S


def test_a_checkout_is_made_once_and_refused_for_other_seeds(tmp_path, monkeypatch):
    monkeypatch.setattr(Checkout, "with_answers_of", lambda self, _: self)
    checkout = closed_loop.faulty_checkout(tmp_path / "checkout", [1, 2])
    (checkout.root / "kept").touch()
    assert closed_loop.faulty_checkout(tmp_path / "checkout", [1, 2]) == checkout
    assert (checkout.root / "kept").is_file()
    with pytest.raises(SystemExit, match="is of the seeds 1 2"):
        closed_loop.faulty_checkout(tmp_path / "checkout", [1, 2, 3])


class World:
    """Commands that the benchmark runs, and what they would leave behind."""

    def __init__(self, *, helps: bool):
        self.helps = helps
        self.commands: list[str] = []

    def in_checkout(self, checkout: Checkout, *command: str, **_: str) -> argparse.Namespace:
        data = checkout.root / "data"
        self.commands.append("bundle" if command[1] == "-c" else command[1] if command[0] != "dagster" else command[-1])
        if command[1] == "simulate-robot":
            Path(command[2]).touch()
        elif command[-1].endswith("curation_feedback"):
            (data / "feedback").mkdir()
            (data / "feedback/proposed.yaml").write_text("approvals: []\n")
        elif command[1] == "-c":
            (data / "policies/t1/bundle").mkdir(parents=True, exist_ok=True)
            approved = self.helps and (data / "feedback/approved.yaml").is_file()
            (data / "policies/t1/bundle/references.npz").write_text("with side steps" if approved else "without")
        return argparse.Namespace(returncode=0)

    def outside(self, command: list[str], **_: object) -> argparse.Namespace:
        self.commands.append(Path(command[command.index("--out") + 1]).name)
        return argparse.Namespace(returncode=0)

    def walked(self, bundle: Path, policy: Path, walk) -> dict[str, float]:
        after = (bundle / "references.npz").read_text() == "with side steps"
        return {"fell": False, "forward": 0.8, "lateral": walk.command[1] if after else 0.0}


def _run(world: World, out: Path, monkeypatch) -> int:
    monkeypatch.setattr(Checkout, "with_answers_of", lambda self, _: self)
    monkeypatch.setattr(Checkout, "run", lambda self, *command, **more: world.in_checkout(self, *command, **more))
    monkeypatch.setattr("benchmarks.closed_loop.subprocess.run", world.outside)
    monkeypatch.setattr(closed_loop, "measure_walk", world.walked)
    monkeypatch.setattr(Checkout, "make", staticmethod(_empty_checkout))
    return closed_loop.main(["--out", str(out), "--seeds", "1", "2", "--device", "cpu"])


def _empty_checkout(project: Path, root: Path, motions: tuple[str, ...]) -> Checkout:
    (root / "data/hardware_logs").mkdir(parents=True)
    (root / "data/curation.yaml").write_text((project / "data/curation.yaml").read_text())
    return Checkout(root)


def test_the_loop_runs_in_order_and_a_repeated_command_only_continues(tmp_path, monkeypatch, capsys):
    world = World(helps=True)
    assert _run(world, tmp_path, monkeypatch) == 0
    before, after = ["before-seed1", "before-seed2"], ["after-seed1", "after-seed2"]
    made, logs, evidence = ["expert_db", "bundle"], ["simulate-robot"] * 2, ",".join(closed_loop.EVIDENCE)
    assert world.commands == [*made, *before, *logs, evidence, *made, *after]
    table = capsys.readouterr().out
    assert "before: failed at 0, 0.4 m/s, 0 rad/s (1 to 1, 2 of 2 seeds)" in table
    assert "after: failed at 0, 0.4 m/s, 0 rad/s (0 to 0, 2 of 2 seeds)" in table
    world.commands.clear()
    assert _run(world, tmp_path, monkeypatch) == 0
    assert world.commands == [*before, *after], "training itself finds that it is done"


def test_a_proposal_that_adds_no_clip_ends_the_loop(tmp_path, monkeypatch):
    world = World(helps=False)
    with pytest.raises(SystemExit, match=r"approved\.yaml: what 2 logs proposed adds no clip"):
        _run(world, tmp_path, monkeypatch)
    assert not [each for each in world.commands if each.startswith("after")]


def test_a_policy_is_distilled_with_the_documented_option(tmp_path, monkeypatch):
    commands: list[list[str]] = []
    started = lambda command, **_: commands.append(command) or argparse.Namespace(returncode=len(commands) - 1)  # noqa: E731
    monkeypatch.setattr("benchmarks.closed_loop.subprocess.run", started)
    assert closed_loop.distilled(tmp_path / "bundle", tmp_path / "run", 2, "cpu") == tmp_path / "run/policy.npz"
    assert commands[0][-4:] == ["--stages", "distillation", "--set", SMALL]
    with pytest.raises(SystemExit, match="training of run ended with status 1"):
        closed_loop.distilled(tmp_path / "bundle", tmp_path / "run", 2, "cuda")
    assert commands[1][-2:] == ["--stages", "distillation"]


def test_a_command_that_the_policy_follows_has_no_failures(tmp_path, root, robot, monkeypatch):
    monkeypatch.setattr(closed_loop, "WALKS", 1)
    bundle = small_bundle(tmp_path, root, robot)
    assert closed_loop.failures(bundle, root / SHIPPED, (0.6, 0.0, 0.0)) == 0.0
    assert closed_loop.failures(bundle, root / SHIPPED, (4.0, 0.0, 0.0)) == 1.0


def test_a_walk_that_falls_has_reached_nothing_and_both_sides_are_drawn(tmp_path, monkeypatch):
    before, after = tmp_path / "before", tmp_path / "after"
    fell = lambda bundle, policy, walk: {"fell": bundle == before and abs(walk.command[1]) > 0.3, "lateral": 0.2}  # noqa: E731
    monkeypatch.setattr(closed_loop, "measure_walk", fell)
    assert math.isnan(closed_loop.reached(before, tmp_path, PLANTED))
    assert closed_loop.reached(after, tmp_path, PLANTED) == pytest.approx(0.5)
    assert [closed_loop.failures(side, tmp_path, PLANTED) for side in (before, after)] == [1.0, 0.0]
    assert closed_loop.failures(after, tmp_path, MIRRORED) == 1.0, "to the other side"
    sides = {side.name: (side, [tmp_path / "after-seed1/policy.npz"]) for side in (before, after)}
    closed_loop.draw(sides, tmp_path / "loop.png")
    assert (tmp_path / "loop.png").stat().st_size > 1000
