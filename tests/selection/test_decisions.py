"""A person's decisions: written into the curation file and taken back, and what they leave out of the database."""

import dataclasses
import shutil
from pathlib import Path

import pandas as pd
import pytest
import yaml

from pipeline.batch import Entry, Judged, Manifest
from pipeline.errors import FileError, SettingsError
from pipeline.files import settings
from pipeline.selection import Curation, Decision, choose, without_excluded
from pipeline.selection.curation import decide, read_decisions, take_back


def decision(clip: str, verdict: str = "exclude", why: str = "the left foot slides") -> Decision:
    return Decision(clip=clip, verdict=verdict, by="Ada", why=why, day="2026-11-26")


@pytest.fixture
def curation(root, tmp_path):
    return shutil.copy2(root / "data/curation.yaml", tmp_path / "curation.yaml")


def test_a_decision_is_written_below_the_settings_and_taken_back(curation):
    before = curation.read_text()
    decide(curation, [decision("booster_lab/walk@0-300~mirror"), decision("booster_lab/run", why="too: fast # really")])
    text = curation.read_text()
    assert text.startswith(before.rstrip("\n"))
    assert [each.why for each in read_decisions(curation)] == ["the left foot slides", "too: fast # really"]
    take_back(curation, ["booster_lab/run"])
    assert [each.clip for each in read_decisions(curation)] == ["booster_lab/walk@0-300~mirror"]
    take_back(curation, ["booster_lab/walk@0-300~mirror"])
    assert curation.read_text() == before


def test_a_later_decision_takes_the_place_of_an_earlier_one(curation):
    decide(curation, [decision("a"), decision("b")])
    left = decide(curation, [decision("a", "accept")])
    assert [(each.clip, each.verdict) for each in left] == [("b", "exclude"), ("a", "accept")]


def test_a_name_with_markup_and_foreign_letters_survives(curation):
    name = "mine/<b>'\"Ünï: #1 - [x]"
    decide(curation, [decision(name)])
    assert read_decisions(curation)[0].clip == name


@pytest.mark.parametrize("text", ["Aufnahme\u00a012", "runner 🏃\u200d♀️", "می\u200cلغزد", "10\u202fcm off"])
def test_spaces_and_joiners_of_other_languages_survive(curation, text):
    decide(curation, [decision(f"mine/{text}", why=text)])
    assert (read_decisions(curation)[0].clip, read_decisions(curation)[0].why) == (f"mine/{text}", text)


@pytest.mark.parametrize("text", ["two\nlines", "two\u2028lines", "a\ttab", "\x1b[31m"])
def test_a_reason_of_several_lines_or_with_control_characters_is_refused(curation, text):
    curation.write_text(curation.read_text() + yaml.safe_dump({"decisions": [{**vars(decision("a")), "why": text}]}))
    with pytest.raises(SettingsError, match="allowed is one line of 1 to 500 letters"):
        read_decisions(curation)


def test_settings_below_the_decisions_survive(curation):
    text = curation.read_text().replace("shortest_s: 0.5           #", "# moved #")
    written = 'decisions:\n- {clip: x, verdict: accept, by: A, why: b, day: "2026-01-02"}\n'
    curation.write_text(f"{text}{written}shortest_s: 0.7\n")
    decide(curation, [decision("y")])
    assert settings.read(curation, Curation).shortest_s == 0.7
    assert [each.clip for each in read_decisions(curation)] == ["x", "y"]


def test_more_decisions_than_can_be_read_again_are_refused(curation):
    decide(curation, [decision("a")])
    before = curation.read_text()
    many = [decision(f"mine/walk@0-99~rollout{count}", why="w" * 400) for count in range(2500)]
    with pytest.raises(SettingsError, match="with 2501 decisions the file would be larger than 1000000"):
        decide(curation, many)
    assert curation.read_text() == before


def test_a_form_that_can_not_be_replaced_changes_nothing(curation):
    curation.write_text(curation.read_text() + '"decisions": []\n')
    before = curation.read_text()
    with pytest.raises(SettingsError, match="Move 'decisions:' to the end of the file"):
        decide(curation, [decision("y")])
    assert curation.read_text() == before


def test_taking_back_what_was_never_decided_is_an_error(curation):
    with pytest.raises(FileError, match="there is no decision on 'nobody'"):
        take_back(curation, ["nobody"])


@pytest.mark.parametrize("field", ["by", "why", "clip"])
def test_a_decision_without_name_or_reason_is_refused(field):
    with pytest.raises(SettingsError, match=f"'{field}' is ' ', allowed is one line"):
        settings.parse(Decision, {**dataclasses.asdict(decision("x")), field: " "}, Path("curation.yaml"))


def test_an_excluded_recording_or_window_is_not_selected(root):
    rows = pd.DataFrame(
        [
            {"clip": clip, "source": "a", "file": "f", "licence": "CC0", "skill": "walk", "seconds": 2.0}
            for clip in ("a/walk@0-99", "a/walk@100-199", "a/run@0-99", "a/keep@0-99")
        ]
    )
    shipped = settings.read(root / "data/curation.yaml", Curation)
    decisions = (decision("a/walk@0-99"), decision("a/run"), decision("a/keep", "accept"))
    result = choose(rows, dataclasses.replace(shipped, decisions=decisions)).set_index("clip")
    assert set(result.index[result["taken"]]) == {"a/walk@100-199", "a/keep@0-99"}
    assert result.loc["a/run@0-99", "why"] == "excluded by Ada on 2026-11-26: the left foot slides"


def test_an_excluded_variant_leaves_with_its_reason_and_its_pieces():
    names = ("whole", "cut+0", "cut+1", "other")
    entries = tuple(Entry(clip=name, blob="0" * 64, numbers={"seconds": 1.0}) for name in names)
    judged = tuple(
        Judged(clip=clip, pieces=pieces, reasons=(), numbers={"seconds_in": 2.0, "seconds_out": float(len(pieces))})
        for clip, pieces in (("whole", ("whole",)), ("cut", ("cut+0", "cut+1")), ("other", ("other",)))
    )
    manifest = Manifest(stage="feasible_motions", entries=entries, judged=judged)
    left = without_excluded(manifest, (decision("cut"), decision("whole"), decision("other", "accept")))
    assert [entry.clip for entry in left.entries] == ["other"]
    rows = {row.clip: row for row in left.judged}
    assert rows["cut"].fate == rows["whole"].fate == "rejected"
    assert [reason["code"] for reason in rows["cut"].reasons] == ["excluded_by_person"] * 2
    assert rows["cut"].numbers["seconds_out"] == 0.0
    assert without_excluded(manifest, (decision("cut+1"),)).entries[1].clip == "cut+0"
