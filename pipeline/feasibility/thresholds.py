"""Types of the numbers in `data/feasibility.yaml`: unit and allowed range are part of a field's annotation.

    limit_excess: Annotated[float, Range(0.0, 1.0), Unit("rad")]

The file states the same unit (`pipeline.files.sourced`); a `Section` checks the range.
"""

from __future__ import annotations

from typing import Annotated

from pipeline.files.ranges import POSITIVE, SHARE, Range
from pipeline.files.sourced import JERK, LENGTH, SPEED_AND_SHARE, Unit

Seconds = Annotated[float, Range(0.0, 10.0), Unit("s")]
Hertz = Annotated[float, Range(1.0, 25.0), Unit("Hz")]
"""Cut-off of a low pass at the database's 50 Hz."""
Metres = Annotated[float, Range(0.0, 1.0), Unit("m"), LENGTH]
"""Scales with the robot's legs, as all figures with `LENGTH`, `SPEED` or `JERK` do (`pipeline.robot.size`)."""
ToleranceMetres = Annotated[float, Range(0.0, 1.0), Unit("m")]
"""Of measurement or of the shapes' accuracy: the same for every robot."""
ToleranceMetresPerSecond = Annotated[float, Range(0.0, 5.0), Unit("m/s")]
MetresPerSecondCubed = Annotated[float, POSITIVE, Unit("m/s^3"), JERK]
Degrees = Annotated[float, Range(0.0, 180.0), Unit("deg")]
ShareOfFrames = Annotated[float, SHARE, Unit("of frames")]
RatioToMotorLimit = Annotated[float, Range(0.5, 5.0), Unit("of the motor's limit")]
MetresPerSecondBySpeed = Annotated[tuple[float, float], Range(0.0, 5.0), Unit("m/s"), SPEED_AND_SHARE]
"""a + b times the speed over ground."""
SecondsBySpeed = Annotated[tuple[float, float], Range(0.0, 10.0), Unit("s")]
"""a + b times the speed over ground."""
