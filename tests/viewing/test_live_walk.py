"""A policy that is played: commanded, pushed, put on other ground, and filmed without a display."""

import socket

import numpy as np
import pytest
from PIL import Image

from pipeline.cli.policy_commands import policy_of
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.simulation.terrain import FlatGround, Slope
from pipeline.validation.deployed import deployed
from pipeline.viewing.film import Walk, record_walk, simulated, write_film
from pipeline.viewing.human_figure import human_figure
from pipeline.viewing.live_walk import TERRAINS, LiveWalk, surface
from pipeline.viewing.play_page import KEYS, PlayPage
from tests.factories.figures import gliding_human


@pytest.fixture(scope="module")
def one(root):
    folder = root / "robots/t1"
    return deployed(folder, policy_of(folder / "policies/walk", folder))


def walked(walk: LiveWalk, seconds: float) -> None:
    for _ in range(round(seconds / walk.control_s)):
        walk.step()


def test_the_robot_goes_where_it_is_commanded_and_the_command_is_rate_limited(one):
    walk = LiveWalk(one)
    walk.goal = np.array([0.5, 0.0, 0.0])
    walk.step()
    assert walk.command[0] == pytest.approx(walk.control_s * 1.0)
    walked(walk, 5.0)
    assert not walk.fallen
    assert 1.2 < walk.state.root_pos_w[0] < 3.0
    assert walk.command[0] == 0.5


def test_equal_calls_give_equal_walks_and_restart_forgets(one):
    walk = LiveWalk(one)
    walk.goal = np.array([0.4, 0.1, 0.2])
    walked(walk, 1.0)
    first = walk.record()
    walk.restart()
    assert walk.time_s == 0.0
    walked(walk, 1.0)
    np.testing.assert_array_equal(walk.record().joint_pos, first.joint_pos)


def test_a_push_moves_the_trunk_along_its_direction(one):
    still, pushed = LiveWalk(one), LiveWalk(one)
    for walk in (still, pushed):
        walked(walk, 0.5)
    pushed.push(15.0, np.pi / 2.0)
    for walk in (still, pushed):
        walked(walk, 0.1)
    gained = pushed.state.root_lin_vel_w - still.state.root_lin_vel_w
    assert gained[1] > 0.1 and abs(gained[0]) < gained[1]


def test_a_hard_push_ends_in_a_fall(one):
    walk = LiveWalk(one)
    walk.push(200.0, 0.0)
    walked(walk, 2.0)
    assert walk.fallen


@pytest.mark.parametrize("terrain", TERRAINS)
def test_every_terrain_can_be_stood_on(one, terrain):
    walk = LiveWalk(one, terrain, friction=0.8)
    walked(walk, 0.3)
    assert not walk.fallen


def test_the_surface_that_is_drawn_is_the_ground(one):
    ground = Slope(angle_deg=10.0)
    vertices, faces = surface(ground, (-1.0, 2.0), (-0.5, 0.5), 0.25)
    np.testing.assert_allclose(vertices[:, 2], [ground.height(x, y) for x, y, _ in vertices])
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    flat, _ = surface(FlatGround(), (-1.0, 2.0), (-0.5, 0.5), 0.25)
    assert len(flat) == len(vertices) and area == pytest.approx(1.5 + 1.5 / np.cos(np.radians(10.0)), rel=1e-2)


@pytest.fixture(scope="module")
def page(one):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    made = PlayPage(one, "<b>walk</b>", port=port)
    yield made
    made.stop()


def test_sliders_and_keys_command_the_walk(page):
    page.restart()
    page.press("W")
    page.press("W")
    page.press("Q")
    assert [slider.value for slider in page.sliders] == [0.2, 0.0, 0.1]
    page.step(0.1)
    assert page.walk.goal.tolist() == [0.2, 0.0, 0.1]
    assert page.walk.time_s == pytest.approx(0.1)
    for _ in range(60):
        page.press("W")
    assert page.sliders[0].value == 2.0, "no key leads beyond a slider's end"
    page.halt()
    page.step(0.02)
    assert page.walk.goal.tolist() == [0.0, 0.0, 0.0]
    assert len(KEYS) == 6


def test_terrain_and_friction_are_changed_and_a_slow_machine_falls_behind(page):
    page.terrain.value, page.friction.value = "slope up 6°", 0.7
    page.step(0.02)
    assert page.walk.ground.height(2.0, 0.0) > 0.1
    before = page.walk.time_s
    page.step(60.0)
    assert page.walk.time_s - before <= 10 * page.walk.control_s + 1e-9
    page.terrain.value = "flat"
    page.step(0.02)


def test_a_name_is_shown_as_text(page):
    assert "<b>" not in page.text.content


def test_a_walk_is_filmed_as_gif_and_mp4(one, tmp_path):
    walk = Walk(command=(0.5, 0.0, 0.0), seconds=0.6, push=5.0)
    assert "6 pictures, 0.6 s" in record_walk(tmp_path / "walk.gif", one, walk)
    with Image.open(tmp_path / "walk.gif") as film:
        assert film.n_frames == 6
        first = film.convert("RGB").copy()
        film.seek(5)
        assert film.convert("RGB").tobytes() != first.tobytes()
    record_walk(tmp_path / "walk.mp4", one, walk)
    assert b"ftyp" in (tmp_path / "walk.mp4").read_bytes()[:12]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["walk.gif", "walk.mp4"], "nothing half-written is left"


def test_a_film_that_can_not_be_made_says_why(one, tmp_path):
    with pytest.raises(UnknownNameError, match="unknown terrain 'sea'"):
        simulated(one, Walk(command=(0.0, 0.0, 0.0), seconds=1.0, terrain="sea"))
    with pytest.raises(PipelineError, match="more than 0, up to"):
        simulated(one, Walk(command=(0.0, 0.0, 0.0), seconds=0.0))
    with pytest.raises(FileError, match=r"a film is one of: \.mp4, \.gif"):
        write_film(tmp_path / "walk.avi", [human_figure(gliding_human())])
    with pytest.raises(PipelineError, match=r"can't start at 99 s; 0 to \d\.\d\d s is allowed"):
        write_film(tmp_path / "walk.mp4", [human_figure(gliding_human())], start_s=99.0)
    assert list(tmp_path.iterdir()) == []
