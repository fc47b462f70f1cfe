"""Names of topics that are not recorded: a car may give any text for one."""

from __future__ import annotations

import json

import pytest

from server.others import LONGEST_NAME, Missing


@pytest.mark.world(n=4)
def test_names_that_are_cut_are_counted() -> None:
    missing = Missing(
        left_out=tuple(f"/camera_{n}" for n in range(700)), not_received={"/imu": ()}, too_large={"/map": 2**25}
    )
    state, metadata = missing.as_json(), missing.as_metadata()
    assert (len(state["left_out"]), state["left_out_count"]) == (20, 701)
    assert (state["not_received_count"], state["too_large_count"]) == (1, 1)
    assert (len(metadata["left_out"].split("\n")), metadata["left_out_count"]) == (500, "701")
    assert metadata["not_received_count"] == "1"


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
