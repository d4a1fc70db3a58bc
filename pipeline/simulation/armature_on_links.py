"""The rotors' inertia on the links that they move, for engines that know no armature.

An armature acts on the joint's speed alone. On the child link the same inertia about the joint axis acts on the link's
whole turning in space, which also counts how the parent turns: an approximation, good where parents turn slowly. The
same approximation in MuJoCo is the bridge of a comparison: what differs between MuJoCo and the bridge is this
approximation, what differs between the bridge and another engine is contact and solver.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant


def added_moments(robot: Robot) -> dict[str, Float[np.ndarray, "3 3"]]:
    """Of each link that hangs on a joint: armature times axis axis^T [kg m^2], in the axes of the link frame.

    It is no moment of a body (it turns about one axis only), and the sum of a small link and its rotor need not be one
    either: engines take it, MuJoCo's compiler does not.
    """
    tree = robot.tree
    return {
        name: float(robot.armature[tree.joint[link]]) * np.outer(tree.axis[link], tree.axis[link])
        for link, name in enumerate(robot.link_names)
        if link
    }


def put_armature_on_links(model: mujoco.MjModel, robot: Robot) -> None:
    """Change a compiled MuJoCo model of the robot: joints without armature, its inertia on the links."""
    for name, moment in added_moments(robot).items():
        body = model.body(name)
        turn = rotation.to_matrix(np.array(body.iquat))
        principal, axes = np.linalg.eigh(turn @ np.diag(body.inertia) @ turn.T + moment)
        axes[:, 2] *= np.linalg.det(axes)
        body.inertia[:], body.iquat[:] = principal, rotation.from_matrix(axes)
    model.dof_armature[6 : 6 + len(robot.joint_names)] = 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))


def bridge_plant(robot: Robot, options: MujocoOptions) -> MujocoPlant:
    """The robot in MuJoCo, its armature on the links."""
    plant = MujocoPlant(robot, options)
    put_armature_on_links(plant.model, robot)
    plant.reset()
    return plant
