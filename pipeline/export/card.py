"""The model card: a policy's origin, training run, data, licence and files."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.errors import FileError
from pipeline.files import atomic, settings
from pipeline.files import digest as digests
from pipeline.files.csv_json import json_text, read_json
from pipeline.files.shown_text import plain

OTHER_SEEDS, HELD_OUT = "other seeds", "held-out"
"""Keys of a card's figures (`pipeline.export.evidence`); the second is also the suite's name."""

FILE = "card.json"
PAGE = "CARD.md"
OF_RUN = "export"
"""Folder of the export inside the folder of a training run."""
SCHEMA = "booster-lab policy card 2"
UNSEALED = "booster-lab policy card 1"
"""Schema of older cards without a digest of their own content; read, but not written."""
SEAL = "sha256"
"""Key of the digest of the card's own content."""
MAX_BYTES = 5_000_000
"""Maximum size of a card [bytes], because parsing can take 480 times its size in memory."""
AGAIN = "Export the policy again."


@dataclass(frozen=True, kw_only=True)
class ModelCard:
    """Facts of an exported policy; JSON types only."""

    name: str
    robot: str
    digest: str
    """Digest of network and gains (`pipeline.deployment.digest`)."""
    run: dict[str, Any]
    """The training run: `name, commit, command, preset, seed, num_envs, device, iterations, seconds, options, …`."""
    data: dict[str, Any]
    """The expert database: `digest, clips, seconds, licence` as its manifest states them."""
    shippable: bool
    why: str
    """Why it may or may not ship."""
    network: dict[str, Any]
    """Sizes of observation, layers and action."""
    parity: dict[str, Any]
    """Largest differences of the exported files from the network, and what ran them."""
    task: dict[str, Any]
    """Joints, gains, pose, rates: the metadata of the ONNX file."""
    files: dict[str, str]
    """Every other file of the export -> digest of its content."""
    figures: dict[str, Any] = field(default_factory=dict)
    """Measured figures by the name of the measurement; may be empty."""

    def to_text(self) -> str:
        content = {"schema": SCHEMA, **vars(self)}
        sealed = {**content, SEAL: digests.of_json(content)}
        return json_text(sealed)


def write_card(folder: Path, card: ModelCard) -> None:
    """Write `CARD.md`, then `card.json`, so that a folder with the latter is complete."""
    atomic.write_text(folder / PAGE, page(card))
    atomic.write_text(folder / FILE, card.to_text())


def read_card(folder: Path) -> ModelCard:
    """The card of an export. Raises FileError if it is missing, changed or incomplete, or names files elsewhere."""
    path = folder / FILE
    if not path.is_file():
        of_run = folder / OF_RUN
        do = f"Name {of_run}." if (of_run / FILE).is_file() else "Export one: python -m pipeline.export --help"
        raise FileError(path, "there is no exported policy here.", do)
    value = read_json(path, do=AGAIN, most_bytes=MAX_BYTES)
    if not isinstance(value, dict) or value.get("schema") not in (SCHEMA, UNSEALED):
        raise FileError(path, f"is not a card of schema {SCHEMA!r}.", AGAIN)
    _check_seal(path, value)
    del value["schema"]
    card = settings.parse(ModelCard, value, path, AGAIN)
    outside = [name for name in card.files if Path(name).is_absolute() or ".." in Path(name).parts]
    if outside:
        raise FileError(path, f"names files outside its folder: {', '.join(outside)}.", AGAIN)
    return card


def check_stated(path: Path) -> None:
    """Check a file against the card beside it, if there is one. Raises FileError if the digest differs."""
    if not (path.parent / FILE).is_file():
        return
    stated = read_card(path.parent).files.get(path.name)
    if stated is None or not path.is_file() or digests.of_file(path) != stated:
        raise FileError(path, f"does not match its digest in {FILE} beside it.", "Export the policy again.")


def _check_seal(path: Path, value: dict[str, Any]) -> None:
    """Remove the card's digest of itself from `value` and check it. Raises FileError."""
    seal = value.pop(SEAL, None)
    if value["schema"] == UNSEALED and seal is None:
        return
    try:
        holds = digests.of_json(value) == seal
    except ValueError:  # a number that is not finite
        holds = False
    if not holds:
        raise FileError(path, "was changed: its content does not match its own digest.", AGAIN)


def page(card: ModelCard) -> str:
    """The card as Markdown, with all text escaped."""
    lines = [f"| {plain(name)} | {plain(value)} |" for name, value in card_rows(card).items()]
    return "\n".join([f"# {plain(card.name)}", "", "| | |", "|---|---|", *lines, ""])


def card_rows(card: ModelCard) -> dict[str, str]:
    """The main facts of a card by name, for people."""
    run, data = ({name: str(value) for name, value in facts.items()} for facts in (card.run, card.data))
    licence, missing = card.data.get("licence", {}), "not stated"
    changed = ", ".join(f"{name}={value}" for name, value in card.run.get("changed", {}).items())
    preset = run.get("preset", missing) + (f" with {changed}" if changed else "")
    return {
        **_figure_rows(card),
        "robot": card.robot,
        "run": run.get("name", missing),
        "commit": run.get("commit", missing),
        "command": run.get("command", missing),
        "preset, seed": f"{preset}, {run.get('seed', missing)}",
        "environments, device": f"{run.get('num_envs', missing)}, {run.get('device', missing)}",
        "trained": f"{run.get('iterations', '?')} iterations, {run.get('seconds', '?')} s{_continued(card.run)}",
        "GPU minutes without the tracker's": _minutes(card.run),
        "training bundle": run.get("bundle_digest", missing),
        "motor limits": data.get("motors", missing),
        "expert database": data.get("digest", missing),
        "clips, seconds": f"{data.get('clips', '?')}, {data.get('seconds', '?')}",
        "licence": f"{licence.get('strictest', 'unknown')}: {licence.get('allowed_use', 'not stated')}",
        "may ship": f"{'yes' if card.shippable else 'no'}. {card.why}",
        "network": " - ".join(str(size) for size in card.network.get("sizes", ())),
        "parity": f"ONNX {card.parity['onnx']:.1e} ({card.parity['runtime']}), "
        f"TorchScript {card.parity['torch_script']:.1e}, over {card.parity['observations']} observations",
        "digest": card.digest,
    }


def _minutes(facts: dict[str, Any]) -> str:
    seconds = facts.get("gpu_seconds")
    return f"{seconds / 60.0:.1f}" if isinstance(seconds, (int, float)) else "not stated"


def _continued(facts: dict[str, Any]) -> str:
    """Iterations at which stages were continued after an interruption, which changes the random sequence of a run."""
    stages = {name: _object(done).get("resumed_at") for name, done in _object(facts.get("stages")).items()}
    continued = [f"{name} at {', '.join(map(str, at))}" for name, at in stages.items() if isinstance(at, list) and at]
    return f"; continued: {'; '.join(continued)}" if continued else ""


def _figure_rows(card: ModelCard) -> dict[str, str]:
    """Measured figures, those of other seeds of the recipe, and held-out trials. Figures may be any JSON value."""
    own, others, unseen = (_object(card.figures.get(key)) for key in ("figures", OTHER_SEEDS, HELD_OUT))
    seeds = {seed: _object(facts) for seed, facts in others.items()}
    measured = {seed: _object(facts.get("figures")) for seed, facts in seeds.items()}
    rows = {f"GPU minutes, seed {seed}": _minutes(facts) for seed, facts in seeds.items()}
    for name in dict.fromkeys(name for figures in (own, *measured.values()) for name in figures):
        beside = ", ".join(f"seed {seed}: {_shown(figures.get(name))}" for seed, figures in measured.items())
        rows[name] = _shown(own.get(name)) + (f" ({beside})" if beside else "")
    if unseen:
        rows["held-out trials"] = f"{unseen.get('passed')} of {unseen.get('required')} required cells"
    return rows


def _object(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _shown(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, (int, float)) else "-" if value is None else str(value)
