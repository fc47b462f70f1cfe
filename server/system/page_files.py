"""Paths of the page's files, and whether the third-party files exist and are current.

The build hook loads this file by its path, so that the stamp is defined once: standard library only.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

STAMP = "stamp"  # in static/vendor, written last: what was copied there, and for which package.json
_PACKAGE = Path(__file__).resolve().parents[1]
_PROJECT = _PACKAGE.parent


class AssetsMissing(Exception):
    """The page cannot be served as it should be; the text is one sentence for a person."""


def static_dir() -> Path:
    """The folder of scripts, styles and fonts: inside the installed package, else in the project's root."""
    return _beside("static")


def templates_dir() -> Path:
    """The folder of jinja2 templates: inside the installed package, else in the project's root."""
    return _beside("templates")


def check_vendor() -> None:
    """Raise AssetsMissing when static/vendor is absent, incomplete or made for another package.json."""
    project = None if (_PACKAGE / "static").is_dir() else _PROJECT
    problem = vendor_problem(static_dir() / "vendor", project)
    if problem:
        raise AssetsMissing(problem)


def vendor_problem(vendor: Path, project: Path | None) -> str | None:
    """What is wrong with the folder `vendor`, as one sentence, or None.

    `project` is the folder of package.json; None for an installed package, whose copy was complete when it was built.
    """
    remedy = "run `make demo` or `pip install -e .` in the project's folder, which fetches it"
    try:
        digest, *names = (vendor / STAMP).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return f"The third-party part of the page is missing from {vendor}: {remedy}."
    if project is not None and digest != digest_of(project):
        return f"The third-party part of the page in {vendor} is older than package.json: {remedy}."
    lost = [name for name in names if not (vendor / name).is_file()]
    if lost:
        return f"The third-party part of the page lacks {', '.join(lost)} in {vendor}: {remedy}."
    return None


def write_stamp(vendor: Path, project: Path) -> None:
    """Declare the files now in `vendor` complete for the package.json in `project`."""
    files = (path.relative_to(vendor).as_posix() for path in vendor.rglob("*") if path.is_file())
    names = sorted(name for name in files if name != STAMP)
    (vendor / STAMP).write_text("\n".join([digest_of(project), *names]) + "\n", encoding="utf-8")


def digest_of(project: Path) -> str:
    """Hash of the inputs of static/vendor; file times are useless after a clone or a copy."""
    digest = hashlib.sha256()
    for name in ("package.json", "package-lock.json"):
        digest.update((project / name).read_bytes())
    return digest.hexdigest()


def _beside(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PROJECT / name
