"""Text of files in the dataset card stays text: no link, picture or second YAML head."""

import json

import pandas as pd
import pytest
import yaml

from pipeline.expert.dataset_card import dataset_card

HEAD = {
    "robot": "t1",
    "frame_duration_s": 0.02,
    "frame_columns": 50,
    "schema": "s",
    "robot_digest": "0" * 64,
    "stages": {},
}


def card(licence: str, credit: str = "") -> str:
    """The card of a database of one clip."""
    row = {"source": "mine", "licence": licence, "credit": credit, "skill": "walk", "seconds": 2.0}
    return dataset_card(HEAD, pd.DataFrame([row]))


@pytest.mark.parametrize(
    ("credit", "shown"),
    [
        ("![x](http://a)", "!\\[x](http://a)"),
        ("\\[c](javascript:a)", "&#92;\\[c](javascript:a)"),
        ("<img src=x onerror=a>", "&lt;img src=x onerror=a&gt;"),
        ("a | b\nc", "a \\| b c"),
    ],
)
def test_a_credit_has_no_markup_of_its_own(credit, shown):
    assert f"| mine | CC0-1.0 | {shown} |" in card("CC0-1.0", credit)


@pytest.mark.parametrize(
    ("licence", "tag"),
    [("CC0-1.0", "cc0-1.0"), ("mit\n---\n# title", "other"), ("MIT: [a]", "other"), ("x" * 61, "other")],
)
def test_only_a_word_is_the_tag_of_the_head(licence, tag):
    text = card(licence)
    assert yaml.safe_load(text.split("---")[1]) == {"license": tag, "tags": ["robotics", "motion", "humanoid", "t1"]}
    assert "\n# title" not in text


def test_stages_are_named_in_the_order_in_which_clips_went_through_them():
    def stages(*names):
        done = [{"stage": name, "version": name[:1] * 20, "settings": "5" * 64, "reasons": []} for name in names]
        return json.dumps({"stages": done})

    row = {"licence": "CC0-1.0", "skill": "walk", "seconds": 1.0, "credit": None, "source": "mine", "variant": None}
    texts = [stages("repaired", "feasible"), stages("repaired", "augmented", "feasible"), None]
    text = dataset_card(HEAD, pd.DataFrame([{**row, "stages": each} for each in texts]))
    table = text.split("## How it was made")[1].split("Schema")[0]
    assert [line.split("|")[1].strip() for line in table.splitlines() if line.startswith("| ")][2:] == [
        *("repaired", "feasible", "augmented")
    ]
    assert f"| augmented |  | {'a' * 12} | {'5' * 12} |" in table
    assert "variant" not in text


def test_more_sources_than_a_page_holds_are_summed_up():
    row = {"licence": "CC0-1.0", "skill": "walk", "seconds": 1.0, "credit": ""}
    text = dataset_card(HEAD, pd.DataFrame([{**row, "source": f"source {number:03d}"} for number in range(205)]))
    assert "| source 199 |" in text and "| source 200 |" not in text and "| and 5 more |" in text
