"""mjlab configuration of the environment: scene, sensors, managers."""

import dataclasses

from mjlab.entity import EntityCfg
from mjlab.envs import ManagerBasedRlEnvCfg
from mjlab.scene import SceneCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg
from mjlab.sim import MujocoCfg, SimulationCfg

from pipeline.learning.robot_entity import robot_entity
from pipeline.learning.robot_facts import RobotFacts
from pipeline.physics import PHYSICS_S
from pipeline.tracking.task import DECIMATION
from pipeline.training.config import Config
from pipeline.training.mdp.actions import PolicyActionCfg
from pipeline.training.mdp.commands import RESAMPLE_S, VelocityCommandCfg
from pipeline.training.mdp.events import event_cfg
from pipeline.training.mdp.observations import observation_cfg
from pipeline.training.mdp.rewards import reward_cfg
from pipeline.training.mdp.terminations import termination_cfg
from pipeline.training.terrain import terrain_cfg

EPISODE_S = 20.0
"""Length of an episode [s]."""
SOFT_LIMITS = 0.97
"""`soft_joint_pos_limit_factor` of mjlab's `joint_pos_limits` penalty."""


def environment_cfg(robot: RobotFacts, config: Config, seed: int, distils: bool) -> ManagerBasedRlEnvCfg:
    """The environment of a configuration; with `distils` it follows reference clips."""
    rough = config.simulation.terrain == "rough"
    return ManagerBasedRlEnvCfg(
        decimation=DECIMATION,
        episode_length_s=EPISODE_S,
        seed=seed,
        scene=SceneCfg(
            num_envs=config.simulation.num_envs,
            terrain=terrain_cfg(config.simulation.terrain, seed),
            entities={"robot": _entity(robot)},
            sensors=_sensors(robot),
        ),
        sim=SimulationCfg(
            nconmax=60 if rough else 40,
            njmax=300 if rough else 200,
            mujoco=MujocoCfg(timestep=PHYSICS_S, iterations=10, ls_iterations=20),
        ),
        observations=observation_cfg(),
        actions={"joints": PolicyActionCfg(entity_name="robot", delay_s=config.randomization.delay_s)},
        commands={"velocity": VelocityCommandCfg(resampling_time_range=RESAMPLE_S, config=config.commands)},
        rewards=reward_cfg(robot, config),
        terminations=termination_cfg(robot, config, distils),
        events=event_cfg(robot, config, distils),
    )


def _entity(robot: RobotFacts) -> EntityCfg:
    entity = robot_entity(robot)
    assert entity.articulation is not None
    limits = dataclasses.replace(entity.articulation, soft_joint_pos_limit_factor=SOFT_LIMITS)
    return dataclasses.replace(entity, articulation=limits)


def _sensors(robot: RobotFacts) -> tuple[ContactSensorCfg, ...]:
    shapes = [shape for kind in ("shanks", "others") for shape in robot.shapes[kind]]

    def sensor(name: str, mode, pattern: tuple[str, ...]) -> ContactSensorCfg:
        return ContactSensorCfg(
            name=name,
            primary=ContactMatch(mode=mode, pattern=pattern, entity="robot"),
            fields=("force",),
            reduce="netforce",
        )

    feet = sensor("feet_contact", "body", tuple(f"^{link}$" for link in robot.foot_links))
    return feet, sensor("other_contact", "geom", tuple(f"^{shape}$" for shape in shapes))
