"""For colcon: ros2 run biotac_ros2 node."""

from setuptools import setup

NAME = "biotac_ros2"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    license="MIT",
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
