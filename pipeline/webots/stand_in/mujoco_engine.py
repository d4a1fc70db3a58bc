"""A scene in MuJoCo, with soft convex contacts; it is always available."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.webots.scene_model import Body, Primitive, SceneModel


@dataclass(frozen=True, kw_only=True)
class RootMotion:
    """Motion of the robot's root frame in the world."""

    pos_w: Float[np.ndarray, " 3"]
    quat_w: Float[np.ndarray, " 4"]
    lin_vel_w: Float[np.ndarray, " 3"]
    """Velocity of its origin [m/s]."""
    ang_vel_w: Float[np.ndarray, " 3"]


def start_poses(scene: SceneModel) -> tuple[Float[np.ndarray, "b 3"], Float[np.ndarray, "b 4"]]:
    """World positions [m] and orientations of all bodies at the start."""
    pos, quat = [], []
    for body in scene.bodies:
        if body.parent < 0:
            pos.append(body.pos)
            quat.append(body.quat)
        else:
            pos.append(pos[body.parent] + rotation.rotate(quat[body.parent], body.pos))
            quat.append(rotation.multiply(quat[body.parent], body.quat))
    return np.array(pos), np.array(quat)


class MujocoEngine:
    """The bodies of a scene as a MuJoCo model; contact softness is MuJoCo's own."""

    def __init__(self, scene: SceneModel):
        self.model = mujoco_scene(scene)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def step(self, torque: Float[np.ndarray, " h"]) -> None:
        """Advance by one basic timestep with hinge torques [N m], in the scene's order."""
        self.data.qfrc_applied[6:] = torque
        mujoco.mj_step(self.model, self.data)

    def joint_pos(self) -> Float[np.ndarray, " h"]:
        """Hinge positions [rad], zero as in the PROTO."""
        return self.data.qpos[7:].copy()

    def root(self) -> RootMotion:
        qpos, qvel = self.data.qpos, self.data.qvel
        quat_w = qpos[3:7].copy()
        return RootMotion(
            pos_w=qpos[:3].copy(),
            quat_w=quat_w,
            lin_vel_w=qvel[:3].copy(),
            ang_vel_w=rotation.rotate(quat_w, qvel[3:6].copy()),
        )


def mujoco_scene(scene: SceneModel) -> mujoco.MjModel:
    """The compiled model; `qpos` is the root, then the hinges in the scene's order."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep, spec.option.gravity = scene.timestep_ms / 1000.0, [0.0, 0.0, -scene.gravity]
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a diverged state must stay visible
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 0.05],
        friction=[scene.friction, 0.005, 0.0001],
    )
    made: list[mujoco.MjsBody] = []
    for body in scene.bodies:
        parent = spec.worldbody if body.parent < 0 else made[body.parent]
        made.append(_add_body(parent, body, scene))
    model = spec.compile()
    for index, body in enumerate(scene.bodies, start=1):
        principal, axes = np.linalg.eigh(body.moment)  # after compiling, which refuses a rotor on a small link
        axes[:, 2] *= np.linalg.det(axes)
        model.body_inertia[index], model.body_iquat[index] = principal, rotation.from_matrix(axes)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add_body(parent: mujoco.MjsBody, body: Body, scene: SceneModel) -> mujoco.MjsBody:
    made = parent.add_body(name=body.name, pos=body.pos, quat=body.quat)
    made.mass, made.ipos, made.inertia, made.explicitinertial = body.mass, body.com, np.full(3, 1.0), True
    if body.hinge is None:
        made.add_freejoint()
    else:
        hinge = body.hinge
        limits = {} if hinge.stops is None else {"range": list(hinge.stops), "limited": True}
        made.add_joint(
            name=hinge.motor,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=rotation.rotate_inverse(body.quat, hinge.axis),
            pos=rotation.rotate_inverse(body.quat, hinge.anchor - body.pos),
            ref=hinge.position,
            **limits,
        )
    for shape in body.shapes:
        bits = 1 if scene.self_collision else 0
        made.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind.upper()}"),
            size=_size(shape),
            pos=shape.pos,
            quat=shape.quat,
            friction=[scene.friction, 0.005, 0.0001],
            contype=bits,
            conaffinity=1,
        )
    return made


def _size(shape: Primitive) -> list[float]:
    """MuJoCo's half sizes, padded to three."""
    if shape.kind == "box":
        return [0.5 * each for each in shape.size]
    sizes = [shape.size[0], *(0.5 * height for height in shape.size[1:])]
    return sizes + [0.0] * (3 - len(sizes))
