"""The browser viewer: server, scene and controls, driven without a browser."""

import html
import socket
import urllib.error
import urllib.request

import numpy as np
import pytest

from pipeline.errors import ClipError
from pipeline.viewing.playlist import Playlist, Shown
from pipeline.viewing.viewer import TILE, Playback, Viewer
from tests.factories.figures import gliding_human, standing_robot


@pytest.fixture(scope="module")
def viewer(robot):
    """Two clips: a human beside a robot, and a robot alone."""

    def load(name: str) -> Shown:
        if name == "broken":
            raise ClipError(name, "damaged", "it has no frames.")
        human = gliding_human() if name == "both" else None
        return Shown(name=name, human=human, robot_clip=standing_robot(robot), robot=robot, text="as measured")

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    viewer = Viewer(Playlist(names=("both", "robot alone"), beside=("broken",), load=load), port=port)
    yield viewer
    viewer.stop()


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return answer.status == 200 and b"viser" in answer.read().lower()
    except (urllib.error.URLError, ConnectionError):
        return False


def test_the_page_is_served_on_this_machine_until_the_viewer_stops(robot):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    only = Shown(name="nod", robot_clip=standing_robot(robot), robot=robot)
    viewer = Viewer(Playlist(names=("nod",), load=lambda name: only), port=port)
    assert viewer.url == f"http://localhost:{port}"
    assert _answers(f"http://127.0.0.1:{port}")
    viewer.stop()
    assert not _answers(f"http://127.0.0.1:{port}")


def test_the_scene_has_a_node_for_each_part_and_each_primitive(viewer):
    viewer.clip.value = "both"
    viewer.step(0.0)
    human, machine = viewer.figures
    assert (human.figure.name, machine.figure.name) == ("human", "t1")
    for figure in viewer.figures:
        assert len(figure.parts) == len(figure.figure.parts)
        assert [len(meshes) for meshes in figure.meshes] == [len(part.shapes) for part in figure.figure.parts]
    names = [mesh.name for figure in viewer.figures for meshes in figure.meshes for mesh in meshes]
    assert len(names) == len(set(names)) == sum(len(p.shapes) for f in viewer.figures for p in f.figure.parts)


def test_human_reference_and_rollout_stand_side_by_side(robot):
    clip = standing_robot(robot)
    shown = Shown(name="rollout", human=gliding_human(), reference=clip, robot_clip=clip, robot=robot)
    viewer = Viewer(Playlist(names=("rollout",), load=lambda name: shown), port=8080)
    try:
        viewer.step(0.0)
        assert [figure.figure.name for figure in viewer.figures] == ["human", "reference", "t1"]
        places = [figure._place[1] for figure in viewer.figures]
        assert places == sorted(places, reverse=True) and len(set(places)) == 3
    finally:
        viewer.stop()


def test_a_seek_moves_every_part_to_its_pose_at_that_time(viewer):
    viewer.clip.value = "both"
    viewer.step(0.0)
    viewer.slider.value = 1.0
    viewer.step(0.0)
    for figure in viewer.figures:
        frame = figure.figure.frame_at(1.0)
        assert frame == round(figure.figure.fps)
        for index, part in enumerate(figure.parts):
            assert np.allclose(part.position, figure.figure.pos_w[frame, index])
            assert np.allclose(part.wxyz, figure.figure.quat_w[frame, index])


def test_playing_moves_the_figures_and_pausing_holds_them(viewer):
    viewer.clip.value = "both"
    viewer.slider.value = 0.1
    viewer.step(0.0)
    head = [part.name for part in viewer.figures[1].figure.parts].index("H2")
    before = np.array(viewer.figures[1].parts[head].wxyz)
    viewer.step(0.5)
    after = np.array(viewer.figures[1].parts[head].wxyz)
    assert np.abs(after - before).max() > 1e-3
    viewer.toggle()
    assert viewer.play.label == "play"
    viewer.step(0.5)
    assert np.array_equal(viewer.figures[1].parts[head].wxyz, after)
    viewer.toggle()


def test_half_speed_takes_twice_as_long(viewer):
    viewer.clip.value = "both"
    viewer.step(0.0)
    viewer.slider.value = 0.2
    viewer.step(0.0)
    viewer.speed.value = "0.5"
    viewer.step(0.4)
    assert viewer.playback.time_s == pytest.approx(0.4)
    viewer.speed.value = "1"


def test_another_clip_replaces_the_figures(viewer):
    viewer.clip.value = "robot alone"
    viewer.step(0.0)
    assert [figure.figure.name for figure in viewer.figures] == ["t1"]
    assert "robot alone" in viewer.text.content and "as measured" in viewer.text.content
    viewer.clip.value = "both"
    viewer.step(0.0)
    assert [figure.figure.name for figure in viewer.figures] == ["human", "t1"]


def test_a_clip_that_cannot_be_shown_says_why_and_the_viewer_goes_on(viewer):
    viewer.clip.value = "broken"
    viewer.step(0.1)
    viewer.step(0.1)
    assert "clip 'broken': it has no frames." in html.unescape(viewer.text.content) and viewer.figures
    viewer.clip.value = "both"
    viewer.step(0.0)
    assert "as measured" in viewer.text.content


def test_staying_in_place_moves_the_scene_back_by_the_path(viewer):
    viewer.clip.value = "both"
    viewer.step(0.0)
    figure = viewer.figures[0]
    place = np.array([0.0, figure._place[1], 0.0])
    viewer.slider.value = 1.5
    viewer.follow.value = True
    viewer.step(0.0)
    where = np.array(figure._root.position) + figure.figure.root_pos_w[figure.figure.frame_at(1.5)]
    assert np.allclose(where[:2], place[:2], atol=0.05)
    viewer.slider.value = 1.4
    viewer.follow.value = False
    viewer.step(0.0)
    assert np.allclose(figure._root.position, place)
    viewer.follow.value = True


def test_the_floor_moves_by_whole_squares_so_that_its_pattern_stays(viewer):
    viewer.clip.value = "both"
    viewer.step(0.0)
    viewer.slider.value = 1.9
    viewer.step(0.0)
    squares = np.array(viewer.figures[0]._floor.position)[:2] / TILE
    assert np.allclose(squares, np.rint(squares)) and squares[0] >= 3


def test_the_clock_goes_round_and_is_held_within_the_clip():
    clock = Playback(duration_s=2.0, speed=2.0)
    clock.advance(0.75)
    assert clock.time_s == pytest.approx(1.5)
    clock.advance(0.5)
    assert clock.time_s == pytest.approx(0.5)
    clock.seek(7.0)
    assert clock.time_s == 2.0
    clock.seek(-1.0)
    assert clock.time_s == 0.0


def test_a_clip_of_one_frame_stands_still():
    clock = Playback(duration_s=0.0)
    clock.advance(1.0)
    assert clock.time_s == 0.0


@pytest.mark.parametrize("name", ["<script>fetch('/x')</script>", "<img src=x onerror=alert(1)>", "[a](b){c}|d|`e`"])
def test_a_name_and_an_error_are_shown_as_text(robot, name):
    def load(chosen: str) -> Shown:
        if chosen != name:
            raise ClipError(chosen, "damaged", f"{name} has no frames.")
        return Shown(name=name, robot_clip=standing_robot(robot), robot=robot)

    viewer = Viewer(Playlist(names=(name,), beside=("broken",), load=load), port=8931)
    try:
        assert html.unescape(viewer.text.content) == f"**{name}**\n\n"
        assert not set(viewer.text.content.replace("&#", "")) & set("<>[]{}|`")
        viewer.clip.value = "broken"
        viewer.step(0.0)
        assert name in html.unescape(viewer.text.content)
        assert not set(viewer.text.content.replace("&#", "")) & set("<>[]{}|`")
    finally:
        viewer.stop()
