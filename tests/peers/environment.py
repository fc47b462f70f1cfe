"""Installs what only `make peers` needs, apart from the project's own: `python -m tests.peers.environment`.

PyPI's packages go to `.venv-peers`, npm's to `node_modules` of this folder, Debian's to the system where this user may
install them. What cannot be installed is printed; its suites are skipped with the reason.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

from tests.chromium import apt_install
from tests.peers.suites import SUITES, Suite
from tests.tree import PROJECT

HERE = Path(__file__).parent
PACKAGES = HERE / "packages.txt"
LOCK = HERE / "package-lock.json"
ENVIRONMENT = PROJECT / ".venv-peers"
PYTHON = ENVIRONMENT / "bin" / "python"
NODE_MODULES = HERE / "node_modules"
INSTALL_WITHIN_S = 900.0


def missing(suite: Suite) -> str | None:
    """Why a suite cannot run here, as a skipped test gives it; None where it can."""
    if suite.program and shutil.which(suite.program) is None:
        return f"{suite.program} is not installed (Debian: apt install {suite.of_debian})"
    if suite.registry == "Debian" or suite.is_project:
        return None
    made, wanted = (ENVIRONMENT, PACKAGES) if suite.registry == "PyPI" else (NODE_MODULES, LOCK)
    ready = made / "ready"
    if not ready.is_file() or ready.read_text() != _digest(wanted):
        return f"{suite.package} is not installed: run `python -m tests.peers.environment`"
    return None


@cache
def version(suite: Suite) -> str:
    """The version that runs; raises where the package is pinned nowhere."""
    if suite.registry == "Debian":
        query = ["dpkg-query", "--show", "--showformat", "${Version}", suite.package]
        found = subprocess.run(query, capture_output=True, text=True, check=False)
        return found.stdout or "?"
    if suite.registry == "npm":
        lock = PROJECT / "package-lock.json" if suite.is_project else LOCK
        return str(json.loads(lock.read_text())["packages"][f"node_modules/{suite.package}"]["version"])
    if suite.is_project:
        return importlib.metadata.version(suite.package)
    found_in = re.search(rf"^{re.escape(suite.package)}==(\S+)$", PACKAGES.read_text(), re.MULTILINE)
    assert found_in is not None, suite.package
    return found_in[1]


def install() -> list[str]:
    """Install what is not there. Returns a sentence for each part that cannot be."""
    absent = [one.of_debian for one in SUITES if one.program and shutil.which(one.program) is None]
    if absent:
        apt_install(*absent)
    venv = [sys.executable, "-m", "venv", str(ENVIRONMENT)]
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet", "--no-input", "--no-deps", "--requirement", str(PACKAGES)]
    npm = ["npm", "ci", "--silent", "--ignore-scripts", "--no-audit", "--no-fund", "--prefix", str(HERE)]
    return [why for why in (_made(ENVIRONMENT, PACKAGES, venv, pip), _made(NODE_MODULES, LOCK, npm)) if why]


def _made(folder: Path, wanted: Path, *commands: list[str]) -> str | None:
    """Makes the folder where it is not that of what is wanted; returns why it cannot be."""
    ready = folder / "ready"
    if ready.is_file() and ready.read_text() == _digest(wanted):
        return None
    shutil.rmtree(folder, ignore_errors=True)
    for command in commands:
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, timeout=INSTALL_WITHIN_S
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"{folder.name}: {error}"
        if done.returncode:
            return f"{folder.name}: {' '.join((done.stderr or done.stdout).split()[-40:])}"
    ready.write_text(_digest(wanted))
    return None


def _digest(wanted: Path) -> str:
    return hashlib.sha256(wanted.read_bytes() + sys.version.encode()).hexdigest()


def main() -> int:
    """Print what cannot be installed; 0 in any case, because those suites are skipped."""
    for why in install():
        print(f"peers: {why}")
    print("peers: " + ", ".join(f"{suite.name} {version(suite)}" for suite in SUITES if missing(suite) is None))
    return 0


if __name__ == "__main__":
    sys.exit(main())
