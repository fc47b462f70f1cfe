"""Report as JSON; `server.analysis` writes it."""

from __future__ import annotations

from server.recording.export.export_format import ExportFormat

FORMAT = ExportFormat(
    name="report_json",
    label="Report as JSON",
    use="for programs: everything in the drive's report",
    extension="report.json",
    media_type="application/json",
    writer="server.analysis.drive.tables:write_report_json",
    options=("name",),
    of_drive=True,
    order=62,
)
