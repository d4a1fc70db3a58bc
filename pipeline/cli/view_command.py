"""`booster-lab view CLIP`: human, reference and robot side by side, playing in a browser or as a picture.

A clip is one of a motion file, of the store's manifests or of the database. `booster-lab curate`: the curator's page.
"""

import contextlib
import webbrowser
from pathlib import Path

from pipeline.cli.arguments import Curate, View
from pipeline.cli.chain import Chain, reason_line
from pipeline.cli.stored_clips import reference_of, stored_clips
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.expert.database_clip import read_database_clip
from pipeline.files import atomic
from pipeline.files.shown_text import markdown_list
from pipeline.project import Project, find_project
from pipeline.readers import Statement
from pipeline.readers.read_motion import SUFFIXES
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import LARGE, contact_sheet
from pipeline.viewing.playlist import Playlist, Shown


def clips_to_view(project: Project, text: str, robot: Robot, stated: Statement) -> Playlist:
    """What `text` means: a file if there is one of that name, else clips of the store.

    Raises FileError or UnknownNameError with what there is.
    """
    path = Path(text)
    if path.is_dir():
        raise FileError(path, "it is a folder.", "Name one motion file, or look at all with: booster-lab inspect")
    if path.suffix.lower() == ".json":
        return _of_database(project, path, robot)
    if path.suffix.lower() == ".mcap":
        from pipeline.viewing.log_view import log_playlist

        return log_playlist(path, project)
    if path.is_file() or path.suffix.lower() in SUFFIXES:
        return _of_file(project, path, robot, stated)
    return stored_clips(project, text, robot)


def _of_file(project: Project, path: Path, robot: Robot, stated: Statement) -> Playlist:
    """The pieces of a motion file after repair, each retargeted when it is chosen; last the file as it was read."""
    chain = Chain(project)
    read = chain.read(path, stated)
    catalogued = chain.catalogued(read)
    whole = catalogued.pieces[0] if catalogued.pieces else Piece(clip=read.motion.clip)
    repaired = chain.repaired(whole) if catalogued.pieces else Outcome()
    reasons = (*catalogued.reasons, *repaired.reasons)
    pieces = {piece.clip.name: piece for piece in repaired.pieces}
    as_read = f"{whole.clip.name} (as read)"

    def load(name: str) -> Shown:
        if name == as_read:
            return _shown(name, whole.clip, None, robot, reasons)
        outcome = chain.retargeted(pieces[name], whole.numbers, robot)
        result = outcome.pieces[0].clip if outcome.pieces else None
        return _shown(name, pieces[name].clip, result, robot, (*reasons, *outcome.reasons))

    return Playlist(names=tuple(pieces) or (as_read,), beside=(as_read,) if pieces else (), load=load)


def _shown(name: str, source: object, result: object, robot: Robot, reasons: tuple[Reason, ...]) -> Shown:
    recording = source if isinstance(source, RobotClip) else None
    lines = markdown_list((reason_line(reason) for reason in reasons), "")
    return Shown(
        name=name,
        human=source if isinstance(source, HumanClip) else None,
        robot_clip=result if isinstance(result, RobotClip) else recording,
        robot=robot,
        text=lines,
    )


def _of_database(project: Project, path: Path, robot: Robot) -> Playlist:
    """A clip of the database; a rollout plays beside its reference where the store has it."""
    clip, head = read_database_clip(path, robot)
    facts = markdown_list(f"{name}: {value}" for name, value in head.items())
    reference = reference_of(project, clip, robot)
    shown = Shown(name=clip.name, reference=reference, robot_clip=clip, robot=robot, text=facts)
    return Playlist(names=(clip.name,), load=lambda name: shown)


MOST_STRIPS = 12
"""Clips in one picture."""


def view_clip(args: View) -> int:
    """Play until interrupted, or write the picture."""
    if args.picture is not None and args.picture.suffix.lower() != ".png":
        raise FileError(args.picture, "a picture is a .png.", "Name a file with that suffix.")
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

    Viewer(clips, port=args.port, host=args.host).serve(clips.names[0], browser=not args.no_browser)
    return 0


def picture(clips: Playlist, robot: Robot, count: int) -> bytes:
    """A contact sheet of the clip, or of the first clips where the name means several."""
    shown = [clips.load(name) for name in clips.names[:MOST_STRIPS]]
    return contact_sheet(shown, robot, count, LARGE) if len(shown) == 1 else contact_sheet(shown, robot, count)


def curate(args: Curate) -> int:
    """Serve the curator's page to this machine's browser until interrupted."""
    from pipeline.curation_page.app import CurationServer

    project = find_project()
    server = CurationServer(project.root, args.robot, args.port)
    print(f"{server.url}\nshows the clips of {project.root}; stop with Ctrl-C", flush=True)
    if not args.no_browser:
        webbrowser.open(server.url)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        server.run()
    return 0
