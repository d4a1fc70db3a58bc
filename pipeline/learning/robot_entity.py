"""The robot as an mjlab entity: model, motors, collision shapes and default pose."""

import math
from dataclasses import dataclass

import mujoco
import torch
from mjlab.actuator import DcMotorActuator, DcMotorActuatorCfg
from mjlab.actuator.actuator import ActuatorCmd
from mjlab.entity import EntityArticulationInfoCfg, EntityCfg
from mjlab.utils.spec_config import CollisionCfg

from pipeline.learning.robot_facts import RobotFacts

GROUND, FEET = 1, 2
"""Collision bits: all shapes collide with the ground; feet also with feet and shanks."""


class LineMotor(DcMotorActuator):
    """mjlab's DC motor for position targets only, with a third of its kernel launches."""

    @staticmethod
    def control_law(params: dict[str, torch.Tensor], cmd: ActuatorCmd) -> torch.Tensor:
        """kp (target - q) - kd dq, clipped by the torque-speed line and the torque limit (n, j) [N m]."""
        limit, stall = params["force_limit"], params["saturation_effort"]
        torque = params["stiffness"] * (cmd.position_target - cmd.pos) - params["damping"] * cmd.vel
        fall = stall * cmd.vel / params["velocity_limit_motor"]
        highest = torch.clamp(stall - fall, min=-limit, max=limit)
        lowest = torch.clamp(-stall - fall, min=-limit, max=limit)
        return torch.clamp(torque, min=lowest, max=highest)


@dataclass(kw_only=True)
class LineMotorCfg(DcMotorActuatorCfg):
    """Configuration of `LineMotor`."""

    def build(self, entity, target_ids: list[int], target_names: list[str]) -> LineMotor:
        return LineMotor(self, entity, target_ids, target_names)


def robot_entity(robot: RobotFacts) -> EntityCfg:
    """The robot with motors of one type on all joints, including those that the policy does not move."""
    return EntityCfg(
        spec_fn=lambda: mujoco.MjSpec.from_string(robot.mjcf),
        init_state=EntityCfg.InitialStateCfg(
            pos=(0.0, 0.0, robot.default_root_height),
            joint_pos={
                f"^{name}$": float(q) for name, q in zip(robot.joint_names, robot.default_joint_pos, strict=True)
            },
        ),
        collisions=(_collisions(robot),),
        articulation=EntityArticulationInfoCfg(
            actuators=tuple(_motor(robot, joint) for joint in range(len(robot.joint_names)))
        ),
        sort_actuators=True,
    )


def _motor(robot: RobotFacts, joint: int) -> LineMotorCfg:
    """A joint's motor: position control clipped by its torque limit and torque-speed line."""
    no_load = float(robot.no_load_speed[joint])
    if math.isnan(no_load):  # a line that no joint reaches, so that all motors stay one batch
        no_load, stall = 1e6, 1e3 * float(robot.effort_limit[joint])
    else:
        stall = float(robot.saturation_effort[joint])
    return LineMotorCfg(
        target_names_expr=(f"^{robot.joint_names[joint]}$",),
        stiffness=float(robot.kp[joint]),
        damping=float(robot.kd[joint]),
        effort_limit=float(robot.effort_limit[joint]),
        saturation_effort=stall,
        velocity_limit=no_load,
    )


def _collisions(robot: RobotFacts) -> CollisionCfg:
    """Feet, shanks and outermost shapes collide with the ground; self-collision is of feet and shanks only."""
    feet, shanks, others = (robot.shapes[kind] for kind in ("feet", "shanks", "others"))
    named = {f"^{name}$": (FEET, GROUND | FEET) for name in feet} | {f"^{name}$": (0, GROUND | FEET) for name in shanks}
    named |= {f"^{name}$": (0, GROUND) for name in others}
    return CollisionCfg(
        geom_names_expr=tuple(named),
        contype={name: bits[0] for name, bits in named.items()},
        conaffinity={name: bits[1] for name, bits in named.items()},
        condim=3,
        priority={name: int(name.strip("^$") in feet) for name in named},
        friction=(1.0,),
    )
