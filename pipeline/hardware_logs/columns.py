"""Rows of messages as the columns of a trial."""

from __future__ import annotations

import numpy as np

from pipeline.hardware_logs.messages import BUTTONS

Columns = dict[str, np.ndarray]

LINEAR = ("joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b")
"""Columns of `/low_state` that are interpolated; of `rpy` the roll and the yaw on the circle."""
PREVIOUS = ("temperature_c", "lost")
"""Columns of `/low_state` that keep the last value."""
HELD: dict[str, tuple[str, ...]] = {
    "/joint_ctrl": ("target_pos", "target_torque", "kp", "kd"),
    "/fall_down": ("fall_state",),
    "/odometer_state": ("odometer",),
    "/remote_controller_state": ("sticks",),
}
"""Columns of the other topics, whose last value is held."""
PARALLEL = 0
"""`cmd_type` of commands to the motors: those of the ankles are of cranks, not of joints."""


def low_state_columns(rows: np.ndarray) -> Columns:
    """Columns of `/low_state`: the serial arrays, float32."""
    imu, motors = rows["imu_state"], rows["motor_state_serial"]
    return {
        "joint_pos": motors["q"].copy(),
        "joint_vel": motors["dq"].copy(),
        "torque_est": motors["tau_est"].copy(),
        "rpy": imu["rpy"].copy(),
        "gyro_b": imu["gyro"].copy(),
        "acc_b": imu["acc"].copy(),
        "temperature_c": motors["temperature"].astype(np.float32),
        "lost": motors["lost"].astype(np.int64),
    }


def held_columns(topic: str, rows: np.ndarray, ankles: np.ndarray) -> Columns:
    """Columns of another topic.

    Args:
        ankles: indices of the joints that a parallel command does not tell
    """
    if topic == "/joint_ctrl":
        motors = rows["motor_cmd"]
        names = {"target_pos": "q", "target_torque": "tau", "kp": "kp", "kd": "kd"}
        found = {name: motors[source].copy() for name, source in names.items()}
        for values in found.values():
            values[np.ix_(rows["cmd_type"] == PARALLEL, ankles)] = np.nan
        return found
    if topic == "/fall_down":
        return {"fall_state": rows["fall_down_state"].astype(np.int64)}
    names = ("x", "y", "theta") if topic == "/odometer_state" else ("lx", "ly", "rx")
    return {HELD[topic][0]: np.stack([rows[name] for name in names], axis=1)}


def pressed(rows: np.ndarray) -> np.ndarray:
    """(m, buttons) bool of `/remote_controller_state`."""
    return np.stack([rows[name] != 0 for name in BUTTONS], axis=1)


def unknown(values: np.ndarray) -> np.ndarray:
    """One row that says nothing, of the kind of `values`."""
    shape, whole = (1, *values.shape[1:]), np.issubdtype(values.dtype, np.integer)
    return np.full(shape, -1 if whole else np.nan, dtype=values.dtype)


def joined(parts: list[Columns]) -> Columns:
    """Columns one after the other."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def taken(columns: Columns, index: np.ndarray | slice) -> Columns:
    """Some rows."""
    return {name: values[index] for name, values in columns.items()}
