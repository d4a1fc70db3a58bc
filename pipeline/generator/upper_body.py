"""Trunk, head and arms: the chest counter-rotates, each arm swings with the opposite leg, the head is steady."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.generator import gait
from pipeline.generator.command import Commands, Recipe
from pipeline.generator.footsteps import Stride

X, Y, Z = np.eye(3)

CHEST_TURN = 0.8
"""Turn of the chest against the pelvis' turn [-]: the thorax turns the other way by 3 to 5 degrees
(Stokes et al. 1989)."""
ABDUCTION = np.deg2rad(14.0)
"""Upper arms away from the body [rad]; people: 5 to 10, a little more keeps a robot's arms free."""


def move_trunk(
    recipe: Recipe, commands: Commands, stride: Stride, pelvis_w: Float[np.ndarray, "n 4"]
) -> dict[str, Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of `Spine`, `Chest`, `Neck`, `Head`."""
    turn = gait.pelvis_turn(commands.forward) * stride.activity * stride.wave()
    listing = gait.pelvis_list(recipe.gait, commands.forward) * stride.activity * stride.wave(from_midstance=True)
    lean = gait.trunk_lean(recipe.gait, commands.forward)
    spine = _upright(commands.heading, 0.0 * turn, 0.3 * listing, 0.7 * lean)
    chest = _upright(commands.heading, CHEST_TURN * turn, -0.2 * listing, lean)
    neck = _upright(commands.heading, 0.4 * turn, 0.0 * listing, 0.7 * lean)
    head = _upright(commands.heading, 0.0 * turn, 0.0 * listing, 0.4 * lean)
    return {"Hips": pelvis_w, "Spine": spine, "Chest": chest, "Neck": neck, "Head": head}


def _upright(heading: np.ndarray, turn: np.ndarray, listing: np.ndarray, lean: np.ndarray) -> np.ndarray:
    quat = rotation.about_z(heading + turn)
    quat = rotation.multiply(quat, rotation.from_axis_angle(X, listing))
    return rotation.multiply(quat, rotation.from_axis_angle(Y, lean))


def move_arm(
    recipe: Recipe, commands: Commands, stride: Stride, chest_w: Float[np.ndarray, "n 4"], side: int
) -> tuple[Float[np.ndarray, "n 4"], Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of upper arm and forearm, canonical (a hanging arm is upright), of side 0 (left) or 1.

    The left arm is furthest back as the left foot lands. Upper arm: abduction, swing, then a turn inwards.
    """
    sign = 1.0 if side == 0 else -1.0
    rng = np.random.default_rng([recipe.seed, 2, side])
    scale, rest = rng.uniform(0.95, 1.05), np.deg2rad(rng.uniform(-1.5, 1.5))
    swing = -sign * stride.wave() * stride.activity
    running = recipe.gait == gait.RUN
    middle = np.deg2rad(-14.0) if running else np.deg2rad(2.0)
    flexion = middle + rest + scale * gait.arm_swing(recipe.gait, commands.forward) * swing
    mean_bend = gait.elbow_flexion(recipe.gait, commands.forward)
    bend = mean_bend + 0.35 * gait.arm_swing(recipe.gait, commands.forward) * swing
    inward = np.deg2rad(10.0 if running else 6.0)
    upper = rotation.multiply(chest_w, rotation.from_axis_angle(X, sign * ABDUCTION))
    upper = rotation.multiply(upper, rotation.from_axis_angle(Y, -flexion))
    upper = rotation.multiply(upper, rotation.from_axis_angle(Z, -sign * inward))
    return upper, rotation.multiply(upper, rotation.from_axis_angle(Y, -bend))
