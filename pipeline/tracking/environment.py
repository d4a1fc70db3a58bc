"""Training environment of the tracker: mjlab's tracking task with a bundle's robot and clips."""

from pathlib import Path

import mujoco
import numpy as np
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.managers.termination_manager import TerminationTermCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg
from mjlab.tasks.tracking import mdp
from mjlab.tasks.tracking.tracking_env_cfg import VELOCITY_RANGE, make_tracking_env_cfg

from pipeline.learning.plain_simulation import PlainSimulation
from pipeline.learning.robot_entity import robot_entity
from pipeline.learning.robot_facts import RobotFacts
from pipeline.physics import PHYSICS_S
from pipeline.tracking.bundle import Motions, TrackingBundle
from pipeline.tracking.clips_command import ClipsCommandCfg, ReferenceResidualCfg, clip_ended
from pipeline.tracking.reference import ReferenceStates, reference_states
from pipeline.tracking.task import DECIMATION, OBSERVATION, PATH_M

MOTION = "motion"
"""Name of the command term, as in mjlab's task."""

PATH_WEIGHT = 1.0
"""Weight of the reward for the root's position. With mjlab's 0.5 and without the termination at `PATH_M`, the tracker
reproduced the posture of fast, sideways and backward clips at half of their speed."""


class TrackingEnvironment(ManagerBasedRlEnv):
    """mjlab's environment; on a CPU its physics is multithreaded MuJoCo."""

    def __init__(self, cfg: ManagerBasedRlEnvCfg, device: str):
        self._plain = device == "cpu"
        super().__init__(cfg, device)

    def load_managers(self) -> None:
        """Load mjlab's managers; on a CPU, replace the physics by MuJoCo."""
        if self._plain:
            self.sim = PlainSimulation(self.sim)
        super().load_managers()


def tracking_environment(
    bundle: TrackingBundle, motion_file: Path, num_envs: int, device: str, seed: int
) -> TrackingEnvironment:
    """Create the environment of a bundle; write all clips in mjlab's motion format to `motion_file`."""
    model = mujoco.MjModel.from_xml_string(bundle.robot.mjcf)
    write_motion_file(motion_file, model, bundle.motions)
    cfg = environment_cfg(bundle.robot, bundle.motions, motion_file, num_envs, seed)
    return TrackingEnvironment(cfg, device)


def write_motion_file(path: Path, model: mujoco.MjModel, motions: Motions) -> None:
    """Write all clips in mjlab's motion format; velocities do not cross clip boundaries."""
    states: list[ReferenceStates] = []
    for start, stop in zip(motions.clip_start[:-1], motions.clip_start[1:], strict=True):
        part = slice(int(start), int(stop))
        states.append(
            reference_states(model, motions.root_pos_w[part], motions.root_quat_w[part], motions.joint_pos[part])
        )
    names = ("joint_pos", "joint_vel", "body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w")
    arrays = {name: np.concatenate([getattr(each, name) for each in states]).astype(np.float32) for name in names}
    path.parent.mkdir(parents=True, exist_ok=True)
    part_path = path.with_suffix(".part.npz")
    np.savez(part_path, fps=np.array(50.0), **arrays)  # pyright: ignore[reportArgumentType]
    part_path.replace(path)


def environment_cfg(
    robot: RobotFacts, motions: Motions, motion_file: Path, num_envs: int, seed: int
) -> ManagerBasedRlEnvCfg:
    """mjlab's tracking configuration, adapted to the robot, to many clips and to disturbed rollouts."""
    cfg = make_tracking_env_cfg()
    cfg.seed = seed
    cfg.scene.num_envs = num_envs
    cfg.scene.entities = {"robot": robot_entity(robot)}
    cfg.scene.sensors = (_self_collision(robot),)
    cfg.sim.nconmax, cfg.sim.njmax = 40, 250
    cfg.sim.mujoco.timestep, cfg.decimation = PHYSICS_S, DECIMATION
    base = cfg.commands[MOTION]
    cfg.commands = {
        MOTION: ClipsCommandCfg(
            entity_name="robot",
            resampling_time_range=base.resampling_time_range,
            pose_range=base.pose_range,
            velocity_range=base.velocity_range,
            joint_position_range=base.joint_position_range,
            motion_file=str(motion_file),
            anchor_body_name=robot.root_link,
            body_names=robot.key_links,
            clip_start=tuple(int(start) for start in motions.clip_start),
        )
    }
    cfg.actions = {"joint_pos": ReferenceResidualCfg(entity_name="robot", joint_names=robot.controlled)}
    cfg.observations = observation_cfg()
    cfg.events = _events(robot)
    model = mujoco.MjModel.from_xml_string(robot.mjcf)
    hands = tuple(model.body(int(model.site(site).bodyid[0])).name for site in robot.hands)
    cfg.terminations["ee_body_pos"].params["body_names"] = (*robot.foot_links, *hands)
    cfg.rewards["motion_global_root_pos"].weight = PATH_WEIGHT
    cfg.terminations["path"] = TerminationTermCfg(
        func=mdp.bad_anchor_pos, params={"command_name": MOTION, "threshold": PATH_M}
    )
    cfg.terminations["clip_ended"] = TerminationTermCfg(func=clip_ended, params={"command_name": MOTION}, time_out=True)
    return cfg


def observation_cfg() -> dict[str, ObservationGroupCfg]:
    """Actor and critic observe the same full state without noise; `task.OBSERVATION` gives the order."""
    command = {"command_name": MOTION}
    terms = {
        "command": ObservationTermCfg(func=mdp.generated_commands, params=command),
        "motion_anchor_pos_b": ObservationTermCfg(func=mdp.motion_anchor_pos_b, params=command),
        "motion_anchor_ori_b": ObservationTermCfg(func=mdp.motion_anchor_ori_b, params=command),
        "body_pos": ObservationTermCfg(func=mdp.robot_body_pos_b, params=command),
        "body_ori": ObservationTermCfg(func=mdp.robot_body_ori_b, params=command),
        "base_lin_vel": ObservationTermCfg(func=mdp.base_lin_vel),
        "base_ang_vel": ObservationTermCfg(func=mdp.base_ang_vel),
        "joint_pos": ObservationTermCfg(func=mdp.joint_pos_rel),
        "joint_vel": ObservationTermCfg(func=mdp.joint_vel_rel),
        "actions": ObservationTermCfg(func=mdp.last_action),
    }
    ordered = {name: terms[name] for name in OBSERVATION}
    return {name: ObservationGroupCfg(terms=dict(ordered), enable_corruption=False) for name in ("actor", "critic")}


def _self_collision(robot: RobotFacts) -> ContactSensorCfg:
    """Self-contact sensor for mjlab's self-collision cost."""
    whole = ContactMatch(mode="subtree", pattern=robot.root_link, entity="robot")
    return ContactSensorCfg(
        name="self_collision",
        primary=whole,
        secondary=whole,
        fields=("found", "force"),
        reduce="none",
        num_slots=1,
        history_length=DECIMATION,
    )


def _events(robot: RobotFacts) -> dict[str, EventTermCfg]:
    """mjlab's pushes, friction and trunk offset, and the gains and trunk mass that rollouts vary."""
    trunk = SceneEntityCfg("robot", body_names=(f"^{robot.root_link}$",))
    soles = SceneEntityCfg("robot", geom_names=tuple(f"^{name}$" for name in robot.shapes["feet"]))
    return {
        "push_robot": EventTermCfg(
            func=mdp.push_by_setting_velocity,
            mode="interval",
            interval_range_s=(1.0, 3.0),
            params={"velocity_range": VELOCITY_RANGE},
        ),
        "foot_friction": EventTermCfg(
            func=dr.geom_friction,
            mode="startup",
            params={"asset_cfg": soles, "operation": "abs", "ranges": (0.3, 1.2), "shared_random": True},
        ),
        "gains": EventTermCfg(
            func=dr.pd_gains, mode="startup", params={"kp_range": (0.9, 1.1), "kd_range": (0.9, 1.1)}
        ),
        "trunk_mass": EventTermCfg(
            func=dr.pseudo_inertia,
            mode="startup",
            params={"asset_cfg": trunk, "alpha_range": (-0.05, 0.05), "t_range": (-0.025, 0.025)},
        ),
    }
