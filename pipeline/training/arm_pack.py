"""What must come back from a training host, in few files of bounded size.

choice.json     per arm: what was chosen of what, its figures when chosen and when measured, and what was left out here
arms.zip        per arm: the chosen network as npz, curves.csv, config.json, done.json, log, all sweeps
<arm>.pt        per arm: the checkpoint that training goes on from
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

from pipeline.training.arms import ArmProcess, write_json

LARGEST = 16 * 2**20
"""Bytes of a file."""
FILES, ALL = 8, 64 * 2**20
"""How many files come back, and how many bytes of them together."""
TEXTS = ("curves.csv", "config.json", "done.json", "command.json", "log.txt")
EPOCH = (1980, 1, 1, 0, 0, 0)


def pack(folder: Path, arms: list[ArmProcess], choice: dict[str, Any]) -> list[str]:
    """Write the files; what does not fit within the bounds, which `choice.json` states too."""
    folder.mkdir(parents=True, exist_ok=True)
    write_zip(folder / "arms.zip", _contents(arms, choice))
    left_out = [f"arms.zip ({_size(folder / 'arms.zip')} bytes)"] if _size(folder / "arms.zip") > LARGEST else []
    used, count = _size(folder / "arms.zip"), 2
    for arm in arms:
        states = arm.checkpoints()
        if not states:
            continue
        size = _size(states[-1])
        if size > LARGEST or used + size > ALL or count + 1 > FILES:
            left_out.append(f"{states[-1].name} of {arm.arm.name} ({size} bytes)")
            continue
        part = folder / f"{arm.arm.name}.part"
        part.write_bytes(states[-1].read_bytes())
        part.replace(folder / f"{arm.arm.name}.pt")
        used, count = used + size, count + 1
    write_json(folder / "choice.json", {**choice, "left_out": left_out})
    return left_out


def _contents(arms: list[ArmProcess], choice: dict[str, Any]) -> dict[str, bytes]:
    found: dict[str, bytes] = {"choice.json": json.dumps(choice, indent=1, sort_keys=True).encode()}
    for arm in arms:
        chosen = choice["arms"].get(arm.arm.name, {}).get("chosen")
        files = [arm.folder / name for name in TEXTS] + sorted((arm.folder / "sweeps").glob("*.json"))
        files += [arm.folder / "policies" / f"{chosen}.npz"] if chosen else []
        found |= {
            f"{arm.arm.name}/{path.relative_to(arm.folder)}": path.read_bytes() for path in files if path.is_file()
        }
    return found


def write_zip(path: Path, contents: dict[str, bytes]) -> None:
    """Equal contents give equal bytes."""
    part = path.with_suffix(".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), content, zipfile.ZIP_DEFLATED)
    part.replace(path)


def _size(path: Path) -> int:
    return path.stat().st_size
