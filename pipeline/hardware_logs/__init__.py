"""Logs of a robot (MCAP, sqlite3 bags): read with every damage said, written for virtual robots."""

from pipeline.hardware_logs.mcap_writer import FASTWRITE, ZSTD_FAST, ZSTD_SMALL, Storage
from pipeline.hardware_logs.robot_log import (
    FallStates,
    LogFacts,
    LowCmds,
    LowStates,
    Odometry,
    OperatorEvent,
    RemoteStates,
    RobotLog,
)
from pipeline.hardware_logs.trial import Gap, Trial, read_trial, write_trial
from pipeline.hardware_logs.write import mcap_bytes, write_mcap

__all__ = [
    "FASTWRITE",
    "ZSTD_FAST",
    "ZSTD_SMALL",
    "FallStates",
    "Gap",
    "LogFacts",
    "LowCmds",
    "LowStates",
    "Odometry",
    "OperatorEvent",
    "RemoteStates",
    "RobotLog",
    "Storage",
    "Trial",
    "mcap_bytes",
    "read_trial",
    "write_mcap",
    "write_trial",
]
