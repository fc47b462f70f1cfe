"""Names of topics that are not recorded: a car may give any text for one."""

from __future__ import annotations

import json

import pytest

from server.recording.recorded_topics import LONGEST_NAME, Missing


@pytest.mark.world(n=24)
def test_a_name_of_a_million_letters_is_cut_and_one_of_two_lines_stays_one_line() -> None:
    long, forged = "/" + "m" * 1_000_000, "/a\nb\x1b[31m"
    missing = Missing(left_out=(long, forged), not_received={long: ()}, too_large={long + "x": 2**25})
    assert len(json.dumps(missing.as_json())) < 8 * LONGEST_NAME
    assert all(len(name) <= LONGEST_NAME for name in missing.as_json()["left_out"])
    lines = missing.as_metadata()["left_out"].split("\n")
    assert len(lines) == 3
    assert "\x1b" not in lines[1]
    assert len("".join(lines)) < 4 * LONGEST_NAME
