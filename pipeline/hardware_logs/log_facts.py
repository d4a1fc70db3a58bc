"""Metadata of a log: from its MCAP metadata record, and from the YAML file with its name (sidecar)."""

import dataclasses
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, Json, TypeAdapter

from pipeline.errors import PipelineError
from pipeline.files import digest, settings
from pipeline.files.ranges import OneOf, Pattern
from pipeline.hardware_logs.robot_log import COMMAND_SOURCES, EVENTS, LogFacts, OperatorEvent

DIGEST = re.compile(r"[0-9a-f]{64}")
MAX_ROWS = 100_000
"""Most rows of a schedule."""


@dataclass(frozen=True, kw_only=True)
class CommandStep:
    """A row of a schedule: the command from a time onward."""

    time_s: float
    forward_m_s: float
    left_m_s: float
    yaw_rate_rad_s: float


@dataclass(frozen=True, kw_only=True)
class NotedEvent:
    """An event noted by the operator."""

    time_s: float
    kind: Annotated[str, OneOf(EVENTS)]


@dataclass(frozen=True, kw_only=True)
class Sidecar:
    """The file `<log>.yaml`. It overrides the log's metadata, except for robot, policy and whether the log is
    simulated."""

    robot: Annotated[str | None, Pattern()] = None
    policy_digest: str | None = None
    command_source: Annotated[str | None, OneOf(COMMAND_SOURCES)] = None
    simulated: bool | None = None
    command: tuple[CommandStep, ...] | None = None
    command_scale: tuple[float, float, float] | None = None
    events: tuple[NotedEvent, ...] | None = None
    notes: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class StatedFacts:
    """Stated metadata; None where nothing is stated."""

    facts: LogFacts
    start_ns: int | None
    """Receipt time of the first message, as recorded [ns]."""
    remarks: tuple[str, ...]
    damaged: bool
    """Whether there are metadata that can't be used."""


class FactsError(PipelineError):
    """Raised for contradictory metadata, or a sidecar that can't be read."""


def to_metadata(facts: LogFacts, start_ns: int) -> dict[str, str]:
    """Metadata as strings of an MCAP metadata record, with a checksum, since MCAP has none for these records."""
    values = {
        "robot": facts.robot,
        "policy_digest": facts.policy_digest or "",
        "command_source": facts.command_source,
        "simulated": "yes" if facts.simulated else "no",
        "command": json.dumps([list(row) for row in facts.command]),
        "command_scale": json.dumps(list(facts.command_scale)),
        "events": json.dumps([[event.time_s, event.kind] for event in facts.events]),
        "notes": json.dumps(facts.notes, sort_keys=True),
        "start_ns": str(start_ns),
    }
    return {**values, "sha256": digest.of_json(values)}


def stated_facts(metadata: dict[str, str] | None, sidecar: Path | None) -> StatedFacts:
    """Metadata of a log from both places. Raises FactsError."""
    facts, start_ns, remarks = _of_metadata(metadata or {})
    damaged = bool(remarks)
    if sidecar is not None:
        facts, more = _with_sidecar(facts, sidecar)
        remarks += more
    if damaged and facts.get("policy_digest") and "simulated" not in facts:
        remarks.append(
            "its damaged metadata may have stated it as simulated: its policy is left out; state `simulated`."
        )
        facts["policy_digest"] = None
    policy = facts.get("policy_digest")
    if policy and not DIGEST.fullmatch(policy):
        remarks.append("its policy_digest is no SHA-256 and is left out.")
        policy = None
    if not policy:
        remarks.append("no policy is stated: it can't be laid to one.")
    known = LogFacts(**{"robot": "", **facts, "policy_digest": policy or None})
    return StatedFacts(facts=known, start_ns=start_ns, remarks=tuple(remarks), damaged=damaged)


Finite = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A log's parsed metadata record."""

    robot: str | None = None
    policy_digest: str | None = None
    command_source: Annotated[str, OneOf(COMMAND_SOURCES)] | None = None
    simulated: Annotated[str, OneOf(("yes", "no"))] | None = None
    command: Json[list[tuple[Finite, Finite, Finite, Finite]]] | None = None
    command_scale: Json[tuple[Finite, Finite, Finite]] | None = None
    events: Json[list[tuple[Finite, Annotated[str, OneOf(EVENTS)]]]] | None = None
    notes: Json[dict[str, str]] | None = None
    start_ns: int | None = None


_RECORDED = TypeAdapter(Recorded)


def _of_metadata(metadata: dict[str, str]) -> tuple[dict[str, Any], int | None, list[str]]:
    values = {key: text for key, text in metadata.items() if key != "sha256"}
    if "sha256" in metadata and digest.of_json(values) != metadata["sha256"]:
        return {}, None, ["its metadata is damaged and left out."]
    try:
        facts = {key: each for key, each in vars(_RECORDED.validate_python(values)).items() if each is not None}
    except ValueError:
        return {}, None, ["its metadata can't be read and is left out."]
    if "simulated" in facts:
        facts["simulated"] = facts["simulated"] == "yes"
    if "command" in facts:
        facts["command"] = tuple(sorted(facts["command"][:MAX_ROWS]))
    if "events" in facts:
        facts["events"] = tuple(OperatorEvent(time_s=at, kind=kind) for at, kind in facts["events"][:MAX_ROWS])
    return facts, facts.pop("start_ns", None), []


def _with_sidecar(facts: dict[str, Any], path: Path) -> tuple[dict[str, Any], list[str]]:
    try:
        sidecar = settings.read(path, Sidecar)
    except PipelineError as error:
        raise FactsError(f"its sidecar can't be used: {error}") from error
    for name in ("robot", "policy_digest"):
        one, other = facts.get(name), getattr(sidecar, name)
        if one and other and one != other:
            raise FactsError(f"its metadata states the {name} '{one}', its sidecar '{other}'")
    if None not in (sidecar.simulated, facts.get("simulated")) and sidecar.simulated != facts["simulated"]:
        one, other = ("is", "is not") if facts["simulated"] else ("is not", "is")
        raise FactsError(f"its metadata states that it {one} simulated, its sidecar that it {other}")
    stated = {
        each.name: getattr(sidecar, each.name)
        for each in dataclasses.fields(sidecar)
        if getattr(sidecar, each.name) not in (None, {})
    }
    if sidecar.command is not None:
        stated["command"] = tuple(sorted(dataclasses.astuple(step) for step in sidecar.command))
    if sidecar.events is not None:
        stated["events"] = tuple(
            OperatorEvent(time_s=event.time_s, kind=event.kind, source="sidecar") for event in sidecar.events
        )
    remarks = [f"its sidecar states {', '.join(sorted(stated))}."] if stated and facts else []
    return {**facts, **stated}, remarks
