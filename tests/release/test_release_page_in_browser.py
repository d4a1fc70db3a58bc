"""The release page opened in a browser: texts of strangers are shown, and nothing in them runs."""

import pytest

from pipeline.release.dossier import Dossier, Picture, Status, Verdict
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
            lineage=((hostile, hostile, hostile),),
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
