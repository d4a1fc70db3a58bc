"""Seconds by command: counted by motion, kept in sum, read back from a clip's text."""

import json

import numpy as np
import pandas as pd
import pytest

from pipeline import rotation
from pipeline.feasibility.command_space import BOX, by_command, command_seconds_text
from pipeline.quality.planar_motion import command_velocities


def _row(clip: str, seconds: float, commands: list[list[float]] | None = None, fps: float = 50.0) -> dict:
    mean = {"forward_m_s": 0.41, "lateral_m_s": 0.0, "yaw_rate_rad_s": 0.0}
    text = None if commands is None else command_seconds_text(np.array(commands), fps)
    return {"clip": clip, "seconds": seconds, **mean, "command_seconds": text}


def test_on_a_circle_the_command_is_the_same_everywhere():
    times_s = np.arange(200) / 50.0
    yaw = 1.5 * times_s
    radius = 0.8 / 1.5
    path = np.stack([radius * np.sin(yaw), -radius * np.cos(yaw), np.full(200, 0.6)], axis=1)
    _, found = command_velocities(path, rotation.about_z(yaw), 50.0)
    inner = found[30:-30]
    np.testing.assert_allclose(inner, np.broadcast_to([0.8, 0.0, 1.5], inner.shape), atol=2e-3)
    np.testing.assert_allclose(found, np.broadcast_to([0.8, 0.0, 1.5], found.shape), atol=0.02)


def test_sway_over_a_stride_is_no_command():
    times_s = np.arange(250) / 50.0
    path = np.stack([0.5 * times_s, 0.03 * np.sin(2.0 * np.pi * times_s), np.full(250, 0.6)], axis=1)
    _, found = command_velocities(path, rotation.about_z(np.zeros(250)), 50.0)
    assert np.abs(found[25:-25, 1]).max() < 0.01
    np.testing.assert_allclose(found[:, 0], 0.5)


def test_a_clip_that_stands_and_walks_counts_for_both():
    text = command_seconds_text(np.array([[0.02, 0.01, 0.0]] * 50 + [[1.02, -0.01, 0.3]] * 100), 50.0)
    assert json.loads(text) == [[0.05, 0.05, 0.125, 1.0], [1.05, -0.05, 0.375, 2.0]]


def test_seconds_of_a_clip_add_up_to_its_own_whether_it_carries_commands_or_not():
    rows = pd.DataFrame([_row("carries", 3.0, [[0.02, 0.0, 0.0]] * 49 + [[1.02, 0.0, 0.0]] * 101), _row("mean", 2.0)])
    found = by_command(rows)
    assert found.groupby("clip")["seconds"].sum().to_dict() == pytest.approx({"carries": 3.0, "mean": 2.0})
    assert found.loc[found["clip"] == "mean", "forward_m_s"].tolist() == [0.41]
    assert found["row"].tolist() == [0, 0, 1]


def test_a_table_without_clips_has_no_seconds():
    empty = pd.DataFrame([_row("carries", 3.0)]).iloc[:0]
    assert by_command(empty).empty


def test_boxes_are_those_of_numpys_unique_rows_in_their_order():
    commands = np.random.default_rng(0).normal(0.0, [0.8, 0.3, 0.9], size=(2_000, 3))
    boxes, frames = np.unique(np.floor(commands / BOX + 1e-9).astype(int), axis=0, return_counts=True)
    found = np.array(json.loads(command_seconds_text(commands, 50.0)))
    np.testing.assert_allclose(found[:, :3], (boxes + 0.5) * BOX, atol=1e-3)
    np.testing.assert_allclose(found[:, 3], frames / 50.0, atol=1e-9)
