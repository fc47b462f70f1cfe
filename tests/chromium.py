"""Finds a Chromium for the page's tests; `python -m tests.chromium` installs one where there is none."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",  # as root and in containers Chromium's own sandbox cannot start
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


class NoChromium(Exception):
    """No browser to test with; the text has the remedy."""


def find_chromium() -> str:
    """The path of a Chromium that starts: $CATGRAPH_CHROMIUM, the system's, or Playwright's own. Raises NoChromium."""
    named = os.environ.get("CATGRAPH_CHROMIUM")
    if named:
        if _starts(named):
            return named
        raise NoChromium(f"CATGRAPH_CHROMIUM names {named}, which does not start.")
    broken = []
    for path in _candidates():
        if _starts(path):
            return path
        broken.append(path)
    found = f" ({', '.join(broken)} does not start)" if broken else ""
    raise NoChromium(
        f"No Chromium for the tests{found}: run `python -m tests.chromium`, or name one in CATGRAPH_CHROMIUM."
    )


def install_chromium() -> None:
    """Install one: from the system's packages as root on Debian, else Playwright's build in the user's cache."""
    if _is_debian() and apt_install("chromium", "fonts-dejavu-core", "fonts-roboto-unhinted", "libatomic1"):
        return
    command = [sys.executable, "-m", "playwright", "install", "chromium"]
    if _has_apt():
        command.insert(-1, "--with-deps")
    subprocess.run(command, check=False, stdin=subprocess.DEVNULL)


def check_driver() -> None:
    """Make sure that Playwright's own Node starts: it needs a library that a bare system lacks. Raises NoChromium."""
    if not _driver_starts():
        apt_install("libatomic1")
        if not _driver_starts():
            raise NoChromium(
                "Playwright does not start on this machine: install libatomic1 with the system's packages."
            )


def bring_readers() -> None:
    """Install what some tests look with, where it can be; a test that lacks it is skipped, with the reason."""
    packages = {"certutil": "libnss3-tools", "zbarimg": "zbar-tools"}
    missing = [package for command, package in packages.items() if shutil.which(command) is None]
    if missing:
        apt_install(*missing)


def _driver_starts() -> bool:
    command = [sys.executable, "-m", "playwright", "--version"]
    return subprocess.run(command, capture_output=True, check=False, stdin=subprocess.DEVNULL).returncode == 0


def _has_apt() -> bool:
    return os.geteuid() == 0 and shutil.which("apt-get") is not None


def apt_install(*packages: str) -> bool:
    """Whether they are there now; False where apt is not ours to use."""
    if not _has_apt():
        return False
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    install = ["apt-get", "install", "-q", "-y", "--no-install-recommends", *packages]
    subprocess.run(["apt-get", "update", "-q"], check=False, env=quiet, stdin=subprocess.DEVNULL)
    return subprocess.run(install, check=False, env=quiet, stdin=subprocess.DEVNULL).returncode == 0


def _candidates() -> Iterator[str]:
    yield from filter(None, map(shutil.which, NAMES))
    cache = Path(os.environ.get("PLAYWRIGHT_BROWSERS_PATH") or Path.home() / ".cache" / "ms-playwright")
    yield from map(str, sorted(cache.glob("chromium-*/chrome-linux*/chrome"), reverse=True))


def _starts(path: str) -> bool:
    """Does it draw an empty page? Ubuntu's chromium-browser may be a stub without its snap, and libraries may lack."""
    try:
        done = subprocess.run(
            [path, *FLAGS, "--dump-dom", "about:blank"],
            capture_output=True,
            check=False,
            timeout=60,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and b"<body>" in done.stdout


def _is_debian() -> bool:
    """Not Ubuntu, whose chromium package only points at a snap."""
    try:
        lines = Path("/etc/os-release").read_text(encoding="utf-8").splitlines()
    except OSError:
        return False
    return "ID=debian" in lines


def main() -> int:
    """Print the path of the Chromium to use, after installing one where needed; 1 with a sentence where none can be."""
    try:
        path = _found_or_installed()
        check_driver()
        bring_readers()
    except NoChromium as why:
        print(why, file=sys.stderr)
        return 1
    print(f"Chromium: {path}")
    return 0


def _found_or_installed() -> str:
    try:
        return find_chromium()
    except NoChromium:
        if os.environ.get("CATGRAPH_CHROMIUM"):
            raise
    install_chromium()
    try:
        return find_chromium()
    except NoChromium:
        raise NoChromium(
            "No Chromium could be installed for the page's tests: install one with the system's packages (or as root "
            "`playwright install-deps chromium`, for the libraries it lacks), or name one in CATGRAPH_CHROMIUM."
        ) from None


if __name__ == "__main__":
    sys.exit(main())
