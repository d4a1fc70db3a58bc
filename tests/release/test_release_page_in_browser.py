"""The release page opened in a browser: texts of strangers are shown, and nothing in them runs."""

import io
import time

import pytest
from PIL import Image

from pipeline.release.dossier import Dossier, Origin, Picture, Status, Verdict, verdict_of
from pipeline.release.page import page
from tests.factories.browser import WAIT_S, chromium, listening


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


def test_hostile_texts_are_shown_and_do_not_run(tmp_path, browser):
    with listening() as listener:
        hostile = f"'\"><script>fetch('http://{listener.address}/plain')</script>" + listener.hostile("page")
        verdict = Verdict(name=hostile, status=Status.FAILED, reasons=(hostile,), facts=((hostile, hostile),))
        found = Dossier(
            title=hostile,
            policy=hostile,
            card=((hostile, hostile),),
            lineage=(Origin(asset=hostile, version=hostile, remark=hostile),),
            verdicts=(verdict,),
            pictures=(Picture(caption=hostile, data=b"\x89PNG\r\n\x1a\n"),),
            conditions=(hostile,),
        )
        shown, unescaped = tmp_path / "shown.html", tmp_path / "unescaped.html"
        shown.write_text(page(found), encoding="utf-8")
        unescaped.write_text(f"<!doctype html><title>x</title>{hostile}", encoding="utf-8")
        opened = browser.new_page()
        opened.goto(shown.as_uri())
        assert opened.get_by_text(listener.address).count() >= 8
        assert opened.frames == [opened.main_frame]
        assert not listener.waits_for("", 2.0), listener.asked
        opened.goto(unescaped.as_uri())  # so that the test can fail
        assert all(listener.waits_for(mark, WAIT_S) for mark in ("plain", "page-image", "page-script"))
        opened.close()


def moving(colours):
    """A GIF that shows one colour after the other."""
    frames = [Image.new("RGB", (80, 40), colour) for colour in colours]
    stream = io.BytesIO()
    frames[0].save(stream, "gif", save_all=True, append_images=frames[1:], duration=80, loop=0)
    return stream.getvalue()


def test_its_videos_play_and_its_failures_are_red(tmp_path, browser):
    cells = [
        {"cell": "vx +2.0", "verdict": "failed", "figures": {"falls": 2}, "bars": {"falls": {"asked": "at most 0"}}}
    ]
    found = verdict_of("mujoco_validation", {"passed": False, "policy": "a", "cells": cells}, "a")
    video = Picture(caption="forward 0.6 m/s", data=moving(["red", "green", "blue"]), kind="gif")
    dossier = Dossier(title="x", policy="a", card=(), lineage=(), verdicts=(found,), pictures=(video,))
    path = tmp_path / "page.html"
    path.write_text(page(dossier), encoding="utf-8")
    opened = browser.new_page()
    opened.goto(path.as_uri())
    shown, end = set(), time.monotonic() + WAIT_S
    while len(shown) < 3 and time.monotonic() < end:
        shown.add(opened.locator("figure img").screenshot())
    assert len(shown) >= 3, "the frames of a video follow one another"
    assert opened.locator("figure img").evaluate("image => image.complete && image.naturalWidth") == 80
    badge = opened.locator("h3 .status")
    assert badge.inner_text() == "failed"
    assert badge.evaluate("each => getComputedStyle(each).backgroundColor") == "rgb(179, 38, 30)"
    columns = opened.locator("table.figures th").all_inner_texts()
    assert columns == ["cell", "verdict", "falls", "figure", "value", "unit", "bar"]
    opened.close()
