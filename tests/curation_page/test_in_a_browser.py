"""The curator's page in a headless Chromium, on a small project that no run has to make."""

import dataclasses
import shutil
from pathlib import Path
from urllib.parse import quote

import pytest
import yaml

from pipeline.batch import Store
from tests.factories import curated_project as made
from tests.factories.curation_browser import Browser, browser, served

LATER = 40
"""Rejected clips of the recording `many/clip…`, so that the gallery can be scrolled."""


@pytest.fixture
def folder(root, robot, tmp_path):
    folder = made.curated_project(root, tmp_path / "project", robot)
    store = Store(root=folder / "data/store")
    manifest = store.load("feasible_motions").at_hand()
    slip = made.reason("foot_slip_p95", "feet slide", start_s=1.0, stop_s=1.5)
    rows = [made.judged(many(place), None, slip, foot_slip_p95=0.9 - place / 100) for place in range(LATER)]
    store.save("feasible_motions", dataclasses.replace(manifest, judged=(*manifest.judged, *rows)))
    return folder


@pytest.fixture
def server(folder):
    with served(folder) as running:
        yield running


@pytest.fixture
def page(server):
    with browser(server.url) as opened:
        opened.page.wait_for_selector(".card")
        name(opened)
        yield opened


def many(place: int) -> str:
    return f"many/clip{place:02d}@0-99~rollout"


def name(page: Browser) -> None:
    page.page.fill("#name", "Ada")
    page.page.locator("#name").blur()


def go(page: Browser, where: str, ready: str) -> None:
    page.page.evaluate("where => { location.hash = where; }", where)
    page.page.wait_for_selector(ready)


def clip(name: str) -> str:
    return f"#/clip/{quote(name, safe='~')}"


def shown(page: Browser) -> list[str]:
    """Names of the cards in view, in the order in which they are seen."""
    script = """cards => cards.map(card => [card.getBoundingClientRect(), card.querySelector('.name').textContent])
        .sort(([a], [b]) => a.top - b.top || a.left - b.left).map(([, name]) => name)"""
    return page.page.eval_on_selector_all(".card:not([hidden])", script)


def decisions(folder: Path) -> list[dict]:
    return yaml.safe_load((folder / "data/curation.yaml").read_text()).get("decisions", [])


def test_names_lead_from_the_lineage_and_the_decisions_to_pages_of_their_own(page):
    go(page, clip(made.KEPT), ".timeline")
    page.page.click("button.exclude")
    page.page.fill("dialog input", "wrong person")
    page.page.select_option("dialog select", made.RECORDING)
    page.page.click("dialog .ok")
    page.page.wait_for_selector("text=excluded by Ada")
    links = page.page.eval_on_selector_all("main a[href^='#/clip/']", "all => all.map(each => each.hash)")
    go(page, "#/decisions", "td")
    links += page.page.eval_on_selector_all("main a[href^='#/clip/']", "all => all.map(each => each.hash)")
    assert clip(made.RECORDING) in links and clip(made.WINDOW) in links
    for link in dict.fromkeys(links):
        go(page, link, "h1")
        assert page.page.is_hidden("#message.error"), link
    go(page, clip(made.RECORDING), "text=clips were derived from it")
    assert made.KEPT in page.page.text_content(".page")
    assert "excluded by Ada" in page.page.text_content(".page")
    page.page.click("text=undo")
    page.page.wait_for_selector("text=no decision yet")
    assert page.complaints == []


def test_a_range_starts_at_the_clip_that_was_clicked_last_though_others_are_filtered_out(page):
    page.page.click(f"[aria-label='select {many(0)}']")
    page.page.fill("input[type=search]", "many")
    page.until(f"document.querySelector('.count').textContent.startsWith('{LATER} of')")
    page.page.click(f"[aria-label='select {many(3)}']", modifiers=["Shift"])
    chosen = page.page.eval_on_selector_all(".card.chosen .name", "all => all.map(each => each.textContent)")
    assert sorted(chosen) == [many(place) for place in range(4)]


def test_the_address_keeps_ranges_and_a_decision_keeps_them_and_the_place(page, server):
    canvas = page.page.locator("[data-figure='foot_slip_p95'] canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 9)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + box["width"] - 1, box["y"] + 9)
    page.page.mouse.up()
    page.until("location.hash.includes('range=')")
    count = page.page.text_content(".count")
    assert 5 < int(count.split()[0]) < LATER
    with_range = page.other_tab(server.url.partition("#")[0] + page.page.evaluate("location.hash"))
    with_range.page.wait_for_selector(".count")
    assert with_range.page.text_content(".count") == count, "a bookmark"
    page.page.evaluate("document.querySelector('.grid').scrollTop = 400")
    page.until("document.querySelector('.card:not([hidden]) .name')")
    page.page.evaluate("document.querySelectorAll('.card:not([hidden]) input')[4].click()")
    page.page.click(".bar button.exclude")
    page.page.fill("dialog input", "slides")
    page.page.press("dialog input", "Enter")
    page.page.wait_for_selector(".card .decision.exclude")
    assert page.page.text_content(".count") == count
    assert page.page.evaluate("document.querySelector('.grid').scrollTop") == 400
    assert page.complaints == []


def test_playback_goes_on_as_it_was_when_a_decision_is_made(server):
    with browser(server.url, reduced_motion="reduce") as page:
        name(page)
        go(page, clip(made.KEPT), ".timeline")
        page.page.select_option("select[aria-label=speed]", "0.25")
        page.page.fill("input[aria-label=time]", "1.5")
        page.page.click("button.exclude")
        page.page.fill("dialog input", "slides")
        page.page.press("dialog input", "Enter")
        page.page.wait_for_selector("text=excluded by Ada")
        assert page.page.text_content(".controls button:has-text('play')") == "play"
        assert page.page.input_value("input[aria-label=time]") == "1.5"
        assert page.page.input_value("select[aria-label=speed]") == "0.25"


def test_what_another_tab_decides_is_shown_and_the_selection_stays(page, server, folder):
    page.page.click(f"[aria-label='select {many(1)}']")
    other = page.other_tab(server.url.partition("#")[0] + clip(many(0)))
    other.page.click("button.exclude")
    other.page.fill("dialog input", "slides")
    other.page.press("dialog input", "Enter")
    other.page.wait_for_selector("text=excluded by Ada")
    page.page.wait_for_selector(".card .decision.exclude", timeout=8000)
    assert page.page.text_content(".count").endswith("1 selected")
    assert page.page.is_checked(f"[aria-label='select {many(1)}']")
    page.page.click(f".card .name[title='{many(0)}']")
    page.page.wait_for_selector("text=excluded by Ada")
    other.page.click("text=undo")
    page.page.wait_for_selector("text=no decision yet", timeout=8000)
    assert page.complaints == other.complaints == []


def test_an_address_with_a_new_token_opens_in_the_tab_that_shows_the_page_already(page, server, folder):
    page.page.evaluate("localStorage.setItem('booster-lab-token', 'of an earlier start')")
    page.page.goto(server.url)
    page.until("!location.hash.includes('token')")
    page.page.click(f"[aria-label='select {many(0)}']")
    page.page.click(".bar button.accept")
    page.page.fill("dialog input", "sound")
    page.page.press("dialog input", "Enter")
    page.page.wait_for_selector(".card .decision.accept")
    assert [each["clip"] for each in decisions(folder)] == [many(0)]


def test_a_reason_that_could_not_be_written_stays_in_its_form(folder):
    with served(folder) as first, browser(first.url) as page:
        name(page)
        go(page, clip(made.KEPT), ".timeline")
        page.page.click("button.exclude")
        page.page.click("dialog .ok")
        page.page.wait_for_selector("dialog .rejected >> text=a decision needs a reason")
        page.page.fill("dialog input", "its left foot slides")
        first.stop()
        page.page.wait_for_selector("#run >> text=the server does not respond")
        page.page.click("dialog .ok")
        page.page.wait_for_selector("dialog .rejected >> text=the server does not answer")
        assert page.page.input_value("dialog input") == "its left foot slides"
        with served(folder, first.port) as second:
            assert second.port == first.port
            page.page.click("dialog .ok")
            page.page.wait_for_selector("dialog .rejected >> text=token")
            page.page.evaluate("hash => { location.hash = hash; }", second.url.partition("#")[2])
            page.until("!location.hash.includes('token')")
            page.page.click("dialog .ok")
            page.page.wait_for_selector("dialog", state="hidden")
            assert [each["why"] for each in decisions(folder)] == ["its left foot slides"]


def decide_all_shown(page: Browser, verdict: str) -> None:
    page.page.click("text=select all shown")
    page.page.click(f".bar button.{verdict}")
    page.page.fill("dialog input", "watched")
    page.page.press("dialog input", "Enter")
    page.page.wait_for_selector("dialog", state="hidden")


def test_undo_takes_back_the_decisions_of_the_selected_clips_that_have_one(page, folder):
    go(page, "#/?q=clip0", ".card")
    decide_all_shown(page, "accept")
    page.page.wait_for_selector(".card .decision.accept")
    go(page, "#/?q=many", ".card")
    page.until(f"document.querySelector('.count').textContent.startsWith('{LATER} of')")
    page.page.click("text=select all shown")
    page.page.click("text=undo decision")
    page.page.wait_for_selector("#message >> text=10 clips: decision removed")
    assert decisions(folder) == []
    page.page.wait_for_selector(".card .decision", state="hidden")
    page.page.click("text=select all shown")
    page.page.click("text=undo decision")
    page.page.wait_for_selector("#message.error >> text=none of the selected clips has its own decision")
    assert page.complaints == []


def test_after_an_undo_the_focus_is_not_on_the_undo_of_another_clip(page, folder):
    go(page, "#/?q=clip0", ".card")
    decide_all_shown(page, "accept")
    page.page.wait_for_selector(".card .decision.accept")
    first, second, *others = [each["clip"] for each in decisions(folder)]
    go(page, "#/decisions", "button >> text=undo")
    page.page.focus(f"[aria-label='undo {second}']")
    page.page.keyboard.press("Enter")
    page.page.wait_for_selector(f"[aria-label='undo {second}']", state="detached")
    page.until("document.activeElement.matches('main')")
    page.page.keyboard.press("Enter")
    assert [each["clip"] for each in decisions(folder)] == [first, *others]


def test_a_filter_that_no_clip_fulfils_any_more_is_shown(page):
    go(page, "#/?q=clip0", ".card")
    decide_all_shown(page, "accept")
    go(page, "#/?decision=accept", ".card .decision.accept")
    page.page.click("text=select all shown")
    page.page.click("text=undo decision")
    page.until("document.querySelector('.count').textContent.startsWith('0 of')")
    page.until("document.querySelector('select[name=decision]')?.selectedOptions[0]?.textContent === 'accept (0)'")
    page.page.select_option("select[name=decision]", "")
    page.until("!document.querySelector('.count').textContent.startsWith('0 of')")
    page.until("!location.hash.includes('decision')")


RUN = """#!/bin/sh
echo "augmented_motions: 3 clips, 2 known, 1 to work on"
while test -e wait; do sleep 0.05; done
"""


@pytest.fixture
def graph(page, folder, tmp_path, monkeypatch):
    """`dagster` as a script that runs as long as the file that is given exists."""
    script = tmp_path / "bin/dagster"
    script.parent.mkdir()
    script.write_text(RUN)
    script.chmod(0o755)
    monkeypatch.setattr("pipeline.curation_page.materialization.sys.executable", str(script.with_name("python")))
    (folder / "wait").touch()
    return folder / "wait"


def test_buttons_of_a_run_stay_in_place_while_its_state_is_read_again(page, graph):
    page.page.click("text=↻ materialize")
    page.page.focus("#run button >> text=output")
    page.page.evaluate("window.button = document.activeElement")
    page.page.wait_for_selector("#run >> text=0 of 1 clips")
    graph.unlink()
    page.page.wait_for_selector("#run[data-status='done']")
    assert page.page.evaluate("document.activeElement === window.button && window.button.isConnected")
    page.page.keyboard.press("Enter")
    page.page.wait_for_selector("dialog pre >> text=augmented_motions: 3 clips")
    assert page.complaints == []


LONG = f"many/{'n' * 200}@0-99~rollout"


@pytest.fixture
def long_name(folder):
    """The name of a clip that is longer than any window is wide, and has no place to break."""
    store = Store(root=folder / "data/store")
    manifest = store.load("feasible_motions").at_hand()
    row = made.judged(LONG, None, made.reason("foot_slip_p95", "feet slide"), foot_slip_p95=0.6)
    store.save("feasible_motions", dataclasses.replace(manifest, judged=(*manifest.judged, row)))
    return LONG


def too_wide(page: Browser) -> list[str]:
    """Elements whose content is wider than they are, where nothing scrolls it into view."""
    script = """all => all.filter(each => each.scrollWidth > each.clientWidth + 1).map(each => each.tagName)"""
    return page.page.eval_on_selector_all("html, body, header, nav, .page, dialog, #message", script)


def test_long_names_and_narrow_windows_leave_nothing_outside(long_name, page, folder):
    for width in (1360, 380):
        page.page.set_viewport_size({"width": width, "height": 700})
        go(page, clip(long_name), "h1")
        page.page.wait_for_selector(".controls")
        assert too_wide(page) == []
        page.page.click("button.exclude")
        page.page.fill("dialog input", "w" * 300)
        assert too_wide(page) == []
        page.page.click("dialog .ok")
        page.page.wait_for_selector("text=excluded by Ada")
        assert too_wide(page) == [], width
        page.page.click("text=undo")
        page.page.wait_for_selector("text=no decision yet")
        go(page, "#/", ".card")
        assert too_wide(page) == []


def test_the_tab_key_goes_from_clip_to_clip_and_the_focus_stays_on_its_clip(page):
    focused = "document.activeElement.getAttribute('aria-label') ?? document.activeElement.textContent"
    page.page.focus(f"[aria-label='select {made.CUT}']")
    page.page.evaluate("document.querySelector('.grid').scrollTop = 900")
    page.page.wait_for_selector(f".card .name[title='{many(24)}']")
    assert page.page.evaluate(focused) == f"select {made.CUT}"
    page.page.focus(".grid")
    page.page.evaluate("document.querySelector('.grid').scrollTop = 500")
    page.page.wait_for_selector(f".card .name[title='{made.CUT}']", state="detached")
    page.page.wait_for_selector(f".card .name[title='{many(3)}']")
    order, reached = shown(page), []
    for _ in range(8):  # a box and a name each; the first scrolls its row into view, above which there are others then
        page.page.keyboard.press("Tab")
        page.page.wait_for_timeout(50)
        page.page.keyboard.press("Tab")
        page.page.wait_for_timeout(50)
        reached.append(page.page.evaluate(focused))
    assert reached == order[:8]


def test_the_way_back_from_a_clip_leads_to_the_same_place_and_selection(page):
    go(page, "#/?q=many", ".card")
    page.page.click(f"[aria-label='select {many(2)}']")
    page.page.evaluate("document.querySelector('.grid').scrollTop = 700")
    page.page.click(f".card .name[title='{many(20)}']")
    page.page.wait_for_selector("h1")
    page.page.go_back()
    page.page.wait_for_selector(f".card .name[title='{many(20)}']")
    assert page.page.evaluate("document.querySelector('.grid').scrollTop") == 700
    assert page.page.text_content(".count") == f"{LATER} of 45 clips, 1 selected"
    go(page, "#/", ".card")
    assert page.page.text_content(".count") == "45 of 45 clips"
    page.page.fill("input[type=search]", "clip0")
    page.until("location.hash.includes('clip0')")
    page.page.click("nav >> text=Clips")
    page.until("document.querySelector('.count').textContent === '45 of 45 clips'")
    assert page.complaints == []


def test_the_keyboard_alone_decides_and_goes_on_where_it_was(page, folder):
    go(page, clip(made.KEPT), ".timeline")
    page.page.focus("button.exclude")
    for key in ("Enter", "x", "Enter"):
        page.page.keyboard.press(key)
    page.page.wait_for_selector("text=excluded by Ada")
    page.until("document.activeElement.matches('button.exclude')")
    for key in ("Enter", "y", "Escape"):
        page.page.keyboard.press(key)
    page.until("document.activeElement.matches('button.exclude')")
    assert [each["why"] for each in decisions(folder)] == ["x"]
    page.page.focus("button >> text=undo")
    page.page.keyboard.press("Enter")
    page.page.wait_for_selector("text=no decision yet")
    page.until("document.activeElement.matches('main')")
    page.page.keyboard.press("Tab")
    assert page.page.evaluate("document.activeElement.className") == "accept"
    go(page, "#/?q=clip0", ".card")
    page.page.focus("input[type=search]")
    page.page.evaluate("document.dispatchEvent(new CustomEvent('decisions-changed'))")
    page.page.wait_for_timeout(500)
    page.page.keyboard.type("3")
    page.until("document.querySelector('.count').textContent.startsWith('1 of')")
    assert page.page.input_value("input[type=search]") == "clip03"


def test_a_run_that_a_person_stops_is_not_called_a_failure(page, graph):
    page.page.click("text=↻ materialize")
    page.page.wait_for_selector("#run >> text=0 of 1 clips")
    page.page.click("#run button >> text=stop")
    page.page.wait_for_selector("#message >> text=the run was stopped")
    page.page.wait_for_selector("#run[data-status='stopped'] >> text=the run was stopped")
    assert page.page.is_hidden("#run button >> text=stop")
    graph.unlink()
    page.page.click("text=↻ materialize")
    page.page.wait_for_selector("#run[data-status='done']")
    assert page.complaints == []


def test_the_page_of_another_robot_names_and_links_its_own_assets(root, folder):
    shutil.copytree(root / "robots/k1", folder / "robots/k1", ignore=shutil.ignore_patterns("policies"))
    shutil.rmtree(folder / "data/store")
    with served(folder, robot="k1") as server, browser(server.url) as page:
        page.page.wait_for_selector("text=dagster asset materialize --select k1/expert_db")
        page.until("document.querySelector('#dagster').href.endsWith('/assets/k1/expert_db')")
        assert page.complaints == []


def test_numbers_of_frames_are_shown_with_all_their_digits(folder, page):
    store = Store(root=folder / "data/store")
    manifest = store.load("feasible_motions").at_hand()
    row = made.judged("many/late@12345-67891~rollout", None, start_frame=12345, stop_frame=67892, path_error_m=0.123456)
    store.save("feasible_motions", dataclasses.replace(manifest, judged=(*manifest.judged, row)))
    go(page, clip(row.clip), "summary >> text=all figures")
    page.page.click("summary >> text=all figures")
    figures = page.page.text_content("details:last-of-type")
    assert "start_frame12345" in figures and "stop_frame67892" in figures and "path_error_m0.1235" in figures


def test_a_clip_whose_length_is_unknown_has_a_dash_in_its_place(page):
    go(page, "#/?q=many", ".card")
    page.until(f"document.querySelector('.count').textContent.startsWith('{LATER} of')")
    lengths = page.page.eval_on_selector_all(".card .value", "all => all.map(each => each.textContent)")
    assert set(lengths) == {"–"}
    go(page, clip(made.KEPT), ".timeline")
    assert "3.00 s" in page.page.text_content(".page")
