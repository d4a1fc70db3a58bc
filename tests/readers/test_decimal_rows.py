"""Many numbers at once, compared with `float` for each of them."""

import numpy as np
import pytest

from pipeline.readers.text_file import parsed_rows


def words(rng: np.random.Generator, count: int) -> list[str]:
    """Decimals of every length and sign that are written out in motion files."""
    numbers = rng.normal(size=count) * 10.0 ** rng.integers(-6, 6, size=count)
    return [f"{number:.{digits}f}" for number, digits in zip(numbers, rng.integers(0, 9, size=count), strict=True)]


@pytest.mark.parametrize("rows", [1, 2, 385])
def test_decimals_are_the_bits_of_float(rows):
    text = np.array(words(np.random.default_rng(rows), 17 * rows)).reshape(rows, 17)
    values = parsed_rows([" ".join(row) for row in text], 17)
    assert values is not None
    assert values.tobytes() == text.astype(object).astype(float).tobytes()


@pytest.mark.parametrize(
    "word",
    ["0", "-0", "-0.000000", "00012.50", ".5", "-.25", "7.", "1234567890123456", "0.1234567890123456789", "1e-5", "+1"],
)
def test_every_way_of_writing_a_number_is_read(word):
    values = parsed_rows([f"1 {word}\t2 "], 3)
    assert values is not None
    assert values.tobytes() == np.array([[1.0, float(word), 2.0]]).tobytes()


def test_blank_lines_hold_no_row():
    values = parsed_rows(["", "1 2", "  ", "3 4", ""], 2)
    assert values is not None
    np.testing.assert_array_equal(values, [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize("word", ["1,5", "1.2.3", "-", ".", "--1", "1-2", "½", "1_0", "0x1"])
def test_anything_else_is_left_to_the_reader_of_words(word):
    assert parsed_rows(["1 2 3", f"1 {word} 3"], 3) is None


@pytest.mark.parametrize("row", ["1 2", "1 2 3 4", "1"])
def test_a_row_of_another_length_is_left_to_the_reader_of_words(row):
    assert parsed_rows(["1 2 3", row, "1 2 3"], 3) is None


def test_two_wrong_rows_do_not_make_up_for_each_other():
    assert parsed_rows(["1 2", "1 2 3 4"], 3) is None
