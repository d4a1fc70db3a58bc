"""Changes proposed from failures by rules. Each change names its logs; each log or failure without a change, a reason.

The size of a change depends on the number of experiments, not of failures: ten falls in one log count as one. Copies of
a log (complete, torn or split) count once, with all of their trials. Copies are found among the trusted logs only, so
that an untrusted copy does not exclude a trusted one. All simulated logs of one policy count once, however many cells
or validations there are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import TrialReport
from pipeline.feasibility.command_space import VELOCITIES, CommandSettings, cell_of
from pipeline.feedback.change import Change, allowed_range, check_bounds, neutral
from pipeline.feedback.rules import LESS, TIME_SCALE, Answer, FeedbackRules, MotorRule
from pipeline.feedback.trust import (
    CommandNamer,
    CountedTrial,
    Pair,
    doubt_of,
    grouped,
    trusted,
    without_copies,
    witnesses_of,
)
from pipeline.selection import SKILLS
from pipeline.selection.skills import SkillBounds, distances

STANDING, OF_STEPS = "stand", (TIME_SCALE, "step_length", "foot_lift")
"""Perturbations that do not apply to the skill `stand`."""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """Changes proposed from all logs."""

    changes: tuple[Change, ...]
    unproposed: tuple[str, ...]
    """The reason for each log, failure or number without a proposed change."""


def propose(
    reports: Sequence[TrialReport], rules: FeedbackRules, commands: CommandSettings, skills: SkillBounds
) -> Proposal:
    """Propose changes from the failures of all trials.

    Args:
        reports: failures of each trial
        rules: which failures count, and how far each number may change
        commands: cells of the command space, as in KP5
        skills: velocity ranges of the skills, as in KP1
    """
    trustworthy, unproposed = trusted(sorted(reports, key=lambda report: (report.trial, report.file)), rules)
    counting, copies = without_copies(trustworthy)
    unproposed += copies
    pairs = [(trial, failure) for trial in counting for failure in trial.report.failures if failure.of_policy]
    counted = [pair for pair in pairs if not doubt_of(pair[1], rules)]
    unproposed += [
        f"{trial.report.trial}: {each.text()}: {doubt_of(each, rules)}"
        for trial, each in pairs
        if doubt_of(each, rules)
    ]
    changes: list[Change] = []
    for robot in sorted({trial.report.robot for trial, _ in counted}):
        own = [pair for pair in counted if pair[0].report.robot == robot]
        trials = [trial for trial in counting if trial.report.robot == robot]
        cell, skill = _cell_namer(commands), _skill_namer(skills)
        changes += _factors("weights", own, trials, rules, cell)
        changes += _factors("selection", own, trials, rules, skill)
        perturbed, undecided = _perturbations(own, trials, rules, skill)
        motors, doubts = _motors(own, rules.motors)
        changes, unproposed = [*changes, *perturbed, *motors], [*unproposed, *undecided, *doubts]
        changes += _ranges(own, rules)
    check_bounds(changes, rules)
    return Proposal(changes=tuple(changes), unproposed=tuple(unproposed))


def _cell_namer(commands: CommandSettings) -> CommandNamer:
    def cell(command: tuple[float, float, float]) -> str:
        row = pd.DataFrame([dict(zip(VELOCITIES, command, strict=True))])
        return str(cell_of(row, commands).iloc[0])

    return cell


def _skill_namer(bounds: SkillBounds) -> CommandNamer:
    def skill(command: tuple[float, float, float]) -> str:
        forward, lateral, yaw = (np.array([value]) for value in command)
        return SKILLS[int(np.argmin(distances(forward, lateral, yaw, bounds)[0]))]

    return skill


def _factors(
    section: str, pairs: Sequence[Pair], trials: Sequence[CountedTrial], rules: FeedbackRules, name: CommandNamer
) -> list[Change]:
    """Changes of the sections `weights` and `selection`: factors on command cells or skills."""
    rule = rules.weights if section == "weights" else rules.selection
    groups = grouped(pairs, trials, rule.kinds, rules.trust.least_share, name)
    return [_moved(section, group, key, rules, before=1.0, bound=rule.most) for key, group in groups.items()]


def _perturbations(
    pairs: Sequence[Pair], trials: Sequence[CountedTrial], rules: FeedbackRules, name: CommandNamer
) -> tuple[list[Change], list[str]]:
    """Perturbations of the clips of each skill, by the rules for its failures, and reasons for none.

    If some failures require less and others more of the same perturbation, neither is proposed.
    """
    changes, silent = [], []
    for kind, rule in rules.augmentation.items():
        by_skill: dict[str, dict[str, list[Pair]]] = {}
        for answer in rule.answers:
            fitting = [pair for pair in pairs if _answered(pair[1], answer)]
            for skill, group in grouped(fitting, trials, answer.kinds, rules.trust.least_share, name).items():
                by_skill.setdefault(skill, {}).setdefault(answer.way, []).extend(group)
        for skill, ways in sorted(by_skill.items()):
            if skill == STANDING and kind in OF_STEPS:
                continue
            if len(ways) > 1:
                silent.append(f"{kind} of {skill} is not changed: some failures require less of it, others more")
                continue
            ((way, group),) = ways.items()
            changes.append(_perturbation(kind, skill, way, group, rules))
    return changes, silent


def _answered(failure: Failure, answer: Answer) -> bool:
    """Whether an answer applies to the direction and cause of a failure; its kind is checked later."""
    return (not answer.directions or failure.direction in answer.directions) and (
        not answer.causes or failure.evidence.get("cause") in answer.causes
    )


def _perturbation(kind: str, skill: str, way: str, group: Sequence[Pair], rules: FeedbackRules) -> Change:
    sign, without = -1.0 if way == LESS else 1.0, neutral(kind)
    rule = rules.augmentation[kind]
    change = _change("augmentation", group, f"{kind} of {skill}", without, round(without + sign * rule.most, 6))
    return replace(change, value=round(without + sign * rule.amount(change.experiments), 6))


def _change(section: str, group: Sequence[Pair], what: str, before: float, bound: float) -> Change:
    """A change with the failures of `group` as evidence, whose value is still `before`."""
    robot, witnesses = group[0][0].report.robot, witnesses_of(group)
    facts = {"section": section, "robot": robot, "what": what, "bound": bound, "witnesses": witnesses}
    return Change(value=before, before=before, **facts)


def _moved(
    section: str, group: Sequence[Pair], what: str, rules: FeedbackRules, *, before: float, bound: float
) -> Change:
    """A change to the value farthest from `before` that the rule allows for the number of experiments."""
    change = _change(section, group, what, before, bound)
    allowed = allowed_range(change, rules)
    assert allowed is not None
    furthest = max(allowed, key=lambda value: abs(value - before))
    return replace(change, value=round(furthest, 6))


def _motors(pairs: Sequence[Pair], rule: MotorRule) -> tuple[list[Change], list[str]]:
    """Lower torque limits of joints that gave less torque than commanded, consistently in several logs."""
    by_joint: dict[str, list[Pair]] = {}
    for trial, failure in pairs:
        if failure.kind in rule.kinds and "given_n_m" in failure.evidence:
            by_joint.setdefault(failure.joint, []).append((trial, failure))
    changes, silent = [], []
    for joint, group in sorted(by_joint.items()):
        given = _by_log(group, "given_n_m")
        limit = float(np.median(list(_by_log(group, "limit_n_m").values())))
        value = float(np.median(list(given.values())))
        spread = (max(given.values()) - min(given.values())) / value
        why = _objection(value, limit, spread, len(given), rule)
        if why:
            silent.append(f"{joint} gave {value:.1f} of {limit:g} N m and keeps its limit: {why}")
            continue
        change = _change("motors", group, joint, limit, round(rule.lowest * limit, 3))
        changes.append(replace(change, value=round(value, 3)))
    return changes, silent


def _by_log(group: Sequence[Pair], name: str) -> Mapping[str, float]:
    """Recording -> median of an evidence value over its failures."""
    values: dict[str, list[float]] = {}
    for trial, failure in group:
        values.setdefault(trial.recording, []).append(float(failure.evidence[name]))
    return {log: float(np.median(each)) for log, each in values.items()}


def _objection(value: float, limit: float, spread: float, logs: int, rule: MotorRule) -> str:
    if value > (1.0 - rule.least_reduction) * limit:
        return f"it is less than {100 * rule.least_reduction:g} % below the limit"
    if logs < rule.least_logs:
        return f"{logs} log{'s' if logs > 1 else ''} show{'' if logs > 1 else 's'} it, {rule.least_logs} are required"
    if spread > rule.agreement:
        return f"the logs differ by {100 * spread:.0f} %"
    if value < rule.lowest * limit:
        return f"below {rule.lowest:g} of it, the motor is probably broken"
    return ""


def _ranges(pairs: Sequence[Pair], rules: FeedbackRules) -> list[Change]:
    """Changes of the section `randomization`: wider ranges for training."""
    changes = []
    for name, rule in sorted(rules.randomization.items()):
        group = [
            (trial, failure)
            for trial, failure in pairs
            if failure.kind in rule.kinds and (not rule.causes or failure.evidence.get("cause") in rule.causes)
        ]
        if group:
            changes.append(_moved("randomization", group, name, rules, before=rule.start, bound=rule.bound))
    return changes
