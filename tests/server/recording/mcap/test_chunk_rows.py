"""What lies in chunks that may overlap in any way comes in order, and no chunk is read before its time."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from server.recording.mcap.chunk_rows import ChunkRow, in_order


@dataclass(frozen=True)
class Part:
    rows: tuple[ChunkRow, ...]

    @property
    def message_start_time(self) -> int:
        return self.rows[0][0]


TIMES = st.lists(st.integers(0, 60), min_size=1, max_size=12).map(sorted)


@given(st.lists(TIMES, max_size=12))
def test_rows_come_in_order_and_parts_are_read_when_their_time_has_come(times: list[list[int]]) -> None:
    parts = [
        Part(tuple((time_ns, number, f"{number} {i}".encode()) for i, time_ns in enumerate(of_one)))
        for number, of_one in enumerate(times)
    ]
    begun: list[int] = []

    def read(part: Part) -> list[ChunkRow]:
        begun.append(part.message_start_time)
        return list(part.rows)

    merged = []
    for row in in_order(parts, read):
        merged.append(row)
        assert all(begin_ns <= row[0] for begin_ns in begun)
    assert [row[0] for row in merged] == sorted(row[0] for row in merged)
    assert sorted(merged) == sorted(row for part in parts for row in part.rows)
    for number in range(len(parts)):  # what one chunk has at one moment stays in its order
        assert [row for row in merged if row[1] == number] == list(parts[number].rows)


def test_a_part_that_cannot_be_read_leaves_the_others() -> None:
    parts = [Part(((1, 0, b"a"), (5, 0, b"b"))), Part(((2, 1, b"c"),)), Part(((9, 2, b"d"),))]
    assert list(in_order(parts, lambda part: [] if part.message_start_time == 2 else list(part.rows))) == [
        (1, 0, b"a"),
        (5, 0, b"b"),
        (9, 2, b"d"),
    ]
