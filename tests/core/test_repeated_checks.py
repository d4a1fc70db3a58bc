"""A call is checked for shapes and types unless its outcome is known from an earlier one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from beartype import beartype
from jaxtyping import Float

from pipeline import rotation
from tests.factories.repeated_checks import _jaxtyped_once


@pytest.fixture
def checks():
    """How often jaxtyping checked the arguments of `checked` functions."""
    counts = []

    def counting(function):
        made = beartype(function)

        def counted(*args, **kwargs):
            counts.append(function.__name__)
            return made(*args, **kwargs)

        return counted

    return counts, counting


def doubled(values: Float[np.ndarray, "n 3"], how: str = "") -> Float[np.ndarray, "n 3"]:
    return values[:, :2] if how == "cut" else 2.0 * values


def test_a_call_like_one_that_passed_is_not_checked_again(checks):
    counts, counting = checks
    function = _jaxtyped_once(doubled, typechecker=counting)
    for _ in range(5):
        assert (function(np.ones((4, 3))) == 2.0).all()
    assert len(counts) == 2, "arguments once, and with the result once"
    function(np.ones((5, 3)))
    function(values=np.ones((5, 3)))
    assert len(counts) == 6


@pytest.mark.parametrize("wrong", [np.ones((4, 2)), np.ones(3), np.ones((4, 3), dtype=int), [[1.0, 2.0, 3.0]], None])
def test_wrong_arguments_are_refused_whatever_passed_before(wrong):
    function = _jaxtyped_once(doubled, typechecker=beartype)
    function(np.ones((4, 3)))
    for _ in range(2):
        with pytest.raises(Exception, match=r"checking the parameters of .*doubled"):
            function(wrong)


def test_a_wrong_result_is_refused_though_its_arguments_passed_before():
    results = [np.ones((4, 3)), np.ones((4, 3)), np.ones((5, 3)), np.ones((4, 3))]

    def next_of(values: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        return results.pop(0)

    function = _jaxtyped_once(next_of, typechecker=beartype)
    values = np.ones((4, 3))
    function(values)
    function(values)
    with pytest.raises(Exception, match=r"checking the return value of .*next_of"):
        function(values)
    assert function(values).shape == (4, 3)


def test_items_of_containers_are_checked_each_time():
    def named(names: list[str]) -> int:
        return len(names)

    function = _jaxtyped_once(named, typechecker=beartype)
    assert function(["a"]) == 1
    with pytest.raises(Exception, match=r"checking the parameters of .*named"):
        function([1])


def test_fields_of_a_data_class_are_checked():
    @dataclass(frozen=True)
    class Clip:
        frames: Float[np.ndarray, "n 3"]

    made = _jaxtyped_once(Clip, typechecker=beartype)
    made(np.ones((4, 3)))
    with pytest.raises(Exception, match=r"checking the parameters of .*__init__"):
        made(np.ones((4, 2)))


def test_the_functions_of_the_pipeline_are_checked():
    rotation.multiply(np.ones((2, 4)), np.ones((2, 4)))
    for _ in range(2):
        with pytest.raises(Exception, match=r"checking the parameters of .*multiply"):
            rotation.multiply(np.ones((2, 3)), np.ones((2, 4)))
