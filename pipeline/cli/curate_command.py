"""`booster-lab curate`: the curator's page, served to this machine's browser."""

from __future__ import annotations

import argparse
import contextlib
import webbrowser

from pipeline.cli.project import find_project


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "curate",
        help="find, watch, accept and exclude clips in the browser",
        description="A gallery of all clips that the graph has made, with figures, thresholds and playback. Decisions "
        "are written into data/curation.yaml. The page is served to this machine alone; the address that is printed "
        "holds a token without which nothing can be changed.",
    )
    parser.add_argument("--robot", default="t1", help="a folder of robots/ (default: t1)")
    parser.add_argument("--port", type=int, default=8090, help="port of the page (default: 8090, or the next free)")
    parser.add_argument("--no-browser", action="store_true", help="serve the page but don't open it")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Serve until interrupted."""
    from pipeline.curation_page.serve import CurationServer

    project = find_project()
    project.robot_folder(parsed.robot)
    server = CurationServer(project.root, parsed.robot, parsed.port)
    print(f"{server.url}\nshows the clips of {project.root}; stop with Ctrl-C", flush=True)
    if not parsed.no_browser:
        webbrowser.open(server.url)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        server.run()
    return 0
