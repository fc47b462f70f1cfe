"""The report page of a drive; `server.analysis` draws it."""

from __future__ import annotations

from server.recording.export.export_format import ExportFormat

FORMAT = ExportFormat(
    name="html",
    label="Drive report",
    use="one page of the whole drive, works offline, prints on A4",
    extension="html",
    media_type="text/html; charset=utf-8",
    writer="server.analysis.drive_page:write_drive_page",
    options=("name",),
    of_drive=True,
    order=60,
)
