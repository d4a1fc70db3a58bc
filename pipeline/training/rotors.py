"""Move rotor inertia from joint armatures to links, as in engines without armatures.

An armature only resists the joint's rotation relative to the parent. On the link, the same inertia also reacts to the
parent's rotation, so a swinging leg loads the trunk. Real robots are between both; a policy should walk with either.
"""

import mujoco
import numpy as np


def rotors_on_links(model: mujoco.MjModel, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`body_inertia`, `body_iquat` and `dof_armature` of `model` after moving a share (0 to 1) of each hinge's armature
    to its link, as inertia about the joint axis."""
    inertia, iquat, armature = model.body_inertia.copy(), model.body_iquat.copy(), model.dof_armature.copy()
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE):
        body, dof, axis = model.jnt_bodyid[joint], model.jnt_dofadr[joint], model.jnt_axis[joint]
        turn, quat = np.zeros(9), np.zeros(4)
        mujoco.mju_quat2Mat(turn, iquat[body])
        turn = turn.reshape(3, 3)
        moment = turn @ np.diag(inertia[body]) @ turn.T + share * armature[dof] * np.outer(axis, axis)
        principal, axes = np.linalg.eigh(moment)
        axes[:, 2] *= np.linalg.det(axes)
        mujoco.mju_mat2Quat(quat, axes.flatten())
        inertia[body], iquat[body] = principal, quat
        armature[dof] *= 1.0 - share
    return inertia, iquat, armature
