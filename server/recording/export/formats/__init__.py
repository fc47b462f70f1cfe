"""Finds every export format: one file of this package each."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from server.recording.export.export_format import ExportFormat

CLIP = "mcap"  # the format of what is only cut out


def load() -> dict[str, ExportFormat]:
    """Every format by its name, in the order of the page; raises ValueError where two have one name."""
    found: dict[str, ExportFormat] = {}
    for module in iter_modules(__path__):
        export_format: ExportFormat = import_module(f"{__name__}.{module.name}").FORMAT
        if export_format.name in found or export_format.name == CLIP:
            raise ValueError(f"two export formats are named {export_format.name}")
        found[export_format.name] = export_format
    return dict(sorted(found.items(), key=lambda item: (item[1].order, item[0])))


FORMATS = load()
