"""Runs the benchmarks: ``python benchmarks/run.py [SECTION ...] [--quick]`` prints tables in Markdown."""

from __future__ import annotations

import argparse
import datetime
import os
import platform
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

SECTIONS = (
    "engines",
    "sizes",
    "files",
    "startup",
    "boundary",
    "altitudes",
    "surfaces",
    "targets",
    "layers",
    "untangle",
    "quality",
    "generation",
    "tools",
    "solvers",
    "distributed",
)
_PACKAGES = (
    "dvr-cli",
    "numpy",
    "numba",
    "meshio",
    "gmsh",
    "netgen-mesher",
    "vtk",
    "scipy",
    "scikit-fem",
    "tetgen",
)


def main() -> None:
    """Run the sections named on the command line, by default all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "sections", nargs="*", metavar="SECTION", help=f"of {', '.join(SECTIONS)}; default all"
    )
    parser.add_argument("--quick", action="store_true", help="small meshes, to see that everything runs")
    arguments = parser.parse_args()
    unknown = set(arguments.sections) - set(SECTIONS)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; sections are {', '.join(SECTIONS)}")
    print(f"{datetime.date.today()}; {_machine()}; {', '.join(_versions())}")
    for name in arguments.sections or SECTIONS:
        import_module(name).run(arguments.quick)


def _machine() -> str:
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def _versions() -> list[str]:
    found = []
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"no {package}")
    return found


if __name__ == "__main__":
    main()
