"""`booster-lab inspect IN`: format and defects of a motion file, or KP5's criteria of a clip."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.cli.arguments import Inspect
from pipeline.cli.chain import Chain
from pipeline.cli.stored_clips import as_text as judgement_text
from pipeline.cli.stored_clips import clip_of, excluded, judged, rejected
from pipeline.cli.text_table import name_values, text_table
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Outcome, Piece
from pipeline.errors import FileError, PipelineError
from pipeline.files.csv_json import without_nan
from pipeline.project import Project, find_project
from pipeline.quality.planar_motion import leg_length
from pipeline.readers import Source, Statement, list_files, refuse_outside_link, written_map
from pipeline.readers.read_motion import SUFFIXES

WINDOW_NUMBERS = ("skill", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s")


def inspect_file(chain: Chain, path: Path, stated: Statement) -> dict[str, Any]:
    """Read, catalogue, segment and repair one file. Returns the JSON object of `--json`.

    Unknown numbers are None: `speed_*` [m/s] if too little was recorded, `leg_length` (thigh plus shank [m]) for a
    robot motion. `fps` is the true rate [Hz]; `usable_*` are the values after repair; `reasons` have `stage,
    code, text, effect` (`rejected`, `repaired`, `noted`) and, where known, `start_s, stop_s, value, limit, unit`.
    Raises FileError.
    """
    read = chain.read(path, stated)
    catalogued = chain.catalogued(read)
    reasons = [{"stage": "catalogue", **reason.to_dict()} for reason in catalogued.reasons]
    windows: list[dict[str, Any]] = []
    repaired = Outcome()
    clip = catalogued.pieces[0].clip if catalogued.pieces else read.motion.clip
    for piece in catalogued.pieces[:1]:
        windows = _windows_inspection(chain.windows(piece), piece)
        repaired = chain.repaired(piece)
        reasons += [{"stage": "repair", **reason.to_dict()} for reason in repaired.reasons]
    speed = chain.speeds(clip)
    found = {
        "file": str(path),
        "kind": "human" if isinstance(clip, HumanClip) else "robot",
        **{name: getattr(read.motion, name) for name in ("format", "skeleton", "unit", "up_axis")},
        "licence": read.source.licence_of(read.path),
        "declared_fps": read.motion.declared_fps,
        "fps": clip.fps,
        "frames": clip.frame_count,
        "seconds": clip.duration_s,
        "leg_length": leg_length(clip) if isinstance(clip, HumanClip) else None,
        "speed_mean": float(speed.mean()) if len(speed) else None,
        "speed_max": float(speed.max()) if len(speed) else None,
        "usable_seconds": sum((each.clip.duration_s for each in repaired.pieces), 0.0),
        "usable_pieces": len(repaired.pieces),
        "windows": windows,
        "reasons": reasons,
    }
    return without_nan(found)


def _windows_inspection(selected: Outcome, whole: Piece) -> list[dict[str, Any]]:
    fps = whole.clip.fps
    rows = []
    for piece in selected.pieces:
        times = {
            "start_s": int(piece.numbers["start_frame"] or 0) / fps,
            "stop_s": int(piece.numbers["stop_frame"] or 0) / fps,
        }
        rows.append({**times, **{name: piece.numbers[name] for name in WINDOW_NUMBERS}})
    return rows


def run(args: Inspect) -> int:
    """Inspect a file, folder or clip. An unreadable file is an error; in a folder, it is a line of the table."""
    chain = Chain(find_project())
    stated = Statement(**vars(args.statement))
    if args.write_map:
        if not args.input.is_file():
            problem = "it is a folder." if args.input.is_dir() else "the file does not exist."
            raise FileError(args.input, problem, "Name one motion file for --write-map.")
        print(written_map(args.input, stated.skeleton), end="")
        return 0
    if _is_clip(args.input):
        stored_clip(
            chain.project, clip_of(args.input) if args.input.is_file() else str(args.input), args.robot, args.json
        )
        return 0
    if args.input.is_dir():
        folder(args.input, chain, stated, args.json)
        return 0
    found = inspect_file(chain, args.input, stated)
    print(_json(found) if args.json else as_text(found))
    return 0


def _is_clip(path: Path) -> bool:
    """Whether an argument names a clip: a file of the database, or neither an existing file nor like a file name."""
    if path.exists():
        return path.is_file() and path.suffix.lower() == ".json"
    return path.suffix.lower() not in SUFFIXES


def stored_clip(project: Project, name: str, robot: str, as_json: bool) -> None:
    """Print every criterion of a clip; for a clip rejected before KP5, the stage and its reasons."""
    rows = judged(project, name, robot)
    if rows:
        decisions = excluded(project, rows, robot)
        kept = [row | {"piece": ""} if row["piece"] in decisions else row for row in rows]
        print(_json(kept) if as_json else judgement_text(rows, decisions))
        return
    ended = rejected(project, name, robot)
    if as_json:
        print(_json([{key: vars(each)[key] for key in ("clip", "stage", "verdict", "reasons")} for each in ended]))
        return
    parts = [f"{each.clip}: {each.verdict} by {each.stage}\n{_reasons(each.reasons)}" for each in ended]
    print("\n\n".join(parts))


def folder(path: Path, chain: Chain, stated: Statement, as_json: bool) -> None:
    """Print one line per motion file below a folder. Raises FileError if there are none."""
    listing = list_files(Source(name=path.name, folder=path))
    if not listing.motions:
        raise FileError(path, "it has no motion files.", listing.unread_text())
    rows, values = [], []
    for file in listing.motions:
        within = file.relative_to(path).as_posix()
        try:
            refuse_outside_link(file, path)
            found = inspect_file(chain, file, stated)
        except PipelineError as error:
            values.append({"file": str(file), "error": str(error)})
            why = str(error).removeprefix(str(file)).lstrip(":, ")
            rows.append([within, None, None, None, None, None, 0.0, why])
            continue
        values.append(found)
        what = ", ".join(dict.fromkeys(reason["code"] for reason in found["reasons"])) or "nothing"
        shown = ("format", "skeleton", "fps", "seconds", "speed_mean", "usable_seconds")
        rows.append([within, *(found[name] for name in shown), what])
    header = ["file", "format", "skeleton", "rate [Hz]", "in [s]", "speed [m/s]", "usable [s]", "found"]
    if as_json and listing.unread:
        values.append({"folder": str(path), "not_read": dict(listing.unread), "note": listing.unread_text()})
    print(_json(values) if as_json else text_table(header, rows))
    if listing.unread and not as_json:
        print(f"\n{listing.unread_text()}")


def as_text(found: dict[str, Any]) -> str:
    """The inspection of a file as text."""
    pieces = "1 piece" if found["usable_pieces"] == 1 else f"{found['usable_pieces']} pieces"
    declared, leg, mean = found["declared_fps"], found["leg_length"], found["speed_mean"]
    facts = {
        **{
            name.replace("_", " "): found[name] for name in ("file", "format", "skeleton", "unit", "up_axis", "licence")
        },
        "declared rate": "not declared" if declared is None else f"{declared:.6g} Hz",
        "true rate": f"{found['fps']:.6g} Hz",
        "length": f"{found['seconds']:.2f} s, {found['frames']} frames",
        "leg length": None if leg is None else f"{leg:.3f} m (thigh and shank)",
        "speed": "unknown, too little was recorded"
        if mean is None
        else f"mean {mean:.2f} m/s, highest {found['speed_max']:.2f} m/s",
        "usable": f"{found['usable_seconds']:.2f} s in {pieces}",
    }
    header = ["from [s]", "to [s]", "skill", "forward [m/s]", "left [m/s]", "turning left [rad/s]"]
    rows = [[window[name] for name in ("start_s", "stop_s", *WINDOW_NUMBERS)] for window in found["windows"]]
    windows = text_table(header, rows, indent="  ") if rows else "  none"
    findings = f"found\n{_reasons(found['reasons'])}" if found["reasons"] else "found: no defects"
    return "\n\n".join([name_values(facts), f"windows of one skill\n{windows}", findings])


def _reasons(reasons: Sequence[Mapping[str, Any]]) -> str:
    header = ["effect", "from [s]", "to [s]", "reason", "what"]
    rows = [[each.get(name) for name in ("effect", "start_s", "stop_s", "code", "text")] for each in reasons]
    return text_table(header, rows, indent="  ")


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)
