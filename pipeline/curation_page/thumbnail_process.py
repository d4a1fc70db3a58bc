"""Make the missing thumbnails of all clips, in a process of its own.

Its priority is low, so that the page never waits for it, and the terminal's Ctrl-C does not reach it: it ends when the
server's end of its stdin is closed, however the server ended.

    stdin   kept open by the server as long as thumbnails are wanted
    stdout  a line `<made> <wanted>` whenever some were made
"""

import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

END_S = 20.0
"""Longest time that it takes to end [s]."""
NICENESS = 15
"""Priority of the processes that make thumbnails; 19 is the lowest."""


class ThumbnailProcess:
    """The process as the server has it."""

    def __init__(self, root: Path, robot: str) -> None:
        self.made, self.wanted = 0, 0
        code = Path(__file__).resolve().parents[2]
        path = os.pathsep.join(filter(None, (str(code), os.environ.get("PYTHONPATH", ""))))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pipeline.curation_page.thumbnail_process", str(root), robot],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        threading.Thread(target=self._follow, daemon=True).start()

    def stop(self) -> None:
        """Let it end, with the processes that it has started."""
        if self._process.stdin is not None:
            self._process.stdin.close()

    def _follow(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            made, wanted = line.split()
            self.made, self.wanted = int(made), int(wanted)
        self._process.wait()


def main() -> int:
    """Make them, as the arguments (folder of the project, name of the robot) say."""
    os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    warnings.filterwarnings("ignore", message=".*still being processed by the workers")  # when it ends early
    stop = threading.Event()
    threading.Thread(target=_end_with_server, args=(stop,), daemon=True).start()
    from pipeline.curation_page.workplace import Workplace  # heavy: only once the priority is low
    from pipeline.errors import PipelineError

    try:
        sources, thumbnails = Workplace(Path(sys.argv[1]), sys.argv[2]).wanted_thumbnails()
        for made in thumbnails.make_missing(sources, stop):
            print(made, len(sources), flush=True)
    except (PipelineError, OSError) as error:  # the gallery makes those it shows, and says why it can't
        print(f"booster-lab curate: thumbnails are made when they are shown: {error}", file=sys.stderr, flush=True)
        return 1
    return 0


def _end_with_server(stop: threading.Event) -> None:
    """Wait for the end of stdin, then let this process end after the thumbnails at hand, or else by force."""
    sys.stdin.read()
    stop.set()
    time.sleep(END_S)
    os._exit(0)  # its workers notice and end as well (`ClipPool`)


if __name__ == "__main__":
    sys.exit(main())
