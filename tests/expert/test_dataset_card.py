"""Text of files in the dataset card stays text: no link, picture or second YAML head."""

import pytest

from pipeline.expert.dataset_card import _TAG, _cell


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("![x](http://a)", "!\\[x](http://a)"),
        ("\\[c](javascript:a)", "&#92;\\[c](javascript:a)"),
        ("<img src=x onerror=a>", "&lt;img src=x onerror=a&gt;"),
        ("a | b\nc", "a \\| b c"),
    ],
)
def test_a_cell_has_no_markup_of_its_own(text, cell):
    assert _cell(text) == cell


@pytest.mark.parametrize("licence", ["mit\n---\n# title", "MIT: [a]", "", "x" * 61])
def test_a_licence_that_is_no_word_is_no_tag(licence):
    assert _TAG.fullmatch(licence) is None
