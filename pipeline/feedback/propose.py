"""From failures to changes, by rules. Every change names the logs behind it; what proposes nothing says why.

What is counted is experiments, not failures: a robot that falls ten times in one log moves a number as far as one that
falls once. A log that is there twice, as a copy, a torn copy or in pieces, counts once, with all of its trials. Which
those are is asked after trust, so that a copy that cannot count takes nothing from the one that can. All simulated logs
of one policy count once: a validation of more cells, or another one, moves no number further.
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
from pipeline.feedback.trust import CountedTrial, NamedBy, Pair, doubt_of, grouped, recorded, trusted, witnesses_of
from pipeline.selection import SKILLS
from pipeline.selection.skills import SkillBounds, distances

STANDING, OF_STEPS = "stand", (TIME_SCALE, "step_length", "foot_lift")
"""Kinds of perturbation that standing has nothing of."""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """What the rules make of all logs."""

    changes: tuple[Change, ...]
    silent: tuple[str, ...]
    """A reason for each log, failure or number without a proposal."""


def propose(
    reports: Sequence[TrialReport], rules: FeedbackRules, commands: CommandSettings, skills: SkillBounds
) -> Proposal:
    """The changes that the reports ask for.

    `commands` names the cells of the command space as KP5 does, `skills` labels a command as KP1 labels a motion.
    """
    trustworthy, silent = trusted(sorted(reports, key=lambda report: (report.trial, report.file)), rules)
    heard, copies = recorded(trustworthy)
    silent += copies
    pairs = [(trial, failure) for trial in heard for failure in trial.report.failures if failure.of_policy]
    counted = [pair for pair in pairs if not doubt_of(pair[1], rules)]
    silent += [
        f"{trial.report.trial}: {each.text()}: {doubt_of(each, rules)}"
        for trial, each in pairs
        if doubt_of(each, rules)
    ]
    changes: list[Change] = []
    for robot in sorted({trial.report.robot for trial, _ in counted}):
        own = [pair for pair in counted if pair[0].report.robot == robot]
        trials = [trial for trial in heard if trial.report.robot == robot]
        cell, skill = _cell_namer(commands), _skill_namer(skills)
        changes += _factors("weights", own, trials, rules, cell)
        changes += _factors("selection", own, trials, rules, skill)
        perturbed, undecided = _perturbations(own, trials, rules, skill)
        motors, doubts = _motors(own, rules.motors)
        changes, silent = [*changes, *perturbed, *motors], [*silent, *undecided, *doubts]
        changes += _ranges(own, rules)
    check_bounds(changes, rules)
    return Proposal(changes=tuple(changes), silent=tuple(silent))


def _cell_namer(commands: CommandSettings) -> NamedBy:
    def cell(command: tuple[float, float, float]) -> str:
        row = pd.DataFrame([dict(zip(VELOCITIES, command, strict=True))])
        return str(cell_of(row, commands).iloc[0])

    return cell


def _skill_namer(bounds: SkillBounds) -> NamedBy:
    def skill(command: tuple[float, float, float]) -> str:
        forward, lateral, yaw = (np.array([value]) for value in command)
        return SKILLS[int(np.argmin(distances(forward, lateral, yaw, bounds)[0]))]

    return skill


def _factors(
    section: str, pairs: Sequence[Pair], trials: Sequence[CountedTrial], rules: FeedbackRules, name: NamedBy
) -> list[Change]:
    """Factors on command cells or skills."""
    rule = rules.weights if section == "weights" else rules.selection
    groups = grouped(pairs, trials, rule.kinds, rules.trust.least_share, name)
    return [_moved(section, group, key, rules, before=1.0, bound=rule.most) for key, group in groups.items()]


def _perturbations(
    pairs: Sequence[Pair], trials: Sequence[CountedTrial], rules: FeedbackRules, name: NamedBy
) -> tuple[list[Change], list[str]]:
    """Perturbations of the clips of skills, of each kind that a rule answers the failures of the skill with.

    Where some failures ask for less and others for more of the same, neither is proposed.
    """
    changes, silent = [], []
    for kind, rule in rules.augmentation.items():
        asked: dict[str, dict[str, list[Pair]]] = {}
        for answer in rule.answers:
            fitting = [pair for pair in pairs if _answered(pair[1], answer)]
            for skill, group in grouped(fitting, trials, answer.kinds, rules.trust.least_share, name).items():
                asked.setdefault(skill, {}).setdefault(answer.way, []).extend(group)
        for skill, ways in sorted(asked.items()):
            if skill == STANDING and kind in OF_STEPS:
                continue
            if len(ways) > 1:
                silent.append(f"{kind} of {skill} stays as it is: some failures ask for less of it, others for more")
                continue
            ((way, group),) = ways.items()
            changes.append(_perturbation(kind, skill, way, group, rules))
    return changes, silent


def _answered(failure: Failure, answer: Answer) -> bool:
    """Whether direction and cause of a failure are among those that are answered; its kind is checked later."""
    return (not answer.directions or failure.direction in answer.directions) and (
        not answer.causes or failure.evidence.get("cause") in answer.causes
    )


def _perturbation(kind: str, skill: str, way: str, group: Sequence[Pair], rules: FeedbackRules) -> Change:
    sign, without = -1.0 if way == LESS else 1.0, neutral(kind)
    rule = rules.augmentation[kind]
    change = _change("augmentation", group, f"{kind} of {skill}", without, round(without + sign * rule.most, 6))
    return replace(change, value=round(without + sign * rule.amount(change.experiments), 6))


def _change(section: str, group: Sequence[Pair], what: str, before: float, bound: float) -> Change:
    """A change that rests on some failures and moves nothing yet."""
    robot, witnesses = group[0][0].report.robot, witnesses_of(group)
    facts = {"section": section, "robot": robot, "what": what, "bound": bound, "witnesses": witnesses}
    return Change(value=before, before=before, **facts)


def _moved(
    section: str, group: Sequence[Pair], what: str, rules: FeedbackRules, *, before: float, bound: float
) -> Change:
    """The change that goes as far from `before` as the rule lets this many experiments."""
    change = _change(section, group, what, before, bound)
    allowed = allowed_range(change, rules)
    assert allowed is not None
    furthest = max(allowed, key=lambda value: abs(value - before))
    return replace(change, value=round(furthest, 6))


def _motors(pairs: Sequence[Pair], rule: MotorRule) -> tuple[list[Change], list[str]]:
    """Torque limits of joints that gave less than commanded, consistently in several logs."""
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
        why = _against(value, limit, spread, len(given), rule)
        if why:
            silent.append(f"{joint} gave {value:.1f} of {limit:g} N m and keeps its limit: {why}")
            continue
        change = _change("motors", group, joint, limit, round(rule.lowest * limit, 3))
        changes.append(replace(change, value=round(value, 3)))
    return changes, silent


def _by_log(group: Sequence[Pair], name: str) -> Mapping[str, float]:
    """Median over the failures of each recording."""
    values: dict[str, list[float]] = {}
    for trial, failure in group:
        values.setdefault(trial.recording, []).append(float(failure.evidence[name]))
    return {log: float(np.median(each)) for log, each in values.items()}


def _against(value: float, limit: float, spread: float, logs: int, rule: MotorRule) -> str:
    if value > (1.0 - rule.least_reduction) * limit:
        return f"that is less than {100 * rule.least_reduction:g} % below it"
    if logs < rule.least_logs:
        return f"{logs} log says so, {rule.least_logs} are required"
    if spread > rule.agreement:
        return f"the logs differ by {100 * spread:.0f} %"
    if value < rule.lowest * limit:
        return f"below {rule.lowest:g} of it the motor is broken"
    return ""


def _ranges(pairs: Sequence[Pair], rules: FeedbackRules) -> list[Change]:
    """Ends of the ranges that training draws from."""
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
