"""How references are rolled out: the settings of `data/tracking.yaml`."""

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
    """Ranges that the disturbances of a rollout are drawn from, uniformly."""

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
    """Standard deviation of the noise on the network's output, drawn for each rollout."""


@dataclass(frozen=True, kw_only=True)
class FailureSettings:
    """Where tracking has failed, as an episode of training ends."""

    root_height: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("m"), LENGTH]
    """Largest error of the root's height [m]."""
    gravity: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("-")]
    """Largest error of the vertical in the root frame, along its z axis."""
    end_height: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("m"), LENGTH]
    """Largest error in height of a foot or hand link [m]."""
    path: Annotated[float, Range(0.0, 10.0, open_low=True), Unit("m"), LENGTH]
    """Largest distance of the root from the reference's root [m]."""
    before_s: Annotated[float, _SECONDS, Unit("s")]
    """Cut before a failure [s]."""
    restart_s: Annotated[float, _SECONDS, Unit("s")]
    """The rollout starts again on the reference this long after a failure [s]."""


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """`data/tracking.yaml`."""

    seed: Annotated[int, Range(0, 2**31)]
    """Of all disturbances, with the reference's content."""
    disturbed: Annotated[int, Range(0, 1000)]
    """Disturbed rollouts of each original motion and of each mirror image, at least."""
    disturbed_s: Annotated[float, Range(0.0, 600.0)]
    """Disturbed rollouts of each of them last at least this long together, so a short motion has more [s]."""
    disturbed_variants: Annotated[int, Range(0, 1000)]
    """Disturbed rollouts of each other variant."""
    shortest_s: Annotated[float, Range(0.1, 10.0)]
    """Shorter pieces are dropped [s]."""
    calibrated_on: RobotSize
    """The robot that heights and impulses hold for; `pipeline.robot.size.scaled` gives those of another one."""
    failure: FailureSettings
    disturbance: DisturbanceSettings

    def nominal(self) -> "TrackingSettings":
        """The same with no disturbed rollout."""
        return dataclasses.replace(self, disturbed=0, disturbed_variants=0)
