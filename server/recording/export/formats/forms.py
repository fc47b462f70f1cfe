"""Authority's tables; `server.analysis` writes it."""

from __future__ import annotations

from server.recording.export.export_format import ExportFormat

FORMAT = ExportFormat(
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
