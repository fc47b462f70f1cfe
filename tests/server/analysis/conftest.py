"""A drive of the simulated car on disk, and the command that checks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.cli.main import main
from server.simulator.car import SimulatedCar
from tests.server.recording.bags import BEGIN_S, Drive, write_ros2

SECONDS = 24.0


def recorded(path: Path, seconds: float = SECONDS, **options: Any) -> Path:
    """A healthy drive of the simulated car as a ROS 2 bag."""
    car = SimulatedCar(seed=3, ros_version=2, start_s=BEGIN_S, **options)
    rows = []
    for step in car.steps():
        if step.at_s - BEGIN_S > seconds:
            break
        rows += [(one.at_s - BEGIN_S, one.topic, one.type, dict(one.message)) for one in step.messages]
    return write_ros2(path, Drive(messages=rows))


@pytest.fixture(scope="session")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("drive") / "healthy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return orjson.loads(self.out)

    def raised(self) -> list[str]:
        """Alarms of a run with `--json -`, each once, in the order in which they came."""
        return list(dict.fromkeys(alarm["alarm"] for alarm in self.json["alarms"]))


Checking = Callable[..., Ending]


@pytest.fixture
def check(capsys: pytest.CaptureFixture[str]) -> Checking:
    """`catgraph check` with these arguments."""

    def run(*arguments: object) -> Ending:
        capsys.readouterr()
        try:
            code = main(["check", *map(str, arguments)])
        except SystemExit as end:
            code = int(end.code or 0)
        printed = capsys.readouterr()
        return Ending(code=code, out=printed.out, err=printed.err)

    return run
