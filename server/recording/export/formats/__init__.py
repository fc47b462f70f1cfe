"""Finds every export format that a file of this package declares."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from server.recording.export.export_format import ExportFormat

CLIP = "mcap"  # the format of what is only cut out


def load() -> dict[str, ExportFormat]:
    """Every format by its name, in the order of the page; raises ValueError where two have one name."""
    found: dict[str, ExportFormat] = {}
    for module in iter_modules(__path__):
        declared = vars(import_module(f"{__name__}.{module.name}")).values()
        for export_format in (value for value in declared if isinstance(value, ExportFormat)):
            if export_format.name in found or export_format.name == CLIP:
                raise ValueError(f"two export formats are named {export_format.name}")
            found[export_format.name] = export_format
    return dict(sorted(found.items(), key=lambda item: (item[1].order, item[0])))


FORMATS = load()
