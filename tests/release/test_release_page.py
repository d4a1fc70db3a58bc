"""The page says what was found, never more: what was not run is not passed, texts are escaped, bytes repeat."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import pytest

from pipeline.release.dossier import Dossier, Origin, Picture, Status, Table, Verdict, tables_of, verdict_of
from pipeline.release.page import page, style_source

POLICY = "a" * 64
PNG = b"\x89PNG\r\n\x1a\nnot really"


def result(**changes):
    return {"stage": "mujoco_validation", "passed": True, "policy": POLICY, "reasons": [], **changes}


def dossier(*verdicts, **changes):
    values = {
        "title": "Release report: walk on t1",
        "policy": POLICY,
        "card": (("name", "walk"), ("run", "run7")),
        "lineage": (Origin(asset="expert_db", version="d1", facts=(("clips", "152"),)),),
        "verdicts": verdicts,
        "pictures": (Picture(caption="2.0 m/s", data=PNG),),
        "conditions": ("Any use.",),
    }
    return Dossier(**{**values, **changes})


class Reader(HTMLParser):
    """Checks that every tag is closed in order, and gathers texts, tags and what is loaded."""

    def __init__(self, text):
        super().__init__()
        self.open, self.texts, self.tags, self.loaded = [], [], [], []
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.loaded += [value for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def said(text):
    return re.sub(r"\s+", " ", " ".join(Reader(text).texts))


def test_a_check_that_passed_on_this_policy_has_passed():
    found = verdict_of("MuJoCo", result(), POLICY)
    assert (found.status, found.reasons) == (Status.PASSED, ())
    assert dossier(found).open_points == ()
    assert "Every check was run and passed (1 passed)" in said(
        page(dossier(found)).replace("<b>", "").replace("</b>", "")
    )


@pytest.mark.parametrize(
    ("stored", "outdated", "status", "why"),
    [
        (None, "", Status.NOT_RUN, "never run"),
        (result(passed=None, not_run="webots not found"), "", Status.NOT_RUN, "webots not found"),
        ({"stage": "x"}, "", Status.NOT_RUN, ""),
        (result(passed="yes"), "", Status.FAILED, ""),
        (result(passed=1), "", Status.FAILED, ""),
        (result(passed=False, reasons=["vx 2.0: fell"]), "", Status.FAILED, "vx 2.0: fell"),
        (result(policy="b" * 64), "", Status.OUTDATED, "the policy bbbbbbbbbbbb, not aaaaaaaaaaaa"),
        (result(policy=None), "", Status.OUTDATED, "names no policy"),
        (result(), "its code changed", Status.OUTDATED, "its code changed"),
        (result(passed=False), "its code changed", Status.OUTDATED, "it failed when it was run"),
        (result(passed=None, policy="b" * 64), "stale", Status.NOT_RUN, ""),
        (result(passed=None, policy="b" * 64, failed_to_run=["crashed"]), "", Status.OUTDATED, "the policy bbbb"),
        (result(passed=None, failed_to_run=["crashed"]), "its code changed", Status.OUTDATED, "its code changed"),
    ],
)
def test_nothing_else_has_passed(stored, outdated, status, why):
    found = verdict_of("check", stored, POLICY, outdated)
    assert found.status is status
    assert why in "; ".join(found.reasons)
    text = said(page(dossier(found)))
    assert "Not ready to sign:" in text
    assert "Every check was run and passed" not in text
    assert f"check: {status.value}" in text


def test_a_part_that_was_not_run_keeps_the_page_from_being_ready():
    found = verdict_of("limit cycles", result(**{"not run": ["no hardware log walks at 0.6 m/s"]}), POLICY)
    assert found.status is Status.PASSED
    assert dossier(found).open_points == ("limit cycles: not run: no hardware log walks at 0.6 m/s",)
    text = page(dossier(found))
    assert "Not ready to sign" in text
    section = said(text).split("What was not run")[1]
    assert "no hardware log walks at 0.6 m/s" in section


def test_what_failed_to_run_is_neither_failed_nor_missing_and_keeps_the_page_from_being_ready():
    broken = "failed to run: timed out, it was terminated after 120 s"
    found = verdict_of("webots", result(passed=None, failed_to_run=[broken]), POLICY)
    assert (found.status, found.failed_to_run, found.not_run) == (Status.FAILED_TO_RUN, (broken,), ())
    assert dossier(found).open_points == (f"webots: {broken}",)
    text = said(page(dossier(found)))
    assert "Not ready to sign: 1 failed to run." in text
    assert broken in text.split("What failed to run")[1].split("What was not run")[0]
    assert broken not in text.split("What was not run")[1]
    beside = verdict_of("webots", result(failed_to_run=["mujoco stand-in: failed to run: crashed"]), POLICY)
    assert beside.status is Status.PASSED
    assert dossier(beside).open_points == ("webots: mujoco stand-in: failed to run: crashed",)


def test_without_checks_or_policy_it_is_not_ready():
    assert dossier().open_points == ("nothing was checked",)
    assert dossier(verdict_of("MuJoCo", result(), POLICY), policy="").open_points == ("there is no policy",)


def test_reasons_come_in_any_form_and_all_of_them():
    spared = {"vx +0.3": "t1_walk stands", "vy 0.3": ["stands", "falls"]}
    found = verdict_of(
        "MuJoCo", result(passed=False, reasons=["one", "two"], not_required=spared, suite="full"), POLICY
    )
    assert found.reasons == ("one", "two")
    assert found.not_required == ("vx +0.3: t1_walk stands", "vy 0.3: stands; falls")
    assert found.facts == (("suite", "full"),)
    text = said(page(dossier(found)))
    for each in ("one", "two", "vx +0.3: t1_walk stands", "full"):
        assert each in text


def test_every_text_is_escaped():
    bad = "<script>alert('x')</script> & \"quoted\""
    found = Verdict(
        name=bad,
        status=Status.FAILED,
        reasons=(bad,),
        not_required=(bad,),
        not_run=(bad,),
        facts=((bad, bad),),
        headline=bad,
        tables=(Table(title=bad, header=(bad,), rows=((bad,),)),),
        pictures=(Picture(caption=bad, data=PNG),),
    )
    origin = Origin(asset=bad, version=bad, remark=bad, facts=((bad, bad),))
    rows = {
        "card": ((bad, bad),),
        "lineage": (origin,),
        "conditions": (bad,),
        "title": bad,
        "policy": bad,
    }
    text = page(dossier(found, **rows))
    tags = set(Reader(text).tags)
    assert "script" not in tags
    assert "alert('x')" not in re.sub(r"&lt;script&gt;.*?&lt;/script&gt;", "", text)


def test_the_page_needs_nothing_else():
    moving = Picture(caption="walk", data=b"GIF89a", kind="gif")
    found = verdict_of("MuJoCo", result(), POLICY, pictures=[moving])
    loaded = Reader(page(dossier(found))).loaded
    assert loaded == [
        f"data:image/gif;base64,{base64.b64encode(b'GIF89a').decode()}",
        f"data:image/png;base64,{base64.b64encode(PNG).decode()}",
    ]


def test_the_same_dossier_gives_the_same_bytes_and_a_change_another_digest():
    one, two = verdict_of("MuJoCo", result(), POLICY), verdict_of("MuJoCo", result(suite="quick"), POLICY)
    assert page(dossier(one)) == page(dossier(one))
    digests = [re.findall(r"<td>([0-9a-f]{64})</td>", page(dossier(each)))[-1] for each in (one, two)]
    assert digests[0] != digests[1]


def test_there_is_room_for_a_signature_and_what_is_signed():
    text = said(page(dossier(verdict_of("MuJoCo", result(), POLICY))))
    for each in ("Signature", "Name", "Date", POLICY, "I have read what failed and what was not run"):
        assert each in text


def test_a_picture_of_another_kind_is_refused():
    with pytest.raises(ValueError, match=r"'svg'; kinds are: png, gif"):
        page(dossier(pictures=(Picture(caption="x", data=b"<svg>", kind="svg"),)))


CELLS = [
    {
        "cell": "vx +2.0",
        "verdict": "failed",
        "trials": 8,
        "fell": [1, 4],
        "figures": {"falls": 2, "power": 412.345678},
        "bars": {"falls": {"asked": "at most 0", "source": "t1_walk"}},
    },
    {
        "cell": "vx +0.6",
        "verdict": "passed",
        "trials": 8,
        "fell": [],
        "figures": {"falls": 0, "power": None},
        "bars": {},
    },
]


def test_a_check_shows_each_figure_with_its_unit_and_bar_not_a_bare_word():
    found = verdict_of("mujoco_validation", result(passed=False, cells=CELLS), POLICY)
    assert found.headline == "2 cells: 1 failed, 1 passed"
    (table,) = found.tables
    assert table.header == ("cell", "verdict", "trials", "falls", "figure", "value", "unit", "bar")
    assert table.rows[0] == ("vx +2.0", "failed", "8", "2", "falls", "2", "trials", "at most 0")
    assert table.rows[1][4:] == ("power", "412.3", "W", "–")
    assert table.rows[3][5] == "–"
    assert table.numeric == {2, 3, 5}
    text = page(dossier(found))
    for each in ("mujoco_validation failed", "2 cells: 1 failed, 1 passed", "412.3 W", "at most 0"):
        assert each in said(text)
    assert '<span class="status failed">failed</span>' in text
    assert text.count('<td class="failed">failed</td>') == 2


def test_walks_cycles_and_segments_are_tables_too():
    walks = {"rows": [{"cell": "turn", "verdict": "passed", "engine": "mujoco", "survival": 1.0, "height_m": 0.67891}]}
    cycles = {
        "speeds": [
            {
                "speed_m_s": 0.6,
                "cycles": [{"speed_m_s": 0.6, "record": "left leg", "period_s": 0.61234}],
                "comparisons": [{"name": "left leg", "shape_distance": {"hip_knee": 0.05}, "period_ratio": 1.01}],
            }
        ]
    }
    engine = {
        "engine": "Webots",
        "status": "passed",
        "result": {"segments": [{"name": "stand", "fell": False, "x": []}]},
    }
    assert tables_of(walks)[0].rows == (("turn", "passed", "mujoco", "1", "0.6789"),)
    assert [table.title for table in tables_of(cycles)] == ["Cycles", "Comparisons of cycles"]
    assert tables_of(cycles)[1].header == ("speed m s", "name", "period ratio", "shape distance, hip knee")
    assert tables_of({"webots": engine, "stand_ins": {}})[0].rows == (("Webots", "passed", "stand", "no"),)


@pytest.mark.parametrize("strange", [{"cells": 3}, {"cells": ["x"]}, {"rows": {}}, {"speeds": [1]}, {"webots": "none"}])
def test_a_result_of_another_form_gives_no_table(strange):
    assert tables_of(strange) == ()


def test_a_check_without_figures_says_so():
    assert "Its result states no figures." in said(page(dossier(verdict_of("MuJoCo", result(), POLICY))))
    assert "states no figures" not in said(page(dossier(verdict_of("MuJoCo", result(cells=CELLS), POLICY))))


def test_facts_of_an_asset_are_listed_one_by_one():
    origin = Origin(
        asset="expert_db", version="d1", remark="stale: new code", facts=(("clips", "152"), ("hours", "0.4"))
    )
    text = page(dossier(lineage=(origin,)))
    assert "<dt>clips</dt><dd>152</dd><dt>hours</dt><dd>0.4</dd>" in text
    assert "<p>stale: new code</p>" in text


def test_its_style_sheet_is_the_one_that_a_security_policy_allows():
    text = page(dossier(verdict_of("MuJoCo", result(cells=CELLS), POLICY)))
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    assert style_source() == f"'sha256-{base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()}'"
    assert "style=" not in text, "a policy without unsafe-inline would drop it"
