"""Every format a recording can be exported to, declared once: for the command line, the routes and the page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """One format. Its writer is loaded only when it is asked for."""

    name: str
    what: str  # in few words
    ending: str  # of the file's name
    media_type: str
    writer: str  # "module:function"; called with recording, path, progress and `options` by their names
    options: tuple[str, ...] = ()


FORMATS: dict[str, Form] = {
    form.name: form
    for form in (
        Form(
            name="bag",
            what="ROS 1 bag",
            ending="bag",
            media_type="application/x-rosbag",
            writer="server.recording.export.bag:write_bag",
            options=("compression", "with_own"),
        ),
        Form(
            name="ros2",
            what="ROS 2 bag, zipped",
            ending="ros2.zip",
            media_type="application/zip",
            writer="server.recording.export.ros2_bag:write_ros2_bag",
            options=("name", "with_own"),
        ),
        Form(
            name="csv",
            what="tables, zipped",
            ending="csv.zip",
            media_type="application/zip",
            writer="server.recording.export.csv_zip:write_csv_zip",
        ),
        Form(
            name="gpx",
            what="tracks, GPX 1.1",
            ending="gpx",
            media_type="application/gpx+xml",
            writer="server.recording.export.gpx:write_gpx",
        ),
        Form(
            name="geojson",
            what="tracks, GeoJSON",
            ending="geojson",
            media_type="application/geo+json",
            writer="server.recording.export.geojson:write_geojson",
        ),
        Form(
            name="html",
            what="one page with plots, works offline",
            ending="html",
            media_type="text/html; charset=utf-8",
            writer="server.analysis.drive_page:write_drive_page",
            options=("name",),
        ),
    )
}
CLIP = "mcap"  # the format of what is only cut out
