"""Rotation maths against scipy's Rotation, finite differences and its own inverses."""

import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline import rotation


def random_quats(count: int, seed: int = 0) -> np.ndarray:
    return np.roll(Rotation.random(count, random_state=seed).as_quat(), 1, axis=1)


def as_scipy(quat: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quat, -1, axis=-1))


def test_product_rotates_like_scipys():
    a, b = random_quats(50, 1), random_quats(50, 2)
    expected = (as_scipy(a) * as_scipy(b)).as_matrix()
    np.testing.assert_allclose(rotation.to_matrix(rotation.multiply(a, b)), expected, atol=1e-12)


@pytest.mark.parametrize("axes", ["x", "zx", "zyx", "xyz", "yzx", "zxz"])
def test_euler_turns_are_scipys_intrinsic_ones_and_the_bits_of_their_product(axes):
    angles = np.random.default_rng(len(axes)).uniform(-7.0, 7.0, size=(50, len(axes)))
    turns = [("xyz".index(axis), angles[:, place]) for place, axis in enumerate(axes)]
    quat = rotation.from_euler(turns)
    np.testing.assert_allclose(
        rotation.to_matrix(quat), Rotation.from_euler(axes.upper(), angles).as_matrix(), atol=1e-12
    )
    product = functools.reduce(rotation.multiply, (rotation.from_axis_angle(np.eye(3)[a], angle) for a, angle in turns))
    np.testing.assert_array_equal(quat, product)


def test_rotating_vectors_is_the_matrix_product():
    quat, vectors = random_quats(50), np.random.default_rng(0).normal(size=(50, 3))
    np.testing.assert_allclose(rotation.rotate(quat, vectors), as_scipy(quat).apply(vectors), atol=1e-12)
    np.testing.assert_allclose(rotation.rotate_inverse(quat, rotation.rotate(quat, vectors)), vectors, atol=1e-12)


def test_matrix_and_rotation_vector_round_trips_up_to_sign():
    quat = random_quats(50)
    assert rotation.angle_between(rotation.from_matrix(rotation.to_matrix(quat)), quat).max() < 1e-7
    assert rotation.angle_between(rotation.from_rotvec(rotation.to_rotvec(quat)), quat).max() < 1e-7


def test_rotation_vector_of_nearly_nothing_is_twice_the_vector_part():
    quat = rotation.normalize(np.array([[1.0, 1e-14, 0.0, -2e-14]]))
    np.testing.assert_allclose(rotation.to_rotvec(quat), [[2e-14, 0.0, -4e-14]], atol=1e-20)


def test_angle_between_q_and_minus_q_is_zero():
    quat = random_quats(20)
    assert rotation.angle_between(quat, -quat).max() < 1e-7


def test_yaw_is_recovered_below_any_tilt_about_a_horizontal_axis():
    yaw = np.linspace(-3.1, 3.1, 41)
    tilt = rotation.from_axis_angle(np.array([0.6, 0.8, 0.0]), 0.7)
    np.testing.assert_allclose(rotation.yaw_of(rotation.multiply(rotation.about_z(yaw), tilt)), yaw, atol=1e-12)


def test_wrap_stays_in_the_half_open_interval():
    np.testing.assert_allclose(
        rotation.wrap(np.array([np.pi, -np.pi, 3 * np.pi, 0.5 - 4 * np.pi])), [np.pi] * 3 + [0.5]
    )


def test_slerp_meets_both_ends_and_halves_the_angle():
    a, b = random_quats(30, 3), random_quats(30, 4)
    assert rotation.angle_between(rotation.slerp(a, b, 0.0), a).max() < 1e-7
    assert rotation.angle_between(rotation.slerp(a, b, 1.0), b).max() < 1e-7
    half = rotation.slerp(a, b, 0.5)
    np.testing.assert_allclose(rotation.angle_between(a, half), rotation.angle_between(a, b) / 2.0, atol=1e-7)


def test_sign_flips_are_undone():
    quat = rotation.about_z(np.linspace(0.0, 6.0, 100))
    flipped = quat * np.where(np.random.default_rng(5).random(100) < 0.5, -1.0, 1.0)[:, None]
    continuous = rotation.make_continuous(flipped)
    assert np.all(np.sum(continuous[1:] * continuous[:-1], axis=1) > 0.9)


def test_angular_velocity_of_a_constant_turn_about_a_tilted_axis():
    axis, speed, fps = np.array([0.0, 0.6, 0.8]), 2.5, 100.0
    quat = rotation.multiply(rotation.from_axis_angle(axis, speed * np.arange(60) / fps), random_quats(1)[0])
    np.testing.assert_allclose(rotation.angular_velocity_w(quat, fps), np.tile(speed * axis, (60, 1)), atol=1e-9)
