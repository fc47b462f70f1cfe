"""The list of what is shipped: it keeps its schema, is complete, and has what is pinned."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from server.web.routes.about import parts
from tests.tree import PROJECT


@pytest.fixture(scope="module")
def bill(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("sbom") / "catgraph.cdx.json"
    done = subprocess.run([sys.executable, "sbom.py", out], cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out.read_text(encoding="utf-8")


def test_it_keeps_the_schema(bill: str) -> None:
    from cyclonedx.schema import SchemaVersion  # takes two seconds, which every other test process is spared
    from cyclonedx.validation.json import JsonStrictValidator

    validator = JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(bill) is None
    broken = json.loads(bill) | {"components": [{"name": "x"}]}
    assert validator.validate_str(json.dumps(broken)) is not None


def test_every_part_has_a_version_that_is_pinned_and_an_address(bill: str) -> None:
    document: dict[str, Any] = json.loads(bill)
    pinned = (PROJECT / "constraints.txt").read_text(encoding="utf-8").split()
    pins = {canonicalize_name(line.partition("==")[0]): line.partition("==")[2] for line in pinned}
    lock = json.loads((PROJECT / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for part in document["components"]:
        kind = part["purl"].partition(":")[2].partition("/")[0]
        if kind == "pypi":
            assert part["version"] == pins[part["name"]]
        else:
            assert kind == "npm"
            assert part["version"] == lock[f"node_modules/{part['name']}"]["version"]
            assert part["hashes"][0]["alg"] == "SHA-512"
            assert len(part["hashes"][0]["content"]) == 128
        assert part["purl"].endswith(f"/{part['name']}@{part['version']}")


def test_it_lists_what_is_required_what_is_copied_and_what_the_page_tells(bill: str) -> None:
    document = json.loads(bill)
    names = {part["name"] for part in document["components"]}
    about = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {canonicalize_name(Requirement(text).name) for text in about["dependencies"]} <= names
    package = json.loads((PROJECT / "package.json").read_text(encoding="utf-8"))
    assert {source.partition("/")[0] for source in package["vendor"]} <= names
    shown = {canonicalize_name(part.name) for part in parts(PROJECT / "static" / "vendor")}
    assert shown <= names, "About lists a part that the list lacks"
    assert not {"pytest", "mypy", "playwright", "typescript", "schemathesis"} & names, "what only tests is not shipped"
    refs = {one["ref"] for one in document["dependencies"]}
    assert {part["bom-ref"] for part in document["components"]} <= refs
