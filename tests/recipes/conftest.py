"""The copy with all recipes applied, and a drive that shows what they add."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recipes.project_copy import RECIPES, ProjectCopy
from tests.server.recording.bags import Drive, Row, write_ros1


@pytest.fixture(scope="package")
def plain(tmp_path_factory: pytest.TempPathFactory) -> ProjectCopy:
    """The copy, whose index holds the project without recipes."""
    return ProjectCopy(tmp_path_factory.mktemp("project") / "catgraph")


@pytest.fixture(scope="package")
def extended(plain: ProjectCopy) -> ProjectCopy:
    """The copy with all recipes applied, and what is made from declarations made anew, as the recipes say."""
    for recipe in sorted(RECIPES.glob("*.patch")):
        plain.git("apply", "-C1", str(recipe))  # the index stays as it is
    plain.run("server.protocol.reference", "--write")
    plain.run("tests.monitor.checks.test_findings")
    return plain


@pytest.fixture(scope="package")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ROS 1 bag of 20 s: north at 5 m/s, the steering at 95 % and the oil ever hotter."""
    rows: list[Row] = []
    for n in range(400):
        rows += [
            (n / 20, "/catvehicle/vel", "geometry_msgs/msg/Twist", {"linear": {"x": 5.0}}),
            (n / 20, "/catvehicle/brake", "geometry_msgs/msg/Wrench", {"force": {"x": 0.0}}),  # so it is the real car
            (n / 20, "/catvehicle/steering", "geometry_msgs/msg/Wrench", {"torque": {"z": -95.0}}),
            (n / 20, "/oil_temperature", "std_msgs/msg/Float32", {"data": 80.0 + n / 20}),
        ]
    for n in range(200):
        fix = {"status": {"status": 0}, "latitude": 32.23 + n * 0.5 / 111_000, "longitude": -110.95}
        rows.append((n / 10, "/gps_fix", "sensor_msgs/msg/NavSatFix", fix))
    rows.sort(key=lambda row: row[0])
    return write_ros1(tmp_path_factory.mktemp("drive") / "drive.bag", Drive(messages=rows))
