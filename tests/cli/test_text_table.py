"""Aligned text."""

from pipeline.cli.text_table import name_values, text_table


def test_numbers_stand_to_the_right_and_words_to_the_left():
    table = text_table(["clip", "seconds", "why"], [["walk", 1.5, "nothing"], ["a run", 12.25, "too, short"]])
    assert table.splitlines() == [
        "clip   seconds  why",
        "walk      1.50  nothing",
        "a run    12.25  too, short",
    ]


def test_what_is_not_known_is_a_dash_and_zero_has_no_sign():
    assert text_table(["a", "b"], [[None, -0.0001]]).splitlines()[1] == "-  0.00"


def test_a_table_without_rows_is_its_header():
    assert text_table(["a", "b"], [], indent="  ") == "  a  b"


def test_names_and_values_stand_in_two_columns():
    assert name_values({"unit": "cm", "true rate": None}) == "unit       cm\ntrue rate  -"
