"""Set-up for ament (ROS 2) and for catkin_python_setup (ROS 1)."""

from setuptools import setup

setup(
    name="ocu_guard",
    version="0.1.0",
    packages=["ocu_guard"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/ocu_guard"]),
        ("share/ocu_guard", ["package.xml"]),
        ("share/ocu_guard/launch", ["launch/ocu_guard.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    entry_points={"console_scripts": ["ocu_guard_node = ocu_guard.ros2:main"]},
)
