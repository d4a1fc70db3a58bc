"""Which windows are taken, and what is said of the others."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.selection import LABELS, Curation, choose, idle_patterns
from tests.conftest import ROOT

CURATION = settings.read(ROOT / "data" / "curation.yaml", Curation)


def window(clip, *, skill="walk", seconds=2.0, source="a", file="a1.bvh", licence="CC0-1.0", **more):
    return {
        "clip": clip,
        "source": source,
        "file": file,
        "licence": licence,
        "skill": skill,
        "seconds": seconds,
        **more,
    }


def chosen(rows, **changes):
    result = choose(pd.DataFrame(rows), dataclasses.replace(CURATION, **changes))
    return set(result["clip"][result["taken"]]), dict(zip(result["clip"], result["why"], strict=True))


def test_the_shipped_curation_takes_every_skill():
    taken, _ = chosen([window(skill, skill=skill) for skill in LABELS])
    assert taken == set(LABELS)


def test_a_skill_that_is_not_wanted_is_left_out():
    taken, why = chosen([window("one"), window("two", skill="run")], skills=("run",))
    assert taken == {"two"}
    assert why["one"] == "skill 'walk' is not among the skills wanted"


def test_seconds_are_shared_among_sources_and_files():
    rows = [window(f"a{index}", source="a", file="a1.bvh", seconds=3.0) for index in range(6)]
    rows += [window(f"b{index}", source="b", file=f"b{index}.bvh", seconds=2.0) for index in range(3)]
    taken, why = chosen(rows, most_seconds={"walk": 10.0})
    assert taken == {"a0", "b0", "a1", "b1"}
    assert why["a2"] == "the 10 s of walk are filled by other windows (10.0 s so far)"


def test_in_a_file_long_windows_go_first_and_of_equals_the_purest():
    rows = [
        window("short", seconds=1.0, off_skill_m_s=0.0),
        window("blurred", seconds=4.0, off_skill_m_s=0.09),
        window("pure", seconds=4.0, off_skill_m_s=0.01),
    ]
    assert chosen(rows, most_seconds={"walk": 4.5})[0] == {"pure"}
    assert chosen(rows, most_seconds={"walk": 5.0})[0] == {"pure", "short"}


def test_a_bound_is_never_passed_and_each_skill_has_its_own():
    rng = np.random.default_rng(3)
    rows = [
        window(f"{skill}{index}", skill=skill, seconds=float(rng.uniform(0.8, 6.0)), file=f"{index % 4}.bvh")
        for skill in ("walk", "run", "stand")
        for index in range(30)
    ]
    table = choose(pd.DataFrame(rows), dataclasses.replace(CURATION, most_seconds={"walk": 20.0, "run": 7.0}))
    seconds = table[table["taken"]].groupby("skill")["seconds"].sum()
    assert 14.0 < seconds["walk"] <= 20.0
    assert 1.0 < seconds["run"] <= 7.0
    assert seconds["stand"] == pytest.approx(table[table["skill"] == "stand"]["seconds"].sum())


def test_a_window_of_which_too_little_was_recorded_is_not_taken():
    rows = [window("seen", recorded_share=0.9), window("guessed", recorded_share=0.3), window("untold")]
    taken, why = chosen(rows)
    assert taken == {"seen", "untold"}
    assert why["guessed"] == "30% of its frames were recorded, at least 50% are needed to tell what they show"


def test_clips_and_windows_are_excluded_by_pattern():
    rows = [window("lafan1/dance1@0-99"), window("lafan1/walk1@0-99"), window("lafan1/walk1@100-199")]
    taken, why = chosen(rows, excluded_clips=("*/dance*", "lafan1/walk1@100-*"))
    assert taken == {"lafan1/walk1@0-99"}
    assert why["lafan1/dance1@0-99"] == "the clip is excluded by '*/dance*'"


def test_a_clip_is_excluded_by_its_plain_name():
    assert chosen([window("lafan1/walk1@0-99"), window("lafan1/walk10@0-99")], excluded_clips=("lafan1/walk1",))[0] == {
        "lafan1/walk10@0-99"
    }


def test_only_allowed_licences_are_used_whatever_their_case():
    rows = [window("free", licence="cc0-1.0"), window("nc", licence="CC-BY-NC-4.0"), window("none", licence=None)]
    taken, why = chosen(rows, licences=("CC0*", "MIT*"))
    assert taken == {"free"}
    assert why["nc"] == "licence 'CC-BY-NC-4.0' is not among those allowed (CC0*, MIT*)"
    assert "licence ''" in why["none"]


def test_files_are_left_out_for_what_was_noted():
    rows = [window("one", notes="mean_skeleton,time_base"), window("two", notes=""), window("three", notes=None)]
    taken, why = chosen(rows, excluded_notes=("time_base",))
    assert taken == {"two", "three"}
    assert why["one"] == "the file has the note 'time_base'"


def test_every_objection_is_told():
    _, why = chosen([window("one", seconds=0.3)], skills=("run",), licences=("MIT",))
    assert why["one"].count(";") == 2
    assert "0.30 s is shorter than 0.5 s" in why["one"]


def test_the_order_of_the_rows_does_not_matter():
    rng = np.random.default_rng(0)
    rows = pd.DataFrame(
        [
            window(
                f"w{index}", seconds=float(rng.choice([1.0, 2.0, 3.0])), source=f"s{index % 3}", file=f"f{index % 7}"
            )
            for index in range(60)
        ]
    )
    curation = dataclasses.replace(CURATION, most_seconds={"walk": 31.0})
    straight = choose(rows, curation).set_index("clip")
    shuffled = choose(rows.sample(frac=1.0, random_state=5), curation).set_index("clip").loc[straight.index]
    assert list(straight["taken"]) == list(shuffled["taken"])
    assert list(straight["why"]) == list(shuffled["why"])
    assert straight["taken"].any() and not straight["taken"].all()


def test_no_windows_give_an_empty_choice():
    result = choose(pd.DataFrame([]), CURATION)
    assert len(result) == 0
    assert {"clip", "taken", "why"} <= set(result.columns)


def test_unknown_skills_in_the_curation_are_named():
    values = {**settings.read_yaml(ROOT / "data" / "curation.yaml"), "skills": ["walk", "moonwalk"]}
    with pytest.raises(SettingsError, match=r"'skills\[1\]' is 'moonwalk', there are: stand"):
        settings.parse(Curation, values, ROOT / "data" / "curation.yaml")


def test_patterns_that_exclude_nothing_are_told():
    rows = pd.DataFrame({"clip": ["a/walk@0-9", "b/run"]})
    curation = dataclasses.replace(CURATION, excluded_clips=("a/*", "b/run", "c/*", "a/walk", "*x*"))
    assert idle_patterns(rows, curation) == ("c/*", "*x*")
    assert idle_patterns(rows.iloc[:0], curation) == curation.excluded_clips
