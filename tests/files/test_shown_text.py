"""Text of strangers is shown as text: nothing of it becomes a tag, a link, a table or an expression."""

import html

import pytest

from pipeline.files.shown_text import cell, decodable, escaped, markdown_list

HOSTILE = [
    "<script>alert(1)</script>",
    "CC0 <iframe srcdoc='<script>fetch(1)</script>'></iframe>",
    '<img src=x onerror="alert(1)">',
    "[a link](javascript:alert(1))",
    "![picture](x)",
    "a | b | c",
    "`code` **bold** _it_ ~~gone~~ # head",
    "{alert(1)}",
    "&lt;b&gt; &#60;",
    "back\\slash",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_no_character_of_a_text_is_markup_and_it_reads_as_it_was(text):
    made = escaped(text)
    assert not set(made.replace("&#", "")) & set("<>\"'`*_[](){}|!\\~&=")
    assert html.unescape(made) == text


def test_a_text_stays_on_its_line():
    assert escaped("one\n# two\r\x00three") == "one &#35; two  three"
    assert markdown_list(["one\n- two", 3]) == "- one - two\n- 3"
    assert markdown_list([]) == "none"


def test_letters_of_all_languages_stay_as_they_are():
    assert escaped("Müller 歩く läuft.bvh") == "Müller 歩く läuft.bvh"


def test_bytes_that_are_no_text_can_be_stored():
    assert decodable("walk\udcff.bvh") == "walk\\udcff.bvh"
    assert escaped("walk\udcff").encode() == b"walk&#92;udcff"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("Left_Hip: 0.5 rad (from `t1.urdf`)", "Left_Hip: 0.5 rad (from 't1.urdf')"),
        ("\\[a](javascript:b)\n# c", "&#92;\\[a](javascript:b) # c"),
        ("<img src=x onerror=a>", "&lt;img src=x onerror=a&gt;"),
        (None, ""),
        (float("nan"), ""),
        (2.5, "2.5"),
    ],
)
def test_a_cell_is_one_line_without_markup_of_its_own(value, shown):
    assert cell(value) == shown
