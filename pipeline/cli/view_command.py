"""`booster-lab view CLIP`: human, reference and robot side by side, playing in a browser or as a picture."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from pipeline.cli.clips_to_view import clips_to_view
from pipeline.cli.project import find_project
from pipeline.cli.statement_arguments import add_statement, statement_of
from pipeline.files import atomic
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import Strip, contact_sheet, worst_clips_sheet
from pipeline.viewing.playlist import Playlist

MOST_STRIPS = 12
"""Clips in one picture."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "view",
        help="play a clip: the human and the robot side by side",
        description="Play a clip in the browser, the human and the robot side by side. CLIP is a motion file (it is "
        "repaired and retargeted first), a clip of the database (data/expert_db/t1/….json), or the name of a clip that "
        "the graph has made, such as booster_lab/walk or booster_lab/walk@0-300~mirror; with the name of a whole "
        "recording, all that was made from it can be chosen in the browser. A rollout (…~rollout) plays beside the "
        "reference that it tracks; a robot log (.mcap) beside the simulation of the same command, with its failures.",
    )
    parser.add_argument("clip", metavar="CLIP", help="motion file, robot log, clip of the database, or name of a clip")
    parser.add_argument("--robot", default="t1", help="a folder of robots/ (default: t1)")
    parser.add_argument("--port", type=port, default=8080, help="port of the page (default: 8080, or the next free)")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve on (default: this machine alone)")
    parser.add_argument("--no-browser", action="store_true", help="serve the page but don't open it")
    parser.add_argument("--picture", metavar="OUT.png", type=Path, help="write poses along the clip to a picture")
    parser.add_argument("--poses", type=poses, default=8, help="poses in the picture (default: 8)")
    parser.add_argument("--record", metavar="OUT", type=Path, help="write an .mp4 or .gif, without a display")
    parser.add_argument("--start", metavar="S", type=float, default=0.0, help="where the film begins [s]")
    parser.add_argument("--seconds", metavar="S", type=float, help="length of the film (default: to the end)")
    add_statement(parser)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Play until interrupted, or write the picture."""
    project = find_project()
    robot = project.robot(parsed.robot)
    clips = clips_to_view(project, parsed.clip, robot, statement_of(parsed))
    if parsed.picture is not None:
        atomic.write_bytes(parsed.picture, picture(clips, robot, parsed.poses))
        print(f"{parsed.picture}: {min(len(clips.names), MOST_STRIPS)} of {len(clips.names)} clips")
        return 0
    if parsed.record is not None:
        from pipeline.viewing.film import write_film

        shown = clips.load(clips.names[0])
        count = write_film(parsed.record, shown.figures(), start_s=parsed.start, seconds=parsed.seconds)
        print(f"{parsed.record}: {count} pictures of {clips.names[0]}")
        return 0
    from pipeline.viewing.viewer import Viewer  # starts threads and a web server: not for the picture

    viewer = Viewer(clips, port=parsed.port, host=parsed.host)
    try:
        print(f"{viewer.url} plays {clips.names[0]}; stop with Ctrl-C", flush=True)
        if not parsed.no_browser:
            webbrowser.open(viewer.url)
        viewer.run()
    except KeyboardInterrupt:
        return 0  # the way to end it
    finally:
        viewer.stop()


def picture(clips: Playlist, robot: Robot, count: int) -> bytes:
    """A contact sheet of the clip, or of the first clips where the name means several."""
    shown = [clips.load(name) for name in clips.names[:MOST_STRIPS]]
    if len(shown) == 1:
        (only,) = shown
        return contact_sheet(only.human, only.robot_clip, robot, count, only.reference)
    strips = [
        Strip(title=each.name, human=each.human, reference=each.reference, robot_clip=each.robot_clip) for each in shown
    ]
    return worst_clips_sheet(strips, robot, count)


def port(text: str) -> int:
    """A port, for argparse."""
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text} is not a port, wanted 1 to 65535")
    return int(text)


def poses(text: str) -> int:
    """A number of poses, for argparse."""
    if not text.isdecimal() or not 1 <= int(text) <= 40:
        raise argparse.ArgumentTypeError(f"{text} is not a number of poses, wanted 1 to 40")
    return int(text)
