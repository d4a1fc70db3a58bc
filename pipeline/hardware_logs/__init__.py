"""Logs of a robot (MCAP, sqlite3 bags): read with all damage reported, written for virtual robots."""

from pipeline.hardware_logs.ingest import ingest
from pipeline.hardware_logs.layout import LogSettings, layouts
from pipeline.hardware_logs.log_report import LogError
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
from pipeline.hardware_logs.write import FASTWRITE, ZSTD_FAST, ZSTD_SMALL, Storage, mcap_bytes, write_mcap

__all__ = [
    "FASTWRITE",
    "ZSTD_FAST",
    "ZSTD_SMALL",
    "FallStates",
    "Gap",
    "LogError",
    "LogFacts",
    "LogSettings",
    "LowCmds",
    "LowStates",
    "Odometry",
    "OperatorEvent",
    "RemoteStates",
    "RobotLog",
    "Storage",
    "Trial",
    "ingest",
    "layouts",
    "mcap_bytes",
    "read_trial",
    "write_mcap",
    "write_trial",
]
