"""A checkout of the project in a folder of its own, and the README's commands run in it."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import dagster as dg

from pipeline.batch import Store

ASSETS = (
    "motion_catalog",
    "selected_motions",
    "repaired_motions",
    "robot_model",
    "actuator_calibration",
    "adapted_robot",
    "retargeted_motions",
    "motion_variants",
    "reference_motions",
    "tracking_policy",
    "augmented_motions",
    "feasible_motions",
    "expert_db",
)

PATIENCE_S = 1800.0
"""Of a command on a busy machine."""
DATABASE_CHECKS = ("whole_database", "every_skill_has_seconds", "command_coverage")


@dataclass(frozen=True)
class Checkout:
    """The project's files (committed or about to be) in `root`, with a few of the shipped motions."""

    root: Path

    @staticmethod
    def make(project: Path, root: Path, motions: tuple[str, ...]) -> "Checkout":
        """Copy the project without what git ignores; of the shipped motions only the named ones."""
        listed = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"], cwd=project, capture_output=True, text=True, check=True
        )
        for name in listed.stdout.splitlines():
            source = project / name
            if source.is_file() and (not name.startswith("data/motions/") or source.stem in motions):
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, root / name)
        return Checkout(root)

    def with_answers_of(self, project: Path) -> "Checkout":
        """This checkout with the blobs and answers in the store of `project`, where it has one.

        Answers are found by the digests of code, settings and clip, so equal code finds them and other code works
        afresh.
        """
        for folder in ("blobs", "shards", "memo"):
            source = project / "data/store" / folder
            if source.is_dir():
                shutil.copytree(source, self.root / "data/store" / folder, copy_function=_link_or_copy)
        return self

    def with_less_to_do(self, frames: dict[str, int]) -> "Checkout":
        """This checkout with the first frames of its motions, and without time scales and most disturbed rollouts.

        Every stage works as it does on whole motions, on a fraction of the frames.

        Args:
            frames: by motion, how many frames are kept
        """
        for motion, count in frames.items():
            path = self.root / f"data/motions/{motion}.bvh"
            path.write_text(first_frames(path.read_text(), count))
        self.replace("data/augment.yaml", "time_scales: [0.9, 1.1]", "time_scales: []")
        self.replace("data/tracking.yaml", "disturbed: 4 ", "disturbed: 1 ")
        self.replace("data/tracking.yaml", "disturbed_s: 12.0", "disturbed_s: 0.0")
        return self

    def replace(self, name: str, old: str, new: str) -> str:
        """Replace what a file has once; its text before."""
        path = self.root / name
        text = path.read_text()
        assert text.count(old) == 1, (name, old)
        path.write_text(text.replace(old, new))
        return text

    def run(self, *command: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """A command typed in the root with the project's environment active."""
        return subprocess.run(
            command,
            cwd=self.root,
            env={**self.environment(), **environment},
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )

    def environment(self) -> dict[str, str]:
        """Variables of a shell with the project's environment active and this checkout's code.

        Tests run side by side, one a core, so a command works on clips in its own process.
        """
        others = ("DAGSTER", "BOOSTER_LAB", "PYTHONDONTWRITEBYTECODE")
        clean = {name: value for name, value in os.environ.items() if not name.startswith(others)}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        return {**clean, "PATH": path, "PYTHONPATH": str(self.root), "LOKY_MAX_CPU_COUNT": "1"}

    def start(self, *command: str) -> subprocess.Popen[str]:
        """A command in a process group of its own, for killing; what it prints can be read line by line."""
        return subprocess.Popen(
            command,
            cwd=self.root,
            env=self.environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def materialize(self, **environment: str) -> str:
        """The literal command of the README; what it printed. It must succeed."""
        command = ("dagster", "asset", "materialize", "--select", "expert_db")
        done = self.run(*command, **environment)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout + done.stderr

    def history(self) -> dict[str, list[dict]]:
        """Metadata of each asset's materializations as `dagster dev` would see them, the newest first."""
        with self.instance() as instance:
            return {name: _materializations(instance, name) for name in ASSETS}

    def started_runs(self) -> list[str]:
        """Runs that the history believes to be at work."""
        with self.instance() as instance:
            runs = instance.get_runs(filters=dg.RunsFilter(statuses=[dg.DagsterRunStatus.STARTED]))
        return [run.run_id for run in runs]

    @contextmanager
    def instance(self) -> Iterator[dg.DagsterInstance]:
        """The checkout's history; its paths are relative, so the working directory is the checkout meanwhile."""
        before = Path.cwd()
        os.chdir(self.root)
        try:
            with dg.DagsterInstance.from_config(str(self.root)) as instance:
                yield instance
        finally:
            os.chdir(before)

    def counts(self) -> dict[str, int]:
        """How often each asset was materialized so far."""
        return {name: len(each) for name, each in self.history().items()}

    def recomputed(self) -> dict[str, int]:
        """Clips that the newest materialization of each clip stage worked on."""
        history = self.history()
        return {name: each[0]["clips recomputed"] for name, each in history.items() if "clips recomputed" in each[0]}

    def clips_from(self, motion: str) -> dict[str, int]:
        """How many clips of a motion file each clip stage was given."""
        store = Store(root=self.root / "data/store")
        stages = [name for name in ASSETS if name.endswith(("_motions", "_catalog", "_variants"))]
        own = re.compile(rf"booster_lab/{re.escape(motion)}(@|$)")
        return {name: sum(bool(own.match(row.clip)) for row in store.load(name).judged) for name in stages}

    def database(self) -> dict[str, str]:
        """Files of the T1 database and their digests."""
        return json.loads((self.root / "data/expert_db/t1/manifest.json").read_text())["files"]

    def newest_checks(self) -> dict[str, str]:
        """Status of the newest record of each check on the database, as its page shows them."""
        with self.instance() as instance:
            keys = [dg.AssetCheckKey(dg.AssetKey(["expert_db"]), name) for name in DATABASE_CHECKS]
            storage = instance.event_log_storage
            records = {key.name: storage.get_asset_check_execution_history(key, limit=1) for key in keys}
        return {name: found[0].status.value for name, found in records.items() if found}

    def clips(self) -> set[str]:
        """Names of the motion files that the database's clips come from."""
        import pandas as pd

        return set(pd.read_parquet(self.root / "data/expert_db/t1/index.parquet")["source_file"])


def _link_or_copy(source: str, target: str) -> None:
    """Files of a store are replaced, never written into, so a link is as good as a copy, where there can be one."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def first_frames(text: str, count: int) -> str:
    """The first frames of a BVH file."""
    head, _, motions = text.partition("Frames:")
    _, rate, *rows = motions.splitlines()
    return "\n".join([f"{head}Frames: {count}", rate, *rows[:count], ""])


def _materializations(instance: dg.DagsterInstance, name: str) -> list[dict]:
    records = instance.fetch_materializations(dg.AssetKey([name]), limit=100).records
    events = [record.asset_materialization for record in records]
    return [{key: value.value for key, value in event.metadata.items()} for event in events if event is not None]
