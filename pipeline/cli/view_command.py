"""`booster-lab view CLIP`: human, reference and robot side by side, playing in a browser or as a picture."""

from __future__ import annotations

import webbrowser

from pipeline.cli.arguments import View
from pipeline.cli.clips_to_view import clips_to_view
from pipeline.cli.project import find_project
from pipeline.files import atomic
from pipeline.readers import Statement
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import Strip, contact_sheet, worst_clips_sheet
from pipeline.viewing.playlist import Playlist

MOST_STRIPS = 12
"""Clips in one picture."""


def run(args: View) -> int:
    """Play until interrupted, or write the picture."""
    project = find_project()
    robot = project.robot(args.robot)
    clips = clips_to_view(project, args.clip, robot, Statement(**vars(args.statement)))
    if args.picture is not None:
        atomic.write_bytes(args.picture, picture(clips, robot, args.poses))
        print(f"{args.picture}: {min(len(clips.names), MOST_STRIPS)} of {len(clips.names)} clips")
        return 0
    if args.record is not None:
        from pipeline.viewing.film import write_film

        shown = clips.load(clips.names[0])
        count = write_film(args.record, shown.figures(), start_s=args.start, seconds=args.seconds)
        print(f"{args.record}: {count} pictures of {clips.names[0]}")
        return 0
    from pipeline.viewing.viewer import Viewer  # starts threads and a web server: not for the picture

    viewer = Viewer(clips, port=args.port, host=args.host)
    try:
        print(f"{viewer.url} plays {clips.names[0]}; stop with Ctrl-C", flush=True)
        if not args.no_browser:
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
