"""Messages that come in pieces."""

from __future__ import annotations

from typing import Any

import pytest

from server.rosbridge_server.fields import Refused
from server.rosbridge_server.fragments import MOST_MESSAGES, Fragments


def piece(number: Any, total: Any, data: Any = "x", id: Any = "a") -> dict[str, Any]:
    return {"op": "fragment", "id": id, "data": data, "num": number, "total": total}


def test_pieces_make_a_whole_in_any_order_and_mixed_with_others() -> None:
    fragments = Fragments(limit_bytes=100)
    assert fragments.add(piece(1, 3, "wo")) is None
    assert fragments.add(piece(0, 1, "alone", id="b")) == b"alone"
    assert fragments.add(piece(2, 3, "rld")) is None
    assert fragments.add(piece(0, 3, "hello ")) == b"hello world"


@pytest.mark.parametrize(
    "bad",
    [
        piece(3, 3),
        piece(-1, 3),
        piece(0, 0),
        piece(0, 10**9),
        piece("0", 3),
        piece(0, None),
        piece(0, 3, data=7),
        piece(0, 3, id=None),
        piece(0, 3, id=[]),
    ],
)
def test_senseless_pieces_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(Refused):
        Fragments(limit_bytes=100).add(bad)


def test_a_piece_that_contradicts_the_others_ends_them() -> None:
    fragments = Fragments(limit_bytes=100)
    fragments.add(piece(0, 2))
    with pytest.raises(Refused, match="does not fit"):
        fragments.add(piece(0, 2))
    assert fragments.add(piece(1, 2)) is None  # the first one is forgotten: this begins anew


def test_pieces_have_a_common_limit() -> None:
    fragments = Fragments(limit_bytes=100)
    fragments.add(piece(0, 3, "x" * 60, id="a"))
    with pytest.raises(Refused, match="more than 100 bytes"):
        fragments.add(piece(0, 3, "x" * 60, id="b"))
    assert fragments.add(piece(1, 3, "x", id="a")) is None


def test_the_oldest_unfinished_message_gives_way() -> None:
    fragments = Fragments(limit_bytes=100)
    for number in range(MOST_MESSAGES + 1):
        fragments.add(piece(0, 2, "x", id=number))
    assert fragments.add(piece(1, 2, "y", id=1)) == b"xy"
    assert fragments.add(piece(1, 2, "y", id=0)) is None  # was forgotten
