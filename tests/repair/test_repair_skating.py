"""Where gliding begins and ends: in stance to the frame, in flight between the stances around it."""

from __future__ import annotations

import dataclasses
import functools
import warnings

import numpy as np
import pytest

from pipeline.clips.human_clip import HumanClip
from pipeline.generator import RECIPES, generate
from pipeline.readers import read_motion
from pipeline.repair import RepairSettings, process
from pipeline.repair.contacts import both_feet
from pipeline.repair.skating import Skating, find_skating
from tests.factories.human_clips import walker

SECONDS = 2.0
"""Length of a glide [s]."""
RUN_AT_30_HZ_S = 0.2
"""In a run at 30 Hz a stance has six frames, two of them steady: told by feet alone an edge may be so far off [s]."""
SLOWLY_S = 0.2
"""A glide that gains its speed in this time shows no kick [s]."""


@functools.cache
def made(name: str, fps: float) -> HumanClip:
    return generate(dataclasses.replace(RECIPES[name], name=name, fps=fps)).clip


def gliding(
    clip: HumanClip, start: int, stop: int, velocity_m_s: tuple[float, float], ramp_s: float = 0.0
) -> HumanClip:
    """The clip with a velocity added in the frames [start, stop), which comes and goes within `ramp_s`."""
    way = np.zeros((clip.frame_count, 1, 3))
    frames, ramp = np.arange(clip.frame_count), max(1.0, ramp_s * clip.fps)
    share = np.clip(np.minimum(frames - start, stop - 1 - frames) / ramp + 0.5 * (ramp > 1.0) + (ramp == 1.0), 0.0, 1.0)
    way[:, 0, :2] = share[:, None] * np.array(velocity_m_s) / clip.fps
    return dataclasses.replace(clip, body_pos_w=clip.body_pos_w + np.cumsum(way, axis=0))


def found(clip: HumanClip, settings: RepairSettings) -> list[Skating]:
    return find_skating(both_feet(clip, 0.0), clip.body_pos_w, clip.fps, settings.contact)


def observable(contacts: np.ndarray, edge: int, off: float) -> tuple[float, float]:
    """Between which frames an edge may be told: at the edge, or at the stances around a flight that it falls into."""
    stands = np.flatnonzero(contacts.any(axis=1))
    before, after = stands[stands < edge], stands[stands >= edge]
    return min(before[-1] + 1, edge) - off, max(after[0], edge) + off


@pytest.mark.parametrize("name", ["walk", "side_left", "run_easy"])
@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("velocity_m_s", [(0.25, 0.0), (-0.2, 0.15), (0.0, 0.3)])
def test_glide_that_begins_at_once_is_told_to_the_frame(name, fps, velocity_m_s, settings):
    clip = made(name, fps)
    for first_s in (2.0, 2.17, 2.31):
        start = round(first_s * fps)
        stop = start + round(SECONDS * fps)
        told = found(gliding(clip, start, stop, velocity_m_s), settings)
        assert [(one.start, one.stop) for one in told] == [(start, stop)]


@pytest.mark.parametrize("name", ["walk", "side_left", "run_easy"])
@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("velocity_m_s", [(0.0, 0.3)])
def test_glide_that_begins_slowly_is_told_by_the_feet(name, fps, velocity_m_s, settings):
    clip = made(name, fps)
    assert clip.contacts is not None
    off = SLOWLY_S / 2 * fps + (RUN_AT_30_HZ_S * fps if (name, fps) == ("run_easy", 30.0) else max(2.0, 0.04 * fps))
    for first_s in (2.0, 2.17):
        start = round(first_s * fps)
        stop = start + round(SECONDS * fps)
        told = found(gliding(clip, start, stop, velocity_m_s, ramp_s=SLOWLY_S), settings)
        assert len(told) == 1, told
        for edge, where in ((start, told[0].start), (stop, told[0].stop)):
            low, high = observable(clip.contacts, edge, off)
            assert low <= where <= high, (first_s, edge, told)


def test_step_to_the_side_and_back_in_a_frame_is_no_kick(settings):
    clip = generate(RECIPES["walk"]).clip
    spoilt = gliding(clip, 150, 280, (0.25, 0.0), ramp_s=SLOWLY_S)
    pos = spoilt.body_pos_w.copy()
    pos[160, :, 0] += 0.25 / clip.fps
    with_spike = found(dataclasses.replace(spoilt, body_pos_w=pos), settings)
    assert [(one.start, one.stop) for one in with_spike] == [(one.start, one.stop) for one in found(spoilt, settings)]


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_glide_to_the_end_is_told_to_the_end(fps, settings):
    clip = walker(fps=fps)
    told = found(gliding(clip, clip.frame_count // 2, clip.frame_count, (0.3, 0.0)), settings)
    assert [one.stop for one in told] == [clip.frame_count]


def test_two_glides_with_a_second_between_stay_two(settings):
    clip = generate(RECIPES["walk"]).clip
    spoilt = gliding(gliding(clip, 120, 240, (0.3, 0.0)), 330, 450, (0.0, 0.3))
    told = found(spoilt, settings)
    assert len(told) == 2
    assert np.allclose([(one.start, one.stop) for one in told], [(120, 240), (330, 450)], atol=3)


@pytest.mark.parametrize("name", ["walk", "run_easy", "side_left", "turn_left", "stand"])
def test_feet_that_stand_do_not_glide(name, settings):
    assert found(generate(RECIPES[name]).clip, settings) == []


@pytest.mark.shared
def test_a_clip_that_begins_in_the_air_is_not_cut_as_skating(cases, settings):
    clip = read_motion(cases / "skate_speed_nan" / "leap.bvh", "clip").clip
    _check_in_the_air(clip, settings)


@pytest.mark.parametrize(("first", "stop"), [(0, 24), (100, 130)])
def test_a_leap_is_no_skating_and_no_reason_holds_nan(root, settings, first, stop):
    clip = read_motion(root / "data/motions/run_fast.bvh", "clip").clip
    time = np.linspace(-1.0, 1.0, stop - first)
    pos = clip.body_pos_w.copy()
    pos[first:stop, :, 2] += (0.35 * (1.0 - (time**2 if first else np.linspace(0.0, 1.0, stop - first) ** 2)))[:, None]
    _check_in_the_air(dataclasses.replace(clip, body_pos_w=pos), settings)


def _check_in_the_air(clip, settings):
    window = {"skill": "transition", "start_frame": 0, "stop_frame": clip.frame_count}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        outcome = process(clip, window, settings=settings)
    assert outcome.reasons or outcome.pieces
    assert all(reason.code != "foot_skate" for reason in outcome.reasons)
    assert all(reason.value is None or np.isfinite(reason.value) for reason in outcome.reasons)
    assert all("nan" not in reason.text for reason in outcome.reasons)
