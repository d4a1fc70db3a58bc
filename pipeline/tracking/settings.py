"""Settings of rollouts, read from `data/tracking.yaml`."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import Range
from pipeline.files.sourced import IMPULSE, LENGTH, Unit
from pipeline.robot.size import RobotSize

_FACTOR = Range(0.5, 1.5)
_SECONDS = Range(0.0, 10.0)


@dataclass(frozen=True, kw_only=True)
class DisturbanceSettings:
    """Ranges from which the disturbances of a rollout are sampled uniformly."""

    push_impulse: Annotated[tuple[float, float], Range(0.0, 100.0), Unit("N s"), IMPULSE]
    """Impulse of a horizontal push on the root link [N s]."""
    push_s: Annotated[float, Range(0.02, 2.0), Unit("s")]
    """Duration of a push [s]."""
    push_every_s: Annotated[tuple[float, float], Range(0.1, 60.0), Unit("s")]
    """Time between the starts of pushes [s]."""
    friction: Annotated[tuple[float, float], Range(0.05, 3.0), Unit("-")]
    """Coefficient of friction."""
    trunk_mass: Annotated[tuple[float, float], _FACTOR, Unit("-")]
    """Factor on mass and inertia of the root link."""
    gains: Annotated[tuple[float, float], _FACTOR, Unit("-")]
    """Factor on stiffness, and on damping, of all joints."""
    delay_s: Annotated[tuple[float, float], Range(0.0, 0.02), Unit("s")]
    """Delay of joint targets [s]."""
    start_offset: Annotated[float, Range(0.0, 0.5), Unit("rad")]
    """Largest offset of each joint at the start [rad]."""
    action_noise: Annotated[tuple[float, float], Range(0.0, 2.0), Unit("-")]
    """Standard deviation of the noise on the network's output, sampled for each rollout."""


@dataclass(frozen=True, kw_only=True)
class FailureSettings:
    """Limits at which tracking has failed, equal to the terminations of training."""

    root_height: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("m"), LENGTH]
    """Largest error of the root's height [m]."""
    gravity: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("-")]
    """Largest error of the z component of the gravity direction in the root frame."""
    end_height: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("m"), LENGTH]
    """Largest error in height of a foot or hand link [m]."""
    path: Annotated[float, Range(0.0, 10.0, open_low=True), Unit("m"), LENGTH]
    """Largest distance of the root from the reference's root [m]."""
    before_s: Annotated[float, _SECONDS, Unit("s")]
    """Time that is cut before a failure [s]."""
    restart_s: Annotated[float, _SECONDS, Unit("s")]
    """Time on the reference after a failure at which the rollout restarts [s]."""


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """`data/tracking.yaml`."""

    seed: Annotated[int, Range(0, 2**31)]
    """Seed of all disturbances, combined with the reference's content."""
    disturbed: Annotated[int, Range(0, 1000)]
    """Least number of disturbed rollouts of each original motion and of each mirror image."""
    disturbed_s: Annotated[float, Range(0.0, 600.0)]
    """Least total duration of these rollouts per motion, so that short motions have more of them [s]."""
    disturbed_variants: Annotated[int, Range(0, 1000)]
    """Number of disturbed rollouts of each other variant."""
    shortest_s: Annotated[float, Range(0.1, 10.0)]
    """Shorter pieces are dropped [s]."""
    calibrated_on: RobotSize
    """Robot that heights and impulses are valid for; `pipeline.robot.size.scaled` converts them for another one."""
    failure: FailureSettings
    disturbance: DisturbanceSettings

    def nominal(self) -> "TrackingSettings":
        """These settings without disturbed rollouts."""
        return dataclasses.replace(self, disturbed=0, disturbed_variants=0)
