"""Scenarios by typing."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from server.simulator.console import Console, run_line
from server.simulator.scenarios import SCENARIOS
from server.simulator.service import CarService


def running(service: CarService) -> set[str]:
    return {row["name"] for row in service.state()["scenarios"] if row["state"] == "running"}


def test_lines_start_and_stop_scenarios() -> None:
    service = CarService()
    assert run_line(service, "speeding") == "speeding started."
    assert run_line(service, "  Slow-Rate 20 \r") == "slow-rate started for 20 s."
    assert running(service) == {"speeding", "slow-rate"}
    assert "[20 s left]" in run_line(service, "list")
    assert run_line(service, "stop speeding") == "speeding stopped."
    assert run_line(service, "STOP") == "All scenarios stopped."
    assert running(service) == set()


def test_the_list_names_every_scenario_with_its_sentence() -> None:
    listing = run_line(CarService(), "list")
    for scenario in SCENARIOS.values():
        assert scenario.name in listing
        assert scenario.sentence in listing


@pytest.mark.parametrize(
    "line", ["nope", "stop nope", "speeding fast", "speeding -3", "speeding nan", "a b c d", "\x00\x1b[2J", "x" * 9999]
)
def test_what_is_not_understood_is_answered_and_harms_nothing(line: str) -> None:
    service = CarService()
    answer = run_line(service, line)
    assert answer
    assert len(answer) < 600
    assert running(service) == set()


def test_an_empty_line_has_no_answer() -> None:
    assert run_line(CarService(), "  \n") == ""


async def answers_to(service: CarService, file: int, pieces: list[bytes], write: int | None) -> list[str]:
    answers: list[str] = []
    console = Console(service, file, answers.append)
    console.open()
    try:
        for piece in pieces:
            assert write is not None
            os.write(write, piece)
            await asyncio.sleep(0.02)
        await asyncio.sleep(0.02)
    finally:
        console.close()
    return answers


@pytest.mark.virtual_time
async def test_lines_come_through_a_pipe_in_any_pieces() -> None:
    read, write = os.pipe()
    service = CarService()
    try:
        answers = await answers_to(service, read, [b"spee", b"ding\nslow-", b"rate\n\xff\xfe\n"], write)
    finally:
        os.close(read)
        os.close(write)
    assert answers[:2] == ["speeding started.", "slow-rate started."]
    assert len(answers) == 3
    assert running(service) == {"speeding", "slow-rate"}


@pytest.mark.virtual_time
async def test_an_endless_line_is_not_kept() -> None:
    read, write = os.pipe()
    try:
        answers = await answers_to(CarService(), read, [b"x" * 4096] * 4, write)
    finally:
        os.close(read)
        os.close(write)
    assert answers, "it is answered before it ends"


@pytest.mark.virtual_time
async def test_the_end_of_the_input_ends_the_listening() -> None:
    read, write = os.pipe()
    os.write(write, b"speeding\nstop")
    os.close(write)
    try:
        answers = await answers_to(CarService(), read, [], None)
    finally:
        os.close(read)
    assert answers[:1] == ["speeding started."]


@pytest.mark.virtual_time
async def test_a_file_is_read_and_dev_null_does_no_harm(tmp_path: Path) -> None:
    script = tmp_path / "script"
    script.write_bytes(b"speeding\n")
    for path, expected in ((script, ["speeding started."]), (Path(os.devnull), [])):
        file = os.open(path, os.O_RDONLY)
        try:
            assert await answers_to(CarService(), file, [], None) == expected
        finally:
            os.close(file)
