"""Process that makes the missing thumbnails of all clips.

It runs at low priority, so that the page stays responsive. Ctrl-C in the terminal does not reach it; it ends when its
stdin is closed, however the server ended.

    stdin   kept open by the server while thumbnails are needed
    stdout  a line `<made> <total>` after each group of thumbnails
"""

import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

END_S = 20.0
"""Maximum time until the process ends [s]."""
NICENESS = 15
"""Priority of the processes that make thumbnails; 19 is the lowest."""


class ThumbnailProcess:
    """The process, seen from the server."""

    def __init__(self, root: Path, robot: str) -> None:
        self.made, self.total = 0, 0
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
        """Make the process and its workers end."""
        if self._process.stdin is not None:
            self._process.stdin.close()

    def _follow(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            made, total = line.split()
            self.made, self.total = int(made), int(total)
        self._process.wait()


def main() -> int:
    """Make the missing thumbnails. Command line arguments: folder of the project, name of the robot."""
    os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    warnings.filterwarnings("ignore", message=".*still being processed by the workers")  # on an early end
    stop = threading.Event()
    threading.Thread(target=_end_with_server, args=(stop,), daemon=True).start()
    from pipeline.curation_page.workplace import Workplace  # slow import, at low priority
    from pipeline.errors import PipelineError

    try:
        sources, thumbnails = Workplace(Path(sys.argv[1]), sys.argv[2]).thumbnail_sources()
        for made in thumbnails.make_missing(sources, stop):
            print(made, len(sources), flush=True)
    except (PipelineError, OSError) as error:  # the server makes the shown ones on demand and reports errors
        print(f"booster-lab curate: thumbnails are made only when they are shown: {error}", file=sys.stderr, flush=True)
        return 1
    return 0


def _end_with_server(stop: threading.Event) -> None:
    """Wait until stdin is closed, then end after the current thumbnails, or after `END_S` by force."""
    sys.stdin.read()
    stop.set()
    time.sleep(END_S)
    os._exit(0)  # its workers detect it and end too (`ClipPool`)


if __name__ == "__main__":
    sys.exit(main())
