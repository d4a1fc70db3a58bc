"""Triangles on a canvas: where they are, which is on top, that what meets leaves no gap, and what they need."""

import tracemalloc

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.viewing.contact_sheet import contact_sheet
from pipeline.viewing.playlist import Shown
from pipeline.viewing.projection import TriangleArtist, Triangles, one_above_the_other
from tests.factories.figures import gliding_human, tumbling_robot

RED, BLUE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
DOTS = 100
MOST_BYTES = 12e6
"""Of a sheet of two clips, some 23 000 triangles; with a Python object a triangle it takes 21 MB."""


def _drawn(triangles: Triangles) -> np.ndarray:
    """Pixels of the unit square, the first row on top."""
    figure = Figure(figsize=(1.0, 1.0), dpi=DOTS)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.add_artist(TriangleArtist(triangles))
    agg = FigureCanvasAgg(figure)
    agg.draw()
    return np.asarray(agg.buffer_rgba())[..., :3] / 255


def _fan(points: int, color: np.ndarray) -> Triangles:
    """A disc of radius .4 in the middle, in slices."""
    turn = 2 * np.pi * np.arange(points + 1) / points
    rim = 0.5 + 0.4 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    corners = np.stack([np.full((points, 2), 0.5), rim[:-1], rim[1:]], axis=1)
    return Triangles(corners=corners, colors=np.tile(color, (points, 1)))


def test_a_triangle_is_where_its_corners_are_and_has_its_colour():
    pixels = _drawn(Triangles(corners=np.array([[[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]]), colors=RED[None]))
    assert np.allclose(pixels[70, 30], RED, atol=0.01), "below the diagonal, up is up"
    for row, column in ((30, 70), (95, 50), (50, 5)):
        assert np.allclose(pixels[row, column], 1.0)


def test_the_last_is_on_top():
    below, above = _fan(7, RED), _fan(9, BLUE)
    assert np.allclose(_drawn(one_above_the_other([below, above]))[50, 40], BLUE, atol=0.01)
    assert np.allclose(_drawn(one_above_the_other([above, below]))[50, 40], RED, atol=0.01)


@pytest.mark.parametrize("points", [5, 24, 180])
def test_between_two_that_meet_nothing_shows(points):
    pixels = _drawn(_fan(points, RED))
    row, column = np.mgrid[:DOTS, :DOTS] + 0.5
    inside = np.hypot(row - DOTS / 2, column - DOTS / 2) < 0.3 * DOTS
    assert np.abs(pixels[inside] - RED).max() < 0.05


def test_no_triangle_at_all_is_an_empty_picture():
    assert (_drawn(one_above_the_other([])) == 1.0).all()


def test_moved_ones_keep_their_colours():
    moved = _fan(5, BLUE).moved(np.array([0.1, -0.2]))
    assert np.allclose(moved.corners[:, 0], [0.6, 0.3])
    assert (moved.colors == BLUE).all()


def test_a_sheet_needs_no_object_a_triangle(robot):
    shown = [Shown(name="walk", human=gliding_human(), robot_clip=tumbling_robot(robot))]
    contact_sheet(shown, robot, dots_per_m=105)
    tracemalloc.start()
    try:
        contact_sheet(shown, robot, dots_per_m=105)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < MOST_BYTES
