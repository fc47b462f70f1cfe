"""Reads the SQLite files of ROS 2 bags, of every version of their schema, with the write-ahead log beside them."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from server.judge.message import RosVersion
from server.recording.read.bag2_metadata import is_latched
from server.recording.read.clock_steps import BACK_NS, GAP_NS, Arrivals, Stretch
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.source import Channel, Damage, DefinitionFormat, spelled
from server.recording.read.temporary_copy import TemporaryCopy
from server.recording.read.unpack import PACKED, unpacked

_FORMATS: dict[str, DefinitionFormat] = {"ros2msg": "msg", "ros2idl": "idl"}
_LOGS = ("-wal", "-journal")  # what SQLite leaves beside a database that was not closed
_LOG_HEAD, _FRAME_HEAD = 32, 24  # bytes of a write-ahead log, and of each page in it
_LAST_NS = 2**63 - 1
_WHOLE = "typeof(timestamp) = 'integer' AND typeof(data) = 'blob'"  # SQLite takes anything into any column


class Bag2Database:
    """A SQLite file of a ROS 2 bag."""

    ros_version: RosVersion = 2
    is_listed = False

    def __init__(
        self,
        path: Path,
        *,
        content: Path | None = None,
        copy: TemporaryCopy | None = None,
    ) -> None:
        """`path`: how it is named; `content`: where it is, which is in `copy` where that is given.

        Raises RecordingUnreadable, sqlite3.Error, OSError.
        """
        self.path = path
        self.stretches: Sequence[Stretch] = ()
        self._copy = copy
        self._is_torn = False
        self._database: sqlite3.Connection | None = None
        try:
            self._database = self._open(content or path)
            self._read_tables()
            if self._copy is not None:
                self._copy.release()
        except BaseException:
            self.close()
            raise
        self.damage = self._new_damage()

    def messages(
        self, numbers: set[int], start_ns: int, damage: Damage | None = None
    ) -> Iterator[tuple[int, int, bytes]]:
        if damage is None:
            damage = self.damage = self._new_damage()
        if not numbers:
            return
        marks = ",".join("?" * len(numbers))
        for within, shift_ns in self._ranges():
            rows = self._execute(
                f"SELECT timestamp, topic_id, data FROM messages WHERE topic_id IN ({marks}) AND timestamp >= ? "
                f"AND {_WHOLE} {within} ORDER BY timestamp",
                [*numbers, max(start_ns - shift_ns, -_LAST_NS)],
            )
            for time_ns, number, raw in rows:
                message = unpacked(raw) if raw[:4] == PACKED else raw
                if message is None:
                    damage.pieces += 1
                else:
                    yield time_ns + shift_ns, number, message

    def _ranges(self) -> Iterator[tuple[str, int]]:
        """Which messages follow each other: a condition, and what is added to their times."""
        if not self.stretches:
            yield "", 0
        for number, one in enumerate(self.stretches):
            after = f"AND rowid >= {one.place}" if number else ""
            is_last = number + 1 == len(self.stretches)
            yield (after if is_last else f"{after} AND rowid < {self.stretches[number + 1].place}"), one.shift_ns

    def arrivals(self) -> Iterator[Arrivals]:
        table = f"FROM messages WHERE {_WHOLE} AND topic_id IN (SELECT id FROM topics)"
        odd = self._execute(
            f"SELECT 1 FROM (SELECT timestamp - LAG(timestamp) OVER (ORDER BY rowid) AS step {table}) "
            f"WHERE step <= {-BACK_NS} OR step > {GAP_NS} LIMIT 1"
        )
        if odd.fetchone() is None:
            return
        rows = np.array(self._execute(f"SELECT rowid, timestamp, topic_id {table} ORDER BY rowid").fetchall(), np.int64)
        yield Arrivals(places=rows[:, 0], times_ns=rows[:, 1], channels=rows[:, 2])

    def raw_at(self, place: int, channel: int) -> bytes | None:
        row = self._execute("SELECT data FROM messages WHERE rowid = ?", [place]).fetchone()
        return None if row is None else unpacked(row[0]) if row[0][:4] == PACKED else row[0]

    def correct(self, stretches: Sequence[Stretch]) -> None:
        self.stretches = stretches
        self.start_ns = stretches[0].first_ns + stretches[0].shift_ns
        self.end_ns = stretches[-1].last_ns + stretches[-1].shift_ns

    def close(self) -> None:
        if self._database is not None:
            self._database.close()
        if self._copy is not None:
            self._copy.close()
        self._database = self._copy = None

    def _open(self, path: Path) -> sqlite3.Connection:
        logs = [log for end in _LOGS if (log := path.with_name(path.name + end)).is_file() and log.stat().st_size]
        options = "mode=ro&immutable=1"  # neither is a lock taken nor a file made beside it
        if logs:
            self._copy = TemporaryCopy()
            self._is_torn = _is_torn(path, logs[0])
            path, *_ = [self._copy.copy(file) for file in (path, *logs)]
            options = "mode=rw"
        else:
            _assert_whole(path)
        database = sqlite3.connect(
            f"file:{quote(str(path.absolute()))}?{options}", uri=True, check_same_thread=False, isolation_level=None
        )
        self._database = database
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        database.execute("PRAGMA trusted_schema = OFF")
        return database

    def _execute(self, query: str, values: Sequence[Any] = ()) -> sqlite3.Cursor:
        assert self._database is not None
        return self._database.execute(query, values)

    def _read_tables(self) -> None:
        tables = {name for (name,) in self._execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not tables >= {"messages", "topics"}:
            raise RecordingUnreadable(f"{self.path} is not a recording of ROS 2: a database with missing tables")
        definitions = self._definitions() if "message_definitions" in tables else {}
        self.distro = self._distro() if "schema" in tables else None
        spans = self._execute(
            f"SELECT topic_id, COUNT(CASE WHEN {_WHOLE} THEN 1 END), MIN(CASE WHEN {_WHOLE} THEN timestamp END), "
            f"MAX(CASE WHEN {_WHOLE} THEN timestamp END), COUNT(*) FROM messages GROUP BY topic_id"
        )
        counted = {number: span for number, *span in spans}
        columns = {row[1] for row in self._execute("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        self.channels: Sequence[Channel] = [
            _channel(number, name, type, encoding, offered, definitions, counted)
            for number, name, type, encoding, offered in self._execute(
                f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
            )
        ]
        known = {channel.number for channel in self.channels}
        self._strays = sum(span[3] for number, span in counted.items() if number not in known)
        self._strays += sum(span[3] - span[0] for number, span in counted.items() if number in known)
        filled = [span for number, span in counted.items() if number in known and span[0]]
        self.start_ns = min((first for _, first, *_ in filled), default=0)
        self.end_ns = max((last for _, _, last, *_ in filled), default=0)

    def _definitions(self) -> dict[str, tuple[str, str]]:
        """Encoding and text by type."""
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        return {
            spelled(str(type), 2): (encoding, text)
            for type, encoding, text in self._execute(query)
            if isinstance(text, str)
        }

    def _distro(self) -> str | None:
        with contextlib.suppress(sqlite3.OperationalError):  # before version 3 of the schema
            row = self._execute("SELECT ros_distro FROM schema").fetchone()
            return row[0] if row is not None and isinstance(row[0], str) else None
        return None

    def _new_damage(self) -> Damage:
        return Damage(pieces=self._strays, is_cut=self._is_torn)


def _assert_whole(path: Path) -> None:
    """Check the length in the header, because SQLite reads a missing end of a database as zeros."""
    with path.open("rb") as file:
        header = file.read(100)
    whole = _page_bytes(header) * int.from_bytes(header[28:32], "big")
    if path.stat().st_size < whole:
        raise RecordingUnreadable(f"{path} is not complete: {path.stat().st_size} of {whole} bytes are there")


def _page_bytes(header: bytes) -> int:
    stored = int.from_bytes(header[16:18], "big")
    return 65_536 if stored == 1 else stored


def _is_torn(database: Path, log: Path) -> bool:
    """Whether a write-ahead log ends in the middle of a page."""
    with database.open("rb") as file:
        frame = _FRAME_HEAD + _page_bytes(file.read(100))
    return log.name.endswith(_LOGS[0]) and (log.stat().st_size - _LOG_HEAD) % frame != 0


def _channel(
    number: int,
    name: Any,
    type: Any,
    encoding: Any,
    offered: Any,
    definitions: dict[str, tuple[str, str]],
    counted: dict[int, list[Any]],
) -> Channel:
    kind = spelled(str(type), 2)
    form, text = definitions.get(kind, ("", ""))
    return Channel(
        number=number,
        topic=str(name),
        type=kind,
        definition=text,
        format=_FORMATS.get(form, "none") if text.strip() else "none",
        encoding=str(encoding),
        count=counted[number][0] if number in counted else 0,
        is_latched=is_latched(offered),
    )
