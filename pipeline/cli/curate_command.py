"""`booster-lab curate`: the curator's page, served to this machine's browser."""

import contextlib
import webbrowser

from pipeline.cli.arguments import Curate
from pipeline.cli.project import find_project
from pipeline.curation_page.app import CurationServer


def run(args: Curate) -> int:
    """Serve until interrupted."""
    project = find_project()
    project.robot_folder(args.robot)
    server = CurationServer(project.root, args.robot, args.port)
    print(f"{server.url}\nshows the clips of {project.root}; stop with Ctrl-C", flush=True)
    if not args.no_browser:
        webbrowser.open(server.url)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        server.run()
    return 0
