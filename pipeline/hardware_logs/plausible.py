"""Whether what a robot says of itself can be: checksums cannot tell it, and unchunked files have none."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool

from pipeline.hardware_logs.columns import LINEAR, Columns
from pipeline.hardware_logs.layout import Layout
from pipeline.hardware_logs.settings import PlausibleSettings

LEAST_REST = 50
"""Messages at rest below which gravity is no reason to refuse a log: joints that turn back are slow for a moment."""


@dataclass
class Plausible:
    """Looks at the messages of `/low_state` of one log, piece by piece."""

    settings: PlausibleSettings
    layout: Layout
    messages: int = 0
    not_finite: int = 0
    out_of_range: int = 0
    restarts: int = 0
    """Times that a motor's count of lost packets fell."""
    rest: int = 0
    """Messages at rest."""
    worst_joints: dict[str, int] = field(default_factory=dict)
    """Messages out of range by joint."""
    _rest_force: float = 0.0
    _rest_tilt: float = 0.0
    _lost: np.ndarray | None = None

    def finite(self, columns: Columns) -> Bool[np.ndarray, " m"]:
        """Note a piece; which of its messages have only finite numbers."""
        finite = np.ones(len(columns["lost"]), dtype=bool)
        for name in LINEAR:
            finite &= np.isfinite(columns[name].sum(axis=1, dtype=np.float64))
        self.messages += len(finite)
        self.not_finite += int((~finite).sum())
        return finite

    def in_range(self, columns: Columns) -> Bool[np.ndarray, " m"]:
        """Note what is out of range in a piece of finite messages; those that are not."""
        values, limits = columns["joint_pos"], self.settings
        margin = limits.position_margin_rad
        wrong = (values < self.layout.joint_lower - margin) | (values > self.layout.joint_upper + margin)
        wrong |= np.abs(columns["joint_vel"]) > limits.speed_factor * self.layout.speed_limit
        for joint in np.flatnonzero(wrong.any(axis=0)).tolist():
            name = self.layout.joint_names[joint]
            self.worst_joints[name] = self.worst_joints.get(name, 0) + int(wrong[:, joint].sum())
        bad = wrong.any(axis=1) | (np.abs(columns["acc_b"]).max(axis=1, initial=0.0) > limits.acceleration_m_s2)
        self.out_of_range += int(bad.sum())
        self._note_rest(columns, ~bad)
        self._note_lost(columns["lost"])
        return ~bad

    def _note_rest(self, columns: Columns, good: np.ndarray) -> None:
        limits = self.settings
        still = good & (np.abs(columns["gyro_b"]).max(axis=1, initial=0.0) < limits.rest_gyro_rad_s)
        still &= np.abs(columns["joint_vel"]).max(axis=1, initial=0.0) < limits.rest_joint_rad_s
        if not still.any():
            return
        force, rpy = columns["acc_b"][still].astype(np.float64), columns["rpy"][still].astype(np.float64)
        roll, pitch = rpy[:, 0], rpy[:, 1]
        up = np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=1)
        length = np.linalg.norm(force, axis=1)
        along = np.clip(np.sum(force * up, axis=1) / np.maximum(length, 1e-9), -1.0, 1.0)
        self.rest += int(still.sum())
        self._rest_force += float(length.sum())
        self._rest_tilt += float(np.degrees(np.arccos(along)).sum())

    def _note_lost(self, lost: np.ndarray) -> None:
        before = lost[:1] if self._lost is None else self._lost
        if len(lost):
            self.restarts += int((np.diff(lost, axis=0, prepend=before) < 0).any(axis=1).sum())
            self._lost = lost[-1:]

    def refusal(self) -> str:
        """Why the log is refused; empty if it is not."""
        odd = self.not_finite + self.out_of_range
        if odd > self.settings.implausible_share * max(self.messages, 1):
            worst = max(self.worst_joints, key=lambda name: self.worst_joints[name], default="the trunk")
            return (
                f"{odd} of {self.messages} messages are not finite or beyond what '{self.layout.robot}' can do, most "
                f"of {worst}: is it of another robot or unit"
            )
        low, high = self.settings.rest_gravity_m_s2
        if self.rest >= LEAST_REST and not low <= self._rest_force / self.rest <= high:
            return f"at rest the specific force is {self._rest_force / self.rest:.2f} m/s^2: is it of another unit"
        return ""

    def remarks(self) -> list[str]:
        """What is odd and no reason to refuse the log."""
        notes = []
        if self.not_finite:
            notes.append(f"{self.not_finite} messages with numbers that are not finite are left out.")
        if self.out_of_range:
            joints = ", ".join(f"{name} {count}" for name, count in sorted(self.worst_joints.items()))
            notes.append(f"{self.out_of_range} messages are out of range ({joints or 'acceleration'}).")
        if self.restarts:
            notes.append(f"the count of lost packets fell {self.restarts} times.")
        if self.rest and self._rest_tilt / self.rest > self.settings.rest_tilt_deg:
            tilt = self._rest_tilt / self.rest
            notes.append(
                f"at rest gravity is {tilt:.0f} degrees off the attitude: accelerometer and attitude disagree."
            )
        return notes
