"""The list of everybody else's work in catgraph as it is shipped, as CycloneDX 1.6 JSON: `python sbom.py OUT`.

Shipped are the Python packages that catgraph requires, at the versions in constraints.txt, and the npm packages whose
files are copied into static/vendor. What only builds or tests catgraph is not shipped and not listed.
"""

from __future__ import annotations

import base64
import json
import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import DisjunctiveLicense
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packageurl import PackageURL
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = Path(__file__).parent
# Shipped only for another system than the one the list is made on; they stand in it all the same.
_ENVIRONMENTS = ({"sys_platform": "linux", "extra": ""}, {"sys_platform": "darwin", "extra": ""})


def bill() -> Bom:
    """What is shipped. Raises LookupError for a package without a pin."""
    about = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bom = Bom()
    root = Component(
        name=about["name"],
        version=about["version"],
        type=ComponentType.APPLICATION,
        bom_ref=about["name"],
        licenses=[DisjunctiveLicense(id=about["license"])],
    )
    bom.metadata.component = root
    parts: dict[str, Component] = {}
    _python(about["dependencies"], pins(), parts)
    needed = {canonicalize_name(Requirement(text).name) for text in about["dependencies"]}
    for name, part in parts.items():
        bom.components.add(part)
        bom.register_dependency(part, [parts[one] for one in sorted(_needs(name)) if one in parts])
    page = list(_of_page())
    for part in page:
        bom.components.add(part)
        bom.register_dependency(part)
    bom.register_dependency(root, [*(parts[one] for one in sorted(needed) if one in parts), *page])
    return bom


def pins() -> dict[str, str]:
    """Package → version, as it is pinned."""
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").split()
    return {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}


def _python(wanted: list[str], pinned: dict[str, str], parts: dict[str, Component]) -> None:
    waiting = [canonicalize_name(Requirement(text).name) for text in wanted if _counts(text)]
    while waiting:
        name = waiting.pop()
        if name in parts:
            continue
        if name not in pinned:
            raise LookupError(f"{name} is shipped and has no pin")
        parts[name] = Component(
            name=name,
            version=pinned[name],
            type=ComponentType.LIBRARY,
            bom_ref=f"pypi:{name}",
            purl=PackageURL("pypi", None, name, pinned[name]),
            licenses=[DisjunctiveLicense(name=words)] if (words := _license(name)) else None,
        )
        waiting += _needs(name)


def _needs(name: str) -> set[str]:
    """What an installed package requires; nothing for one that is only for another system."""
    try:
        told = metadata.distribution(name).requires or []
    except metadata.PackageNotFoundError:
        return set()
    return {canonicalize_name(Requirement(text).name) for text in told if _counts(text)}


def _counts(text: str) -> bool:
    marker = Requirement(text).marker
    return marker is None or any(marker.evaluate(where) for where in _ENVIRONMENTS)


def _license(name: str) -> str:
    try:
        about = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return ""
    words = next((about[key].strip() for key in ("License-Expression", "License") if key in about), "")
    if words and len(words) <= 80 and "\n" not in words:
        return str(words)
    kinds = [
        one.rsplit("::", 1)[1].strip() for one in about.get_all("Classifier") or [] if one.startswith("License ::")
    ]
    return ", ".join(kinds)


def _of_page() -> list[Component]:
    """The npm packages of which files are copied, with the hash that npm holds them to."""
    told: dict[str, Any] = json.loads((PROJECT / "package.json").read_text(encoding="utf-8"))
    lock: dict[str, Any] = json.loads((PROJECT / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    found = []
    for name in sorted({source.partition("/")[0] for source in told["vendor"]}):
        entry = lock[f"node_modules/{name}"]
        kind, _, digest = entry["integrity"].partition("-")
        found.append(
            Component(
                name=name,
                version=entry["version"],
                type=ComponentType.LIBRARY,
                bom_ref=f"npm:{name}",
                purl=PackageURL("npm", None, name, entry["version"]),
                hashes=[HashType(alg=_ALGORITHM[kind], content=base64.b64decode(digest).hex())],
                licenses=[DisjunctiveLicense(id=entry["license"])] if _is_spdx(entry.get("license", "")) else None,
            )
        )
    return found


_ALGORITHM = {"sha512": HashAlgorithm.SHA_512, "sha384": HashAlgorithm.SHA_384, "sha256": HashAlgorithm.SHA_256}


def _is_spdx(text: str) -> bool:
    return re.fullmatch(r"[A-Za-z0-9.+-]+", text) is not None


def main(out: Path) -> int:
    """Writes the list; 1 where it does not keep its schema."""
    text = JsonV1Dot6(bill()).output_as_string(indent=2)
    fault = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    if fault is not None:
        print(f"The list does not keep the schema of CycloneDX: {fault!r}", file=sys.stderr)
        return 1
    out.write_text(f"{text}\n", encoding="utf-8")
    print(f"{out}: {len(json.loads(text)['components'])} parts")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
