"""The paper's environment in mjlab's terms: scene, sensors, terms and what is drawn at random."""

from __future__ import annotations

from mjlab.envs import ManagerBasedRlEnvCfg
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.scene import SceneCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg
from mjlab.sim import MujocoCfg, SimulationCfg

from pipeline.learning.robot_entity import robot_entity
from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.action import PolicyActionCfg
from pipeline.training.commands import VelocityCommandCfg
from pipeline.training.observations import observation_cfg
from pipeline.training.options import Options
from pipeline.training.pushes import PushForce, PushVelocity
from pipeline.training.reward_table import reward_cfg
from pipeline.training.rotor_links import draw_rotors_on_links
from pipeline.training.terminations import termination_cfg
from pipeline.training.terrain import terrain_cfg

PHYSICS_S = 0.005
DECIMATION = 4


def environment_cfg(robot: RobotFacts, options: Options, num_envs: int, seed: int) -> ManagerBasedRlEnvCfg:
    """The environment in mjlab's terms."""
    rough = options.terrain == "rough"
    return ManagerBasedRlEnvCfg(
        decimation=DECIMATION,
        episode_length_s=options.episode_s,
        seed=seed,
        scene=SceneCfg(
            num_envs=num_envs,
            terrain=terrain_cfg(options, seed),
            entities={"robot": robot_entity(robot, options.motors)},
            sensors=_sensors(robot),
        ),
        sim=SimulationCfg(
            nconmax=60 if rough else 40,
            njmax=300 if rough else 200,
            mujoco=MujocoCfg(timestep=PHYSICS_S, iterations=10, ls_iterations=20),
        ),
        observations=observation_cfg(),
        actions={"joints": PolicyActionCfg(entity_name="robot")},
        commands={"velocity": VelocityCommandCfg(resampling_time_range=options.resample_s)},
        rewards=reward_cfg(),
        terminations=termination_cfg(options),
        events=_events(robot, options),
    )


def _sensors(robot: RobotFacts) -> tuple[ContactSensorCfg, ...]:
    touching = [shape for kind in ("shanks", "others") for shape in robot.shapes[kind]]

    def sensor(name: str, mode, pattern: tuple[str, ...]) -> ContactSensorCfg:
        return ContactSensorCfg(
            name=name,
            primary=ContactMatch(mode=mode, pattern=pattern, entity="robot"),
            fields=("force",),
            reduce="netforce",
        )

    feet = sensor("feet_contact", "body", tuple(f"^{link}$" for link in robot.foot_links))
    return feet, sensor("other_contact", "geom", tuple(f"^{shape}$" for shape in touching))


def _events(robot: RobotFacts, options: Options) -> dict[str, EventTermCfg]:
    feet = tuple(f"^{name}$" for name in robot.shapes["feet"])
    trunk = (f"^{robot.root_link}$",)
    events = {
        "friction": EventTermCfg(
            mode="startup",
            func=dr.geom_friction,
            params={
                "asset_cfg": SceneEntityCfg("robot", geom_names=feet),
                "operation": "abs",
                "ranges": options.friction,
                "shared_random": True,
            },
        ),
        "gains": EventTermCfg(
            mode="startup",
            func=dr.pd_gains,
            params={"kp_range": options.gain_range, "kd_range": options.gain_range},
        ),
        "trunk": EventTermCfg(
            mode="startup",
            func=dr.pseudo_inertia,
            params={"asset_cfg": SceneEntityCfg("robot", body_names=trunk), "alpha_range": options.trunk_density},
        ),
    }
    if options.rotor_link_share:
        events["rotors"] = EventTermCfg(mode="startup", func=draw_rotors_on_links)
    if options.push_speed[1] > 0.0:
        events["push_velocity"] = EventTermCfg(mode="step", func=PushVelocity)
    if options.push_impulse[1] > 0.0:
        events["push_force"] = EventTermCfg(mode="step", func=PushForce)
    return events
