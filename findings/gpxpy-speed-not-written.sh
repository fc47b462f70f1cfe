#!/bin/sh
# gpxpy 1.6.2 (PyPI).
#
# What a good engineer would guess: a track point that was given a speed and a course keeps both in the file, or writing
# it fails. `GPXTrackPoint(speed=…)` is a documented argument.
#
# What is seen: `to_xml()` writes GPX 1.1 by default, whose schema has no `speed` and no `course` for a point, and leaves
# both out without an error or a warning. `to_xml(version="1.0")` writes them. So a speed that is read from a GPX 1.0
# file is lost by reading and writing it with another version.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check gpxpy==1.6.2 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
import warnings
from datetime import datetime, timezone
from importlib.metadata import version

import gpxpy
from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment

warnings.simplefilter("error")
point = GPXTrackPoint(48.0, 11.0, elevation=500.0, time=datetime(2026, 1, 1, tzinfo=timezone.utc), speed=3.5)
point.course = 90.0
drive = GPX()
drive.tracks.append(GPXTrack())
drive.tracks[0].segments.append(GPXTrackSegment([point]))


def read_back(**options):
    """Speed and course of the point after it was written and read."""
    again = gpxpy.parse(drive.to_xml(**options)).tracks[0].segments[0].points[0]
    return again.speed, again.course


print(f"gpxpy {version('gpxpy')}")
default, old = read_back(), read_back(version="1.0")
print(f"  written by default:  speed {default[0]}, course {default[1]}")
print(f"  written as GPX 1.0:  speed {old[0]}, course {old[1]}")
holds = default == (None, None) and old == (3.5, 90.0)
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
