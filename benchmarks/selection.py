"""Agreement of skill windows with manually checked windows of real recordings, per skill.

    python benchmarks/selection.py [--json] [--each] [FOLDER]

FOLDER holds motion files and `segments.csv` (`file, skill, first_frame, last_frame`, both inclusive, frames of the
file). A frame agrees if its window has its label. Files are read and catalogued first, so a corrected frame
rate applies; `TRUE_SKILL` lists windows that were labelled at a wrong rate.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.catalog import CatalogSettings, correct  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.readers import Statement, read_motion  # noqa: E402
from pipeline.selection import SKILLS, Curation, find_windows  # noqa: E402

TRUE_SKILL = {"cmu_bvh/02_03.bvh": "run"}
"""True skills of windows that were labelled at a wrong rate."""
STATED = {".amc": Statement(fps=120.0)}
"""Frame rate of AMC files, which do not state it: CMU records at 120 Hz."""
LEAST_OVERALL, LEAST_EACH = 90.0, 75.0
"""Least agreement of the labelled time, in total and per skill [%]."""


@dataclass
class Agreement:
    """Labelled time of each skill, by the selected skill."""

    labelled_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    found_s: dict[tuple[str, str], float] = field(default_factory=lambda: defaultdict(float))
    """(labelled skill, selected skill) -> time [s]."""

    def percent(self, skill: str) -> float:
        total = self.labelled_s.get(skill, 0.0)
        return 100.0 * self.found_s.get((skill, skill), 0.0) / total if total else float("nan")

    @property
    def overall_percent(self) -> float:
        agreed = sum(self.found_s.get((skill, skill), 0.0) for skill in self.labelled_s)
        return 100.0 * agreed / sum(self.labelled_s.values())


def agreement(folder: Path, catalog: CatalogSettings, curation: Curation) -> Agreement:
    """Compare the windows of every file named in the folder's `segments.csv`."""
    result = Agreement()
    for name, rows in pd.read_csv(folder / "segments.csv").groupby("file", sort=True):
        labels, fps = frame_labels(folder / str(name), catalog, curation)
        for row in rows.itertuples():
            skill = TRUE_SKILL.get(str(name), str(row.skill))
            part = labels[int(row.first_frame) : int(row.last_frame) + 1]
            result.labelled_s[skill] += len(part) / fps
            for found in np.unique(part):
                result.found_s[skill, str(found)] += float((part == found).sum()) / fps
    return result


def frame_labels(path: Path, catalog: CatalogSettings, curation: Curation) -> tuple[np.ndarray, float]:
    """Skill of each frame as the file stores them (t,), and the file's true rate of stored frames [Hz]."""
    read = read_motion(path, path.stem, STATED.get(path.suffix, Statement()))
    corrected = correct(read, settings=catalog)
    clip = corrected.clip
    labels = np.empty(clip.frame_count, dtype=object)
    for window in find_windows(clip, settings=curation.windows):
        labels[window.start : window.stop] = window.skill
    frames = (np.arange(read.clip.frame_count) - corrected.first_frame) // corrected.times_stored
    return labels[np.clip(frames, 0, clip.frame_count - 1)].astype(str), clip.fps * corrected.times_stored


def main() -> int:
    """Print the table; 0 when all bars hold."""
    parser = argparse.ArgumentParser(description="Agreement of the skill windows with hand-checked ones.")
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=ROOT.parent / "shared" / "mocap",
        help="recordings and segments.csv (file, skill, first_frame, last_frame)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--each", action="store_true", help="print what disagreeing seconds were found to be")
    arguments = parser.parse_args()
    if not (arguments.folder / "segments.csv").is_file():
        parser.error(f"{arguments.folder} has no segments.csv; name a folder of recordings with hand-checked windows")
    catalog = settings_file.read(ROOT / "data" / "catalog.yaml", CatalogSettings)
    curation = settings_file.read(ROOT / "data" / "curation.yaml", Curation)
    found = agreement(arguments.folder, catalog, curation)
    bars = [Bar(name="all labelled seconds", value=found.overall_percent, unit="%", sense=">=", bound=LEAST_OVERALL)]
    bars += [Bar(name=each, value=found.percent(each), unit="%", sense=">=", bound=LEAST_EACH) for each in SKILLS]
    if not arguments.json:
        print(", ".join(f"{skill} {found.labelled_s.get(skill, 0.0):.1f} s" for skill in SKILLS), "are labelled")
    if arguments.each:
        for (skill, other), seconds in sorted(found.found_s.items()):
            if skill != other:
                print(f"  {skill}: {seconds:.2f} s found to be {other}")
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


if __name__ == "__main__":
    sys.exit(main())
