"""The report of a whole drive, as a page, for programs and as tables; `server.analysis` writes it."""

from __future__ import annotations

from server.recording.export.export_format import ExportFormat

HTML = ExportFormat(
    name="html",
    label="Drive report",
    use="one page of the whole drive, works offline, prints on A4",
    extension="html",
    media_type="text/html; charset=utf-8",
    writer="server.analysis.drive.drive_report:write_drive_page",
    options=("name",),
    of_drive=True,
    order=60,
)
CSV = ExportFormat(
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
JSON = ExportFormat(
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
FORMS = ExportFormat(
    name="forms",
    label="Authority's tables",
    use="disengagements and mileage, by the template files, zipped",
    extension="forms.zip",
    media_type="application/zip",
    writer="server.analysis.drive.form:write_forms",
    options=("name",),
    of_drive=True,
    order=63,
)
