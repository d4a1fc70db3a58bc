"""The runs that the page starts: of whatever is stale, or of some clips again."""

from __future__ import annotations

import threading
from typing import Any

from pipeline.curation_page.materialization import Materialization, Rerun
from pipeline.curation_page.workplace import Workplace
from pipeline.errors import PipelineError


class Runs:
    """One run at a time; `state` may be asked at any time."""

    def __init__(self, workplace: Workplace) -> None:
        self._workplace = workplace
        self._run = Materialization(workplace.root)
        self._lock = threading.Lock()
        self._rerun: Rerun | None = None
        self._outcome: dict[str, Any] | None = None

    def start(self) -> int:
        """Materialize the database and what is stale. Raises PipelineError when a run is at work."""
        with self._lock:
            self._run.start(self._workplace.database_asset)
            self._rerun, self._outcome = None, None
        return 1

    def start_again(self, clips: list[str]) -> int:
        """Work on some clips again, from their recordings to the database; their number. Raises PipelineError."""
        rerun = self._workplace.rerun_of(clips)
        with self._lock:
            self._run.start(*rerun.assets, again=rerun.names)
            self._rerun, self._outcome = rerun, None
        return len(rerun.before)

    def stop(self) -> None:
        """End the run, if one is at work."""
        self._run.stop()

    def state(self) -> dict[str, Any]:
        """The state of the run; `rerun`: the outcome of a rerun that has ended, or the number of clips it is of."""
        with self._lock:
            state = self._run.state()
            if self._rerun is None:
                return {**state, "rerun": None}
            if self._outcome is None and not state["at_work"]:
                try:
                    self._outcome = self._workplace.outcome(self._rerun)
                except PipelineError as error:
                    self._outcome = {"clips": len(self._rerun.before), "error": str(error)}
            return {**state, "rerun": self._outcome or {"clips": len(self._rerun.before)}}
