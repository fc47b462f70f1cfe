"""Report as CSV; `server.analysis` writes it."""

from __future__ import annotations

from server.recording.export.export_format import ExportFormat

FORMAT = ExportFormat(
    name="report_csv",
    label="Report as CSV",
    use="a row for each thing that happened in the drive",
    extension="report.csv",
    media_type="text/csv; charset=utf-8",
    writer="server.analysis.drive.tables:write_report_csv",
    options=("name",),
    of_drive=True,
    order=61,
)
