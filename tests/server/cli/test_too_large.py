"""A recording that does not fit into the memory is named, and is not called damaged."""

from __future__ import annotations

import argparse
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

from server.cli import export, replay
from server.recording.read import read, recognise, rosbag1_truncated
from server.system.process_limits import TOO_LARGE


def too_large(*_: object, **__: object) -> NoReturn:
    raise MemoryError


@pytest.mark.parametrize(("command", "more"), [(replay, ["--port", "0"]), (export, ["--format", "csv"])])
def test_each_command_reports_it_in_one_sentence(
    command: ModuleType, more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    file = tmp_path / "drive.bag"
    file.write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "open_recording", too_large)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(file), *more])) == 2
    assert f"{file}: {TOO_LARGE}" in capsys.readouterr().err


def test_opening_does_not_take_it_for_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "drive.bag"
    file.write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setattr(recognise, "Bag1", too_large)
    monkeypatch.setattr(rosbag1_truncated, "is_cut", lambda _: False)
    with pytest.raises(MemoryError):
        read.open_recording([file])
