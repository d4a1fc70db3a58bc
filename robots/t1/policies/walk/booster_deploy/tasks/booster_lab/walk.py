"""Numbers of an exported policy, written by Booster Lab; golden vectors lie beside the export."""

from pathlib import Path

from booster_deploy.controllers.controller_cfg import ControllerCfg, MujocoControllerCfg, VelocityCommandCfg
from booster_deploy.robots.booster import T1_23DOF_CFG
from booster_deploy.utils.isaaclab.configclass import configclass
from tasks.locomotion.locomotion import LocomotionPolicyCfg

JOINTS = {
    "AAHead_yaw": (0.0, 10.0, 1.0),
    "Head_pitch": (0.0, 10.0, 1.0),
    "Left_Shoulder_Pitch": (0.2, 50.0, 1.0),
    "Left_Shoulder_Roll": (-1.3, 50.0, 1.0),
    "Left_Elbow_Pitch": (0.0, 50.0, 1.0),
    "Left_Elbow_Yaw": (-0.5, 50.0, 1.0),
    "Right_Shoulder_Pitch": (0.2, 50.0, 1.0),
    "Right_Shoulder_Roll": (1.3, 50.0, 1.0),
    "Right_Elbow_Pitch": (0.0, 50.0, 1.0),
    "Right_Elbow_Yaw": (0.5, 50.0, 1.0),
    "Waist": (0.0, 200.0, 5.0),
    "Left_Hip_Pitch": (-0.2, 200.0, 5.0),
    "Left_Hip_Roll": (0.0, 200.0, 5.0),
    "Left_Hip_Yaw": (0.0, 200.0, 5.0),
    "Left_Knee_Pitch": (0.4, 200.0, 5.0),
    "Left_Ankle_Pitch": (-0.2, 50.0, 1.0),
    "Left_Ankle_Roll": (0.0, 50.0, 1.0),
    "Right_Hip_Pitch": (-0.2, 200.0, 5.0),
    "Right_Hip_Roll": (0.0, 200.0, 5.0),
    "Right_Hip_Yaw": (0.0, 200.0, 5.0),
    "Right_Knee_Pitch": (0.4, 200.0, 5.0),
    "Right_Ankle_Pitch": (-0.2, 50.0, 1.0),
    "Right_Ankle_Roll": (0.0, 50.0, 1.0),
}
"""Joint -> default position [rad], stiffness [N m/rad], damping [N m s/rad]."""

POLICY_JOINTS = [
    "Left_Shoulder_Pitch",
    "Right_Shoulder_Pitch",
    "Waist",
    "Left_Shoulder_Roll",
    "Right_Shoulder_Roll",
    "Left_Hip_Pitch",
    "Right_Hip_Pitch",
    "Left_Elbow_Pitch",
    "Right_Elbow_Pitch",
    "Left_Hip_Roll",
    "Right_Hip_Roll",
    "Left_Elbow_Yaw",
    "Right_Elbow_Yaw",
    "Left_Hip_Yaw",
    "Right_Hip_Yaw",
    "Left_Knee_Pitch",
    "Right_Knee_Pitch",
    "Left_Ankle_Pitch",
    "Right_Ankle_Pitch",
    "Left_Ankle_Roll",
    "Right_Ankle_Roll",
]
"""The joints that the network reads and moves, in its order."""

strange = sorted(set(JOINTS) ^ set(T1_23DOF_CFG.joint_names))
if strange:
    raise ValueError(f"joints of the policy are not those of T1_23DOF_CFG: {strange}")


@configclass
class BoosterLabWalkControllerCfg(ControllerCfg):
    """Walks, runs and turns by a velocity command."""

    policy_dt: float = 0.02
    robot = T1_23DOF_CFG.replace(
        default_joint_pos=[JOINTS[name][0] for name in T1_23DOF_CFG.joint_names],
        joint_stiffness=[JOINTS[name][1] for name in T1_23DOF_CFG.joint_names],
        joint_damping=[JOINTS[name][2] for name in T1_23DOF_CFG.joint_names],
    )
    vel_command: VelocityCommandCfg = VelocityCommandCfg(vx_max=1.0, vy_max=0.6, vyaw_max=1.0)
    policy: LocomotionPolicyCfg = LocomotionPolicyCfg(
        checkpoint_path=str(Path(__file__).resolve().parent / "models/policy.pt"),
        actor_obs_history_length=10,
        action_scale=0.25,
        obs_dof_vel_scale=1.0,
        policy_joint_names=POLICY_JOINTS,
    )
    mujoco: MujocoControllerCfg = MujocoControllerCfg(init_pos=[0.0, 0.0, 0.68])
