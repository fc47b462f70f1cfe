"""A virtual environment with rclpy for the tests of the guard; `python -m tests.vehicle.ros2_environment` makes it.

It is apart from the project's own, because some of its packages bring libraries of the same names as a ROS 2
installation. Its versions are those of ros2_packages.txt. Where it cannot be made, the tests are skipped.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

from tests.tree import PROJECT

ENVIRONMENT = PROJECT / ".venv-ros2"
PYTHON = ENVIRONMENT / "bin" / "python"
PACKAGES = Path(__file__).with_name("ros2_packages.txt")
READY = ENVIRONMENT / "ready"  # holds the digest of the packages that are installed
INSTALL_WITHIN_S = 300.0
IMPORT = "import rclpy, geometry_msgs.msg, std_msgs.msg; rclpy.init(); rclpy.create_node('test').destroy_node()"


def missing() -> str | None:
    """Why there is no rclpy here, as a skipped test gives it; None where it is ready."""
    if not READY.is_file() or READY.read_text() != _digest():
        return "rclpy is not installed: run `python -m tests.vehicle.ros2_environment`"
    return None


def install() -> str | None:
    """Makes the environment where it is not ready; answers why it cannot be, or None."""
    if missing() is None:
        return None
    shutil.rmtree(ENVIRONMENT, ignore_errors=True)
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet", "--no-input", "--only-binary", "ros-rclpy"]
    for command in (
        [sys.executable, "-m", "venv", str(ENVIRONMENT)],
        [*pip, "--requirement", str(PACKAGES)],
        [str(PYTHON), "-c", IMPORT],
    ):
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                check=False,
                stdin=subprocess.DEVNULL,
                timeout=INSTALL_WITHIN_S,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"{command[0]}: {error}"
        if done.returncode:
            return (done.stderr or done.stdout).strip().splitlines()[-1:][0] if done.stderr or done.stdout else "?"
    READY.write_text(_digest())
    return None


def _digest() -> str:
    return hashlib.sha256(PACKAGES.read_bytes() + sys.version.encode()).hexdigest()


def main() -> int:
    """Prints what became of it; 0 in any case, because the tests are skipped without it."""
    why = install()
    print(f"rclpy: {ENVIRONMENT}" if why is None else f"rclpy: not available, its tests are skipped ({why})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
