"""Random disturbances of a rollout: pushes, friction, mass, gains, delay, start offset, action noise."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.physics import PHYSICS_S
from pipeline.simulation.plant import Push
from pipeline.tracking.settings import DisturbanceSettings


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Disturbance of one rollout; the default is none."""

    pushes: tuple[Push, ...] = ()
    friction: float = 1.0
    trunk_mass: float = 1.0
    """Factor on mass and inertia of the root link."""
    kp: float = 1.0
    """Factor on the stiffness of all joints."""
    kd: float = 1.0
    """Factor on the damping of all joints."""
    delay_steps: int = 0
    """Delay of targets [physics steps]."""
    start_offset: float = 0.0
    """Largest offset of each joint at the start [rad]."""
    action_noise: float = 0.0
    """Standard deviation of the noise on the network's output."""

    def numbers(self) -> dict[str, Any]:
        """The disturbance as a clip's numbers."""
        impulse = max((np.hypot(*push.force_w[:2]) * push.duration_s for push in self.pushes), default=0.0)
        return {
            "pushes": len(self.pushes),
            "largest_push_n_s": round(float(impulse), 3),
            "friction": round(self.friction, 4),
            "trunk_mass": round(self.trunk_mass, 4),
            "kp_factor": round(self.kp, 4),
            "kd_factor": round(self.kd, 4),
            "delay_s": self.delay_steps * PHYSICS_S,
            "start_offset_rad": round(self.start_offset, 4),
            "action_noise": round(self.action_noise, 4),
        }


NONE = Disturbance()


def draw(settings: DisturbanceSettings, duration_s: float, rng: np.random.Generator) -> Disturbance:
    """Sample a disturbance for a rollout of `duration_s` [s]."""
    shortest, longest = (round(delay_s / PHYSICS_S) for delay_s in settings.delay_s)
    return Disturbance(
        pushes=_pushes(settings, duration_s, rng),
        friction=rng.uniform(*settings.friction),
        trunk_mass=rng.uniform(*settings.trunk_mass),
        kp=rng.uniform(*settings.gains),
        kd=rng.uniform(*settings.gains),
        delay_steps=int(rng.integers(shortest, longest + 1)),
        start_offset=settings.start_offset,
        action_noise=rng.uniform(*settings.action_noise),
    )


def _pushes(settings: DisturbanceSettings, duration_s: float, rng: np.random.Generator) -> tuple[Push, ...]:
    pushes, time_s = [], rng.uniform(0.0, settings.push_every_s[1])
    while time_s + settings.push_s < duration_s:
        angle, impulse = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*settings.push_impulse)
        force_w = impulse / settings.push_s * np.array([np.cos(angle), np.sin(angle), 0.0])
        pushes.append(Push(start_s=float(time_s), duration_s=settings.push_s, force_w=force_w))
        time_s += rng.uniform(*settings.push_every_s)
    return tuple(pushes)
