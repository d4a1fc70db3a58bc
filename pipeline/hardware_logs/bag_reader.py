"""Read messages of a rosbag2 sqlite3 file (`.db3`) in bounded memory. It has no checksums, so it is never verified."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from pipeline.hardware_logs.log_report import Bounds, LogReport, Loss
from pipeline.hardware_logs.mcap_records import Channel, Channels, Records, Schema, Summary
from pipeline.hardware_logs.messages import TOPICS, schema_name, schema_text

MAGIC = b"SQLite format 3\x00"
BATCH = 512
"""Messages per batch."""


class BagReader:
    """One pass over a file, with the interface of `McapReader`."""

    def __init__(self, path: Path, report: LogReport):
        self.path, self.report = path, report
        self.channels = Channels()
        self.metadata: dict[str, dict[str, str]] = {}
        self.contradicted: set[str] = set()
        self.summary: Summary | None = None

    def read(self) -> Iterator[Records | Loss]:
        """Yield messages in the order of receipt. Raises LogError if the file is not a bag."""
        with self.path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise self.report.refuse("not a sqlite3 bag: it does not begin with the magic")
        self.report.unchecked += 1
        try:
            with closing(sqlite3.connect(f"{self.path.resolve().as_uri()}?mode=ro", uri=True)) as bag:
                bag.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, Bounds.record_bytes)
                bag.execute("PRAGMA trusted_schema = OFF")
                self._define(bag)
                yield from self._messages(bag)
            self.report.ended = True
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            if not self.channels.channels:
                raise self.report.refuse(f"not a bag that can be read ({error})") from error
            yield self.report.lose(0, f"the bag is damaged ({error})")

    def _define(self, bag: sqlite3.Connection) -> None:
        """Define the topics' channels. A bag of ROS Humble has no definitions; the published ones are used."""
        stored = "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
        if not {("topics",), ("messages",)} <= set(bag.execute(stored)):
            raise self.report.refuse("not a bag: it has no tables 'topics' and 'messages'")
        texts = self._definitions(bag)
        for number, topic, kind, encoding in bag.execute("SELECT id, name, type, serialization_format FROM topics"):
            text = texts.get(kind)
            if text is None and topic in TOPICS and kind == schema_name(TOPICS[topic]):
                text = ("ros2msg", schema_text(TOPICS[topic]))
            schema = Schema(name=str(kind), encoding=text[0], text=text[1]) if text else None
            self.channels.channels[int(number)] = Channel(topic=str(topic), encoding=str(encoding), schema=schema)
            if len(self.channels.channels) > Bounds.channels:
                raise self.report.refuse(f"more than {Bounds.channels} topics")

    def _definitions(self, bag: sqlite3.Connection) -> dict[str, tuple[str, str]]:
        """Message type -> encoding and definition, if the bag has them."""
        (tables,) = bag.execute("SELECT count(*) FROM sqlite_master WHERE name = 'message_definitions'").fetchone()
        if not tables:
            return {}
        rows = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        return {str(kind): (str(encoding), str(text)) for kind, encoding, text in rows if encoding and text}

    def _messages(self, bag: sqlite3.Connection) -> Iterator[Records | Loss]:
        total = 0
        rows = bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id")
        while batch := rows.fetchmany(BATCH):
            total += len(batch)
            if total > Bounds.messages:
                raise self.report.refuse(f"more than {Bounds.messages} messages")
            sound = [row for row in batch if tuple(map(type, row)) == (int, int, bytes)]
            if len(sound) < len(batch):
                yield self.report.lose(0, f"{len(batch) - len(sound)} rows of the bag hold no message")
            if not sound:
                continue
            payloads = [data for _, _, data in sound]
            stop = np.cumsum([len(each) for each in payloads])
            yield Records(
                data=b"".join(payloads),
                channel=np.array([number for number, _, _ in sound], dtype=np.int64),
                time_ns=np.array([stamp for _, stamp, _ in sound], dtype=np.int64),
                start=np.concatenate([[0], stop[:-1]]),
                stop=stop,
                end=int(stop[-1]),
                definitions=(),
            )
