"""Robot logs (MCAP, sqlite3 bags): damage-tolerant reading with a report, and writing for virtual robots."""

from pipeline.hardware_logs.ingest import ingest, read_log
from pipeline.hardware_logs.log_report import LogError, LogSettings, layouts
from pipeline.hardware_logs.robot_log import FallStates, LogFacts, LowCmds, LowStates, Odometry, OperatorEvent, RobotLog
from pipeline.hardware_logs.trial import Gap, Trial, read_trial
from pipeline.hardware_logs.write import ZSTD_SMALL, Storage, mcap_bytes, write_mcap
