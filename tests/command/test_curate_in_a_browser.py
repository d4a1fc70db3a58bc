"""A curator's job in a real browser: find, watch and exclude a clip, materialize, undo, approve a proposal."""

import os
import shutil

import pandas as pd
import pytest
import yaml

from tests.factories.checkout import PATIENCE_S, Checkout
from tests.factories.curation_browser import PICTURES_VARIABLE, Browser, browser, curation_server

pytestmark = pytest.mark.command

FEW = ("stand", "walk")
PICTURED = (*FEW, "back", "run_easy", "side_left", "turn_left")
"""Motions where screenshots for the docs are wanted."""
MARKUP = "<img src=x onerror=alert(1)>"
"""Name of a motion file: it must reach the page as text."""
RUN_MS = 1_000 * PATIENCE_S


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout with a database and a proposal that waits."""
    motions = PICTURED if os.environ.get(PICTURES_VARIABLE) else FEW
    made = Checkout.make(root, tmp_path_factory.mktemp("curate"), motions).with_answers_of(root)
    shutil.copy2(made.root / "data/motions/stand.bvh", made.root / f"data/motions/{MARKUP}.bvh")
    made.materialize()
    done = made.run("dagster", "asset", "materialize", "--select", "curation_feedback")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return made


@pytest.fixture(scope="module")
def page(checkout):
    with curation_server(checkout) as url, browser(url) as opened:
        opened.page.fill("#name", "Ada")
        opened.page.dispatch_event("#name", "change")
        opened.page.locator("#name").blur()
        yield opened


def go(page: Browser, where: str, ready: str) -> None:
    page.page.evaluate("where => { location.hash = where; }", where)
    page.page.wait_for_selector(ready)


def database(checkout: Checkout) -> set[str]:
    return set(pd.read_parquet(checkout.root / "data/expert_db/t1/index.parquet")["clip"])


def materialize(page: Browser) -> None:
    go(page, "#/", ".card")
    page.page.click("text=↻ materialize")
    page.page.wait_for_selector("#run[data-status='at work']")
    page.page.wait_for_selector("#run[data-status='done']", timeout=RUN_MS)


def worst_walking_clip(page: Browser) -> str:
    go(page, "#/?skill=walk", ".card")
    page.page.click("[data-figure='foot_slip_p95'] button")
    page.page.wait_for_selector("[data-figure='foot_slip_p95'].sorted")
    page.until("document.querySelectorAll('.card:not([hidden]) canvas[data-drawn]').length > 3")
    values = page.page.eval_on_selector_all(
        ".card:not([hidden])",
        "cards => cards.map(card => [card.querySelector('.name').textContent, "
        "parseFloat(card.querySelector('.value').textContent), card.style.transform])",
    )
    by_place = sorted(
        values, key=lambda each: [float(part) for part in each[2][10:-1].replace("px", "").split(",")][::-1]
    )
    slips = [slip for _, slip, _ in by_place if slip == slip]
    assert slips == sorted(slips, reverse=True) and slips[0] > slips[-1]
    return by_place[0][0]


def test_a_curator_finds_watches_and_excludes_the_worst_clip_and_takes_it_back(page, checkout):
    before, files = database(checkout), checkout.database()
    page.page.wait_for_selector(".card canvas[data-drawn]")
    go(page, "#/?sort=foot_slip_p95&descending=1", "[data-figure='foot_slip_p95'].sorted")
    page.until("document.querySelectorAll('.card:not([hidden]) canvas[data-drawn]').length > 11")
    page.picture("curate_clips")
    worst = worst_walking_clip(page)
    assert worst in {name.rpartition("+")[0] if name not in before else name for name in before} | {worst}
    page.page.click(f".card .name[title='{worst}']")
    page.page.wait_for_selector(".timeline")
    first = page.page.get_attribute(".stages canvas >> nth=-1", "data-drawn")
    page.until(f"[...document.querySelectorAll('.stages canvas')].at(-1).dataset.drawn !== '{first}'")
    assert len(page.page.query_selector_all(".stages canvas")) >= 2, "person and robot"
    assert "left foot" in page.page.get_attribute(".timeline", "aria-label")
    assert {"retargeted_motions", "augmented_motions", "feasible_motions"} <= set(
        page.page.eval_on_selector_all("td a", "links => links.map(link => link.textContent)")
    )
    page.picture("curate_clip")
    page.page.click("button.exclude")
    page.page.fill("dialog input", "its feet slide")
    page.page.click("dialog .ok")
    page.page.wait_for_selector("text=excluded by Ada")
    (decision,) = yaml.safe_load((checkout.root / "data/curation.yaml").read_text())["decisions"]
    assert (decision["clip"], decision["by"], decision["why"]) == (worst, "Ada", "its feet slide")
    materialize(page)
    gone = before - database(checkout)
    assert gone and all(name == worst or name.startswith(f"{worst}+") for name in gone)
    go(page, "#/databases", ".summary")
    page.until("document.querySelector('.summary').textContent.includes(' removed')")
    assert "excluded by Ada" in page.page.text_content(".page")
    assert worst in page.page.text_content(".page")
    page.picture("curate_databases")
    go(page, "#/decisions", "td")
    page.picture("curate_decisions")
    page.page.click("td >> text=undo")
    page.page.wait_for_selector("text=There are no decisions yet")
    materialize(page)
    assert checkout.database() == files, "taken back, byte for byte"
    assert page.complaints == []


def test_a_selected_clip_is_run_again_with_progress_and_outcome(page, checkout):
    files = checkout.database()
    go(page, "#/?skill=walk&verdict=accepted", ".card")
    page.page.click(".card:not([hidden]) input")
    page.page.click(".bar button.rerun")
    page.page.wait_for_selector("#run[data-status='at work'] >> text=/re-run of 1: .* clips/", timeout=RUN_MS)
    page.page.wait_for_selector("#run[data-status='done'] >> text=re-run of 1: 1 with the same result", timeout=RUN_MS)
    counts = checkout.recomputed()
    assert counts["repaired_motions"] == counts["retargeted_motions"] == counts["motion_variants"] == 1, counts
    assert all(1 <= count <= 2 for count in counts.values()), counts  # the window's own reference has the window's name
    assert checkout.database() == files
    assert page.complaints == []


def test_a_proposal_is_approved_with_its_evidence_declined_and_taken_back(page, checkout):
    go(page, "#/proposals", "[data-section]")
    page.picture("curate_proposals")
    assert "demo/side_left_fall" in page.page.text_content(".change")
    sections = page.page.eval_on_selector_all("[data-section]", "all => all.map(each => each.dataset.section)")
    page.page.click(f"text=approve {sections[0]}")
    page.page.wait_for_selector("h2 >> text=/^Approved$/")
    approved = yaml.safe_load((checkout.root / "data/feedback/approved.yaml").read_text())["approvals"]
    assert [(each["section"], each["by"]) for each in approved] == [(sections[0], "Ada")]
    assert approved[0]["proposal"] == page.page.text_content("p code")
    page.page.click("text=take back")
    page.page.wait_for_selector("h2 >> text=/^Approved$/", state="detached")
    assert not (checkout.root / "data/feedback/approved.yaml").exists()
    page.page.click(f"text=decline {sections[0]}")
    page.page.wait_for_selector(".change >> text=declined")
    assert (checkout.root / "data/feedback/declined.yaml").is_file()
    assert page.complaints == []


def test_filters_that_are_noted_late_do_not_take_back_a_click(page):
    """The address is written once the person pauses; a click on a clip just before wins."""
    go(page, "#/", ".card")
    page.until("document.body.dataset.shown.startsWith('clips ')")
    address = page.page.evaluate(
        """() => {
            const real = window.setTimeout, due = [];
            window.setTimeout = (work) => due.push(work);
            try {
                const search = document.querySelector("input[type=search]");
                search.value = "walk";
                search.dispatchEvent(new Event("input", { bubbles: true }));
                if (!due.length) return "nothing is noted later";
                document.querySelector(".card:not([hidden]) .name").click();
                while (due.length) due.shift()();
            } finally { window.setTimeout = real; }
            return location.hash;
        }"""
    )
    assert address.startswith("#/clip/")
    page.page.wait_for_selector(".timeline")


def test_a_link_to_a_clip_that_is_gone_shows_its_error_alone(page):
    go(page, "#/clip/gone", "#message.error >> text=there is no clip 'gone'")
    page.until("document.body.dataset.shown.startsWith('clip ')")
    assert page.page.text_content(".page") == ""
    page.complaints.clear()  # the console names the answer 404


def test_markup_in_a_name_is_shown_as_text(page):
    go(page, "#/?q=onerror", ".card")
    names = page.page.eval_on_selector_all(".card:not([hidden]) .name", "all => all.map(each => each.textContent)")
    assert names and all(MARKUP in name for name in names)
    page.page.click(".card:not([hidden]) .name")
    page.page.wait_for_selector(".timeline")
    assert MARKUP in page.page.text_content("h1")
    assert page.page.query_selector("img") is None
    assert page.complaints == []


def test_several_clips_are_chosen_and_decided_together(page, checkout):
    go(page, "#/?skill=stand", ".card")
    page.page.click("text=select all shown")
    chosen = int(page.page.text_content(".count").split(", ")[1].split()[0])
    assert chosen > 3
    page.page.click(".bar button.accept")
    page.page.fill("dialog input", "watched, sound")
    page.page.press("dialog input", "Enter")
    page.page.wait_for_selector(".card .decision.accept")
    decisions = yaml.safe_load((checkout.root / "data/curation.yaml").read_text())["decisions"]
    assert len(decisions) == chosen and {each["verdict"] for each in decisions} == {"accept"}
    go(page, "#/?decision=accept", ".card")
    assert page.page.text_content(".count").startswith(f"{chosen} of")
    page.page.click("text=select all shown")
    page.page.click("text=undo decision")
    page.until("!document.querySelector('.card:not([hidden])')")
    assert "decisions" not in yaml.safe_load((checkout.root / "data/curation.yaml").read_text())
    assert page.complaints == []


def test_a_name_is_asked_for_and_a_bad_token_changes_nothing(page, checkout):
    go(page, "#/?skill=stand", ".card")
    page.page.fill("#name", "")
    page.page.click(".card:not([hidden]) input")
    page.page.click(".bar button.accept")
    page.page.wait_for_selector("#message.error >> text=every decision is recorded with a name")
    page.page.fill("#name", "Ada")
    page.page.evaluate("localStorage.setItem('booster-lab-token', 'guessed')")
    page.page.click(".bar button.accept")
    page.page.fill("dialog input", "no")
    page.page.click("dialog .ok")
    page.page.wait_for_selector("dialog .rejected >> text=token")
    page.page.click("dialog >> text=cancel")
    assert "decisions" not in yaml.safe_load((checkout.root / "data/curation.yaml").read_text())
    assert [each for each in page.complaints if "403" not in each] == []
