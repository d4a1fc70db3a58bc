"""Bars of the short walk that tests of Webots projects judge."""

from pipeline.webots.result import Allowed

STILL = {name: Allowed(velocity_error_m_s=0.05, yaw_rate_error_rad_s=0.05) for name in ("first", "second")}
"""Standing, segment by segment."""
