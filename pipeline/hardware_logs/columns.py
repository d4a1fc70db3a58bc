"""Convert rows of messages to the columns of a trial, with zero-order hold between the messages of a topic."""

import numpy as np
from jaxtyping import Float, Int

from pipeline.hardware_logs.log_facts import StatedFacts
from pipeline.hardware_logs.messages import BUTTONS
from pipeline.hardware_logs.robot_log import OperatorEvent

Columns = dict[str, np.ndarray]

LINEAR = ("joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b")
"""Columns of `/low_state` that are interpolated; roll and yaw of `rpy` on the circle."""
PREVIOUS = ("temperature_c", "lost")
"""Columns of `/low_state` that hold the last value."""
HELD: dict[str, tuple[str, ...]] = {
    "/joint_ctrl": ("target_pos", "target_torque", "kp", "kd"),
    "/fall_down": ("fall_state",),
    "/odometer_state": ("odometer",),
    "/remote_controller_state": ("sticks",),
}
"""Columns of the other topics, which hold the last value."""
PARALLEL = 0
"""`cmd_type` of motor commands; for the ankles these refer to the cranks, not to the joints."""


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
    """Columns of another topic; `ankles` are the indices of the joints that a parallel command does not contain."""
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


def unknown(values: np.ndarray) -> np.ndarray:
    """One row of unknown values (NaN or -1) with the type of `values`."""
    shape, whole = (1, *values.shape[1:]), np.issubdtype(values.dtype, np.integer)
    return np.full(shape, -1 if whole else np.nan, dtype=values.dtype)


def joined(parts: list[Columns]) -> Columns:
    """Concatenate columns."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def taken(columns: Columns, index: np.ndarray | slice) -> Columns:
    """Select rows of all columns."""
    return {name: values[index] for name, values in columns.items()}


class HeldTopic:
    """Buffer of a held topic: pending messages and the last past one."""

    def __init__(self) -> None:
        self._times: list[np.ndarray] = []
        self._columns: list[Columns] = []

    def add(self, time_ns: Int[np.ndarray, " m"], columns: Columns) -> None:
        if len(time_ns):
            self._times.append(time_ns)
            self._columns.append(columns)

    def forget(self, time_ns: int) -> None:
        """Mark the values as unknown from this time until the next message, since messages may be lost."""
        if self._columns:
            nothing = {name: unknown(values) for name, values in self._columns[-1].items()}
            self.add(np.array([time_ns], dtype=np.int64), nothing)

    def at(self, grid_ns: Int[np.ndarray, " n"], names: tuple[str, ...], blank: Columns) -> Columns:
        """Values at ascending times; drops past messages. `blank`: a row of each column before the first message."""
        if not self._times:
            return {name: np.repeat(blank[name], len(grid_ns), axis=0) for name in names}
        times = np.concatenate(self._times)
        order = np.argsort(times, kind="stable")
        times, columns = times[order], taken(joined(self._columns), order)
        place = np.searchsorted(times, grid_ns, side="right")
        found = {name: np.concatenate([blank[name], columns[name]])[place] for name in names}
        first = max(int(place[-1]) - 1, 0) if len(place) else 0
        self._times, self._columns = [times[first:]], [taken(columns, slice(first, None))]
        return found


class CommandSource:
    """The velocity command of one log, from its metadata or from the remote control.

    `origin_ns`: receipt time of the log's first message, if known; stated times are relative to it. `whole`: no
    metadata can have been lost, so that a log without a stated command was steered with the remote.
    """

    def __init__(self, stated: StatedFacts, origin_ns: int | None, *, whole: bool):
        self.stated, self.origin_ns, self._whole = stated, origin_ns, whole
        facts = stated.facts
        self.kind = "schedule" if facts.command_source == "unknown" and facts.command else facts.command_source
        self._times = np.array([round(row[0] * 1e9) for row in facts.command], dtype=np.int64)
        rows = np.array([row[1:] for row in facts.command], dtype=np.float32).reshape(-1, 3)
        self._rows = np.concatenate([np.full((1, 3), np.nan, dtype=np.float32), rows])
        self._down = np.zeros(len(BUTTONS), dtype=bool)
        self._presses: list[tuple[int, str]] = []

    def at(self, grid_ns: Int[np.ndarray, " n"], sticks: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Commands at the samples. In `sticks` (lx, ly, rx, held), forward, left and turning left are negative."""
        if self.kind == "schedule":
            if self.origin_ns is None:
                return np.full((len(grid_ns), 3), np.nan, dtype=np.float32)
            return self._rows[np.searchsorted(self._times, grid_ns - self.origin_ns, side="right")]
        if self.kind == "unknown" and self._whole and np.isfinite(sticks).any():
            self.kind = "remote"
        if self.kind == "remote":
            return -sticks[:, [1, 0, 2]] * np.array(self.stated.facts.command_scale, dtype=np.float32)
        return np.full((len(grid_ns), 3), np.nan, dtype=np.float32)

    def note_buttons(self, time_ns: Int[np.ndarray, " m"], rows: np.ndarray) -> None:
        """Record pressed buttons of the remote as events."""
        down = np.stack([rows[name] != 0 for name in BUTTONS], axis=1)
        before = np.concatenate([self._down[None], down[:-1]])
        for row, button in np.argwhere(down & ~before).tolist():
            self._presses.append((int(time_ns[row]), BUTTONS[button]))
        self._down = down[-1] if len(down) else self._down

    def events(self, start_ns: int, stop_ns: int) -> tuple[OperatorEvent, ...]:
        """Events of a trial on its clock: stated events until its end (also before its start), and buttons within
        it."""
        found = [
            OperatorEvent(time_s=(each - start_ns) * 1e-9, kind=f"button {button}", source="remote")
            for each, button in self._presses
            if start_ns <= each <= stop_ns
        ]
        if self.origin_ns is not None:
            for event in self.stated.facts.events:
                time_s = event.time_s + (self.origin_ns - start_ns) * 1e-9
                if time_s <= (stop_ns - start_ns) * 1e-9:
                    found.append(OperatorEvent(time_s=time_s, kind=event.kind, source=event.source))
        return tuple(sorted(found, key=lambda event: (event.time_s, event.kind)))
