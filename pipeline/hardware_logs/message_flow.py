"""Process a log's messages into trial files: clock jumps, decoding, plausibility, resampling, command."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from pipeline.errors import PipelineError
from pipeline.hardware_logs.bag_reader import BagReader
from pipeline.hardware_logs.columns import Columns, CommandSource, held_columns, low_state_columns, taken
from pipeline.hardware_logs.decode import JointCount, SchemaError, TopicDecoder
from pipeline.hardware_logs.log_facts import StatedFacts
from pipeline.hardware_logs.log_report import LogReport, LogSettings, Loss, stretches
from pipeline.hardware_logs.mcap_reader import McapReader
from pipeline.hardware_logs.mcap_records import Records
from pipeline.hardware_logs.messages import TOPICS
from pipeline.hardware_logs.plausible import Plausible, SensorWatch
from pipeline.hardware_logs.regular import Block, Regular, Stretched, TrialFiles
from pipeline.robot import Robot
from pipeline.robot.legs import legs_of

MAX_TRIALS = 200
"""Most trials of a log; more clock jumps mean that the file is not a valid log."""
MAX_EARLY = 20_000
"""Most messages of other topics that are kept until the first of `/low_state`."""
MIN_DENSITY = 0.02
"""Least number of messages per sample; a sparser log would produce large files of gaps."""


class MessageFlow:
    """One pass over a log. `run` once, then look at `robot`, `stated`, `remarks()`."""

    def __init__(
        self,
        source: McapReader | BagReader,
        report: LogReport,
        files: TrialFiles,
        layouts: Mapping[int, tuple[Robot, ...]],
        settings: LogSettings,
        facts: Callable[[], StatedFacts],
    ):
        self.source, self.report, self.files, self.settings = source, report, files, settings
        self.layouts, self._facts = layouts, facts
        self.robot: Robot | None = None
        self.stated: StatedFacts | None = None
        self._joints = JointCount(allowed=tuple(layouts))
        self._decoders: dict[int, TopicDecoder | None] = {}
        self._early: list[tuple[str, np.ndarray, np.ndarray]] = []
        self._last_ns: int | None = None
        self._first_ns: int | None = None
        self._lost_before = False
        self._grid_start: int | None = None
        self._jumps, self._stray, self._unread, self._short, self._undefined = 0, 0, 0, 0, 0

    def run(self) -> None:
        """Read the whole log. Raises LogError."""
        for item in self._items():
            if isinstance(item, Loss):
                self._lost_before = True
                if self.robot is not None:
                    self._regular.lose()
            else:
                self._records(item)
        if self.robot is not None:
            self._write(self._regular.finish())
            refusal = self._plausible.refusal()
            if refusal:
                raise self.report.refuse(refusal)

    def _items(self) -> Iterator[Records | Loss]:
        """Items of the source. Unexpected errors of it reject the log; disk and memory errors are raised."""
        try:
            yield from self.source.read()
        except (PipelineError, OSError, MemoryError):
            raise
        except Exception as error:  # invalid files cause various errors in the readers' libraries
            raise self.report.refuse(f"it can't be read ({type(error).__name__}: {error})") from error

    def _records(self, records: Records) -> None:
        time = self.settings.time
        found = stretches(
            records.time_ns,
            self._last_ns,
            back_ns=round(time.disorder_s * 1e9),
            ahead_ns=round(time.split_s * 1e9),
        )
        self._stray += len(records.time_ns) - sum(len(index) for index, _ in found)
        for index, jump in found:
            times = records.time_ns[index]
            if jump:
                self._jump(int(times[0]))
            self._first_ns = int(times.min()) if self._first_ns is None else self._first_ns
            self._last_ns = int(times.max())
            self._topics(records, index)
            self._lost_before = False
        if self.robot is not None:
            self._write(self._regular.ready())
            trial = self._regular.trial
            if trial is not None and trial.messages < MIN_DENSITY * trial.samples - MAX_EARLY:
                raise self.report.refuse(f"only {trial.messages} messages of /low_state for {trial.samples} samples")

    def _jump(self, time_ns: int) -> None:
        """End the trial at a clock jump; stated times are valid after damage, but not after a jump."""
        assert self._last_ns is not None
        forward = time_ns > self._last_ns
        self._jumps += 1
        if self.robot is not None:
            self._write(self._regular.finish())
            if not (forward and self._lost_before):
                self._command.origin_ns = None

    def _topics(self, records: Records, index: np.ndarray) -> None:
        channel = records.channel[index]
        for number in np.unique(channel).tolist():
            mine = index[channel == number]
            known = self.source.channels.channels.get(number)
            topic = known.topic if known else ""
            self.report.messages[topic] = self.report.messages.get(topic, 0) + len(mine)
            self._undefined += 0 if known else len(mine)
            decoder = self._decoder(number)
            if decoder is None:
                continue
            try:
                rows, kept = decoder.decode(records.data, records.start[mine], records.stop[mine])
            except SchemaError as error:
                raise self.report.refuse(str(error)) from error
            self._unread += int((~kept).sum())
            if len(rows):
                self._take(topic, records.time_ns[mine[kept]], rows)

    def _decoder(self, number: int) -> TopicDecoder | None:
        """The decoder of a channel; None for unused topics."""
        known = self.source.channels.channels.get(number)
        if number not in self._decoders and known is not None:
            try:
                self._decoders[number] = TopicDecoder(known, self._joints) if known.topic in TOPICS else None
            except SchemaError as error:
                raise self.report.refuse(str(error)) from error
        return self._decoders.get(number)

    def _take(self, topic: str, time_ns: np.ndarray, rows: np.ndarray) -> None:
        if self.robot is None:
            if topic != "/low_state":
                if sum(len(each) for _, each, _ in self._early) < MAX_EARLY:
                    self._early.append((topic, time_ns, rows))
                return
            self._begin()
        if topic == "/low_state":
            columns = low_state_columns(rows)
            kept = self._plausible.finite(columns)
            if not kept.all():
                time_ns, columns = time_ns[kept], taken(columns, kept)
            self._sensors.add(time_ns, columns)
            good = self._plausible.in_range(columns)
            if not good.all() and self.report.unchecked:
                time_ns, columns = time_ns[good], taken(columns, good)
            self._regular.add(time_ns, columns)
            return
        if topic == "/remote_controller_state":
            self._command.note_buttons(time_ns, rows)
        self._regular.hold(topic, time_ns, held_columns(topic, rows, self._ankles))

    def _robot_of(self, fitting: tuple[Robot, ...], robot: str) -> Robot:
        """The stated robot among those with the same number of joints, or the only one."""
        stated = [each for each in fitting if each.name == robot]
        if len(fitting) == 1 or stated:
            return (stated or fitting)[0]
        names = " and ".join(f"'{each.name}'" for each in fitting)
        joints = len(fitting[0].joint_names)
        raise self.report.refuse(f"{joints} joints are those of {names}; state the robot in a YAML file beside the log")

    def _begin(self) -> None:
        """Set up the processing at the first message of `/low_state`, which determines the robot."""
        assert self._joints.count is not None
        self.stated = self._facts()
        self.robot = self._robot_of(self.layouts[self._joints.count], self.stated.facts.robot)
        self._ankles = np.array(legs_of(self.robot).all_ankles, dtype=np.int64)
        self._regular = Regular(self.settings.time, len(self.robot.joint_names))
        self._plausible = Plausible(self.settings.plausible, self.robot)
        self._sensors = SensorWatch(self.robot, self.settings.plausible.frozen_s)
        self._command = CommandSource(
            self.stated, self._origin(), whole=not self.report.losses and not self.stated.damaged
        )
        early, self._early = self._early, []
        for topic, time_ns, rows in early:
            self._take(topic, time_ns, rows)

    def _origin(self) -> int | None:
        """Receipt time of the log's first message: as recorded, from the summary, or as read if nothing was lost
        before."""
        assert self.stated is not None
        if self.stated.start_ns is not None:
            return self.stated.start_ns
        if self.source.summary is not None and self.source.summary.first_ns is not None:
            return self.source.summary.first_ns
        return None if self.report.losses else self._first_ns

    def _write(self, made: list[Block | Stretched]) -> None:
        rate_hz = self.settings.time.rate_hz
        for each in made:
            if isinstance(each, Stretched):
                self._end(each)
                continue
            if self._grid_start is None:
                self._grid_start = int(each.grid_ns[0])
            columns: Columns = {name: values for name, values in each.columns.items() if name != "sticks"}
            columns["command"] = self._command.at(each.grid_ns, each.columns["sticks"])
            columns["time_s"] = np.round((each.grid_ns - self._grid_start) / self.settings.time.period_ns) / rate_hz
            self.files.add(columns)

    def _end(self, made: Stretched) -> None:
        """End a trial: drop it if it is too short or too sparse, else close it with its events."""
        time, plausible = self.settings.time, self.settings.plausible
        self._grid_start = None
        if made.samples < time.min_s * time.rate_hz:
            self._short += 1
            self.files.drop()
            return
        if len(self.files.trials) >= MAX_TRIALS:
            raise self.report.refuse(f"its clock jumps or it falls silent more than {MAX_TRIALS} times")
        hz = made.message_hz(time.rate_hz)
        low, high = plausible.rate_hz
        if not low <= hz <= high:
            raise self.report.refuse(f"{hz:.1f} messages of /low_state a second, {low:g} to {high:g} are allowed")
        stop_ns = made.start_ns + made.samples * time.period_ns
        self.files.close(made, self._command.events(made.start_ns, stop_ns), self._command.kind)

    def why_nothing(self) -> str:
        """Why the log has no samples."""
        there = ", ".join(f"{name} {count}" for name, count in sorted(self.report.messages.items()) if name)
        if self._joints.other is not None:
            known = ", ".join(
                f"'{each.name}' {count}" for count, fitting in sorted(self.layouts.items()) for each in fitting
            )
            return f"its messages are of {self._joints.other} joints, known are {known}"
        if self._undefined:
            return f"{self._undefined} messages are on channels whose definition is lost"
        if "/low_state" in self.report.messages:
            return f"none of its {self.report.messages['/low_state']} messages of /low_state can be read"
        if self.report.losses:
            return f"nothing can be read: {self.report.losses[0].problem}"
        return f"it has no messages of /low_state (there are: {there or 'none at all'})"

    def remarks(self) -> list[str]:
        """Remarks on the log, one sentence each."""
        counts = {
            "messages have a time of their own and are left out": self._stray,
            "messages can't be decoded and are left out": self._unread,
            "messages are on channels that are not defined": self._undefined,
            "times its clock jumps or it is silent for long; a trial ends there": self._jumps,
            "stretches are too short for a trial": self._short,
        }
        if self.robot is not None:
            counts["messages have the time of another and are left out"] = self._regular.duplicates
            counts["messages come too late and are left out"] = self._regular.late
        notes = [f"{count} {what}." for what, count in counts.items() if count]
        return notes + ([*self._plausible.remarks(), *self._sensors.remarks()] if self.robot is not None else [])
