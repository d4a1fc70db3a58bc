"""Text of files in the dataset card stays text: no link, picture or second YAML head."""

import pandas as pd
import pytest
import yaml

from pipeline.expert.dataset_card import dataset_card
from pipeline.expert.read import Contents


def card(licence: str, credit: str = "") -> str:
    """The card of a database of one clip."""
    manifest = {
        "robot": "t1",
        "clips": 1,
        "seconds": 2.0,
        "frame_duration_s": 0.02,
        "frame_columns": 50,
        "schema": "s",
        "robot_digest": "0" * 64,
        "licence": {"licences": {licence: "unknown"}, "strictest": licence, "allowed_use": "ask"},
        "stages": {},
    }
    row = {"source": "mine", "licence": licence, "credit": credit, "skill": "walk", "seconds": 2.0}
    return dataset_card(Contents(manifest=manifest, index=pd.DataFrame([row])))


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
