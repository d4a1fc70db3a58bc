"""Numbers of `data/feasibility.yaml` and `commands.yaml` by what they are measured in; the file has to say it."""

from __future__ import annotations

from typing import Annotated

from pipeline.files.sourced import Unit

Seconds = Annotated[float, Unit("s")]
Hertz = Annotated[float, Unit("Hz")]
Metres = Annotated[float, Unit("m")]
MetresPerSecond = Annotated[float, Unit("m/s")]
RadiansPerSecond = Annotated[float, Unit("rad/s")]
Radians = Annotated[float, Unit("rad")]
Degrees = Annotated[float, Unit("deg")]
MetresPerSecondCubed = Annotated[float, Unit("m/s^3")]
Plain = Annotated[float, Unit("-")]
OfFrames = Annotated[float, Unit("of frames")]
OfMotorLimit = Annotated[float, Unit("of the motor's limit")]
OfWeight = Annotated[float, Unit("of the weight")]
MetresPerSecondBySpeed = Annotated[tuple[float, float], Unit("m/s")]
"""a + b times the speed over ground."""
SecondsBySpeed = Annotated[tuple[float, float], Unit("s")]
"""a + b times the speed over ground."""
