"""A tracker's folder: network, training curves, and a card with training data and tracking quality.

<folder>/tracker.npz   the network with robot, joints, links and gains
<folder>/curves.csv    one row per training iteration
<folder>/card.json     clips and licences, robot, command, commit, figures of the nominal rollouts, digests of the files

`python -m pipeline.tracking.export_tracker` writes one from a training run.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import FileError
from pipeline.files import digest, settings
from pipeline.files.csv_json import read_json
from pipeline.files.swap import replace_folder
from pipeline.tracking.bundle import CONFIG, TrackingBundle

SCHEMA = "booster-lab tracker 1"
NETWORK, CURVES, CARD = "tracker.npz", "curves.csv", "card.json"


@dataclass(frozen=True, kw_only=True)
class TrackerCard:
    """Metadata of a tracker (`card.json`)."""

    robot: str
    clips: tuple[str, ...]
    """Reference clips that it was trained on."""
    licences: tuple[str, ...]
    """Licences of these clips."""
    training: dict[str, Any]
    """Command, commit, seed, device, iterations, seconds, digest of the bundle."""
    figures: dict[str, float]
    """Figures of the nominal rollouts of these clips on a CPU."""
    files: dict[str, str]
    """File name -> digest."""


def read_card(folder: Path) -> TrackerCard:
    """Read a tracker's card. Raises FileError if it or a file is missing, changed or of another schema."""
    path = folder / CARD
    if not path.is_file():
        raise FileError(path, "it is missing: the folder has no tracker.", "Train one, or name another folder.")
    value = read_json(path, "a card of a tracker", "Write the folder again.")
    if not isinstance(value, dict) or value.pop("schema", None) != SCHEMA:
        raise FileError(path, f"is no card of a tracker of schema {SCHEMA!r}.", "Write the folder again.")
    card = settings.parse(TrackerCard, value, path, "Write the folder again.")
    for name, expected in card.files.items():
        if not (folder / name).is_file() or digest.of_file(folder / name) != expected:
            raise FileError(folder / name, "is missing or not the file of its card.", "Write the folder again.")
    return card


def write_tracker_folder(
    folder: Path, run: Path, iterations: int, bundle: TrackingBundle, figures: dict[str, float], made: dict[str, str]
) -> TrackerCard:
    """Replace `folder` atomically by network and curves of a training run and their card.

    Args:
        run: folder of the run; its `tracker.npz` is the network after `iterations`
        bundle: the bundle that it was trained on
        figures: figures of the nominal rollouts of its clips
        made: `command` and `commit`

    Raises FileError if the run lacks a file, or if `folder` has files that are not a tracker's.
    """
    strange = sorted({path.name for path in folder.glob("*")} - {NETWORK, CURVES, CARD})
    if strange:
        raise FileError(folder, f"it holds other files than a tracker's ({strange[0]}).", "Name an empty folder.")
    for name in (NETWORK, CURVES, CONFIG):
        if not (run / name).is_file():
            raise FileError(run / name, "it is missing: the run has not ended.", "Repeat its command with --resume.")
    config = json.loads((run / CONFIG).read_text())
    head, *rows = (run / CURVES).read_text().splitlines()
    rows = rows[:iterations]
    last = dict(zip(head.split(","), rows[-1].split(","), strict=True))
    training = {
        **made,
        **{name: config[name] for name in ("seed", "num_envs", "processes", "device", "versions")},
        "bundle": config["bundle_digest"],
        "robot_digest": bundle.about["robot_digest"],
        "seconds_of_motion": bundle.about["seconds"],
        "iterations": iterations,
        "minutes": round(float(last["seconds"]) / 60.0, 1),
    }
    contents = {
        NETWORK: (run / NETWORK).read_bytes(),
        CURVES: "".join(f"{row}\n" for row in (head, *rows)).encode(),
    }
    files = {name: digest.of_bytes(content) for name, content in contents.items()}
    card = TrackerCard(
        robot=bundle.about["robot"],
        clips=bundle.motions.names,
        licences=tuple(bundle.about["licences"]),
        training=training,
        figures=figures,
        files=files,
    )
    contents[CARD] = (json.dumps({"schema": SCHEMA, **vars(card)}, indent=1, sort_keys=True) + "\n").encode()

    def fill(part: Path) -> None:
        for name, content in contents.items():
            (part / name).write_bytes(content)

    replace_folder(folder, fill)
    return card
