#!/usr/bin/python3
"""package.xml names what the package needs: what CMake looks for, what headers include, what scripts and tests import."""
from __future__ import annotations

import re
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Dict, Iterable, Set

import rospkg

ROOT = Path(__file__).resolve().parents[2]
# Where the name is another one in package.xml.
NAMES = {"Boost": "boost", "Eigen3": "eigen", "MRPT": "mrpt2", "PkgConfig": "pkg-config", "nanoflann": "libnanoflann-dev",
         "gmock": "google-mock", "gtest_main": "gtest", "matplotlib": "python3-matplotlib", "mrpt": "mrpt2",
         "numpy": "python3-numpy", "ros": "roscpp", "scipy": "python3-scipy", "yaml": "python3-yaml",
         "pytest": "python3-pytest"}
OPTIONAL = {"benchmark"}
OWN = "sckf_odometry"


def declared() -> Dict[str, Set[str]]:
    """The names by the kind of dependency; depend is each but the test's."""
    kinds: Dict[str, Set[str]] = {"buildtool_depend": set(), "build_depend": set(), "build_export_depend": set(),
                                  "exec_depend": set(), "test_depend": set()}
    for element in ElementTree.parse(ROOT / "package.xml").getroot():
        if element.tag == "depend":
            for kind in ("build_depend", "build_export_depend", "exec_depend"):
                kinds[kind].add(element.text or "")
        elif element.tag in kinds:
            kinds[element.tag].add(element.text or "")
    return kinds


def named(names: Iterable[str]) -> Set[str]:
    return {NAMES.get(name, name) for name in names} - OPTIONAL - {OWN}


def imported(files: Iterable[Path]) -> Set[str]:
    """Modules of ROS packages, and those that NAMES has."""
    known = set(rospkg.RosPack().list()) | NAMES.keys()
    found: Set[str] = set()
    for file in files:
        found.update(re.findall(r"^(?:import|from) (\w+)", file.read_text(encoding="utf-8"), re.MULTILINE))
    return named(found & known)


def scripts() -> Iterable[Path]:
    return [path for path in (ROOT / "scripts").iterdir()
            if path.suffix == ".py" or path.is_file() and path.read_bytes().startswith(b"#!/usr/bin/python3")]


class PackageXml(unittest.TestCase):
    def check(self, needed: Set[str], *kinds: str) -> None:
        self.assertGreater(len(needed), 3)
        self.assertEqual(needed - set().union(*(declared()[kind] for kind in kinds)), set())

    def test_what_cmake_looks_for(self) -> None:
        text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
        components = re.search(r"find_package\(catkin REQUIRED COMPONENTS([^)]*)\)", text)
        assert components is not None
        found = re.findall(r"^ *find_package\((\w+)", text, re.MULTILINE)
        self.check(named([*components[1].split(), *found]), "buildtool_depend", "build_depend")
        tests = (ROOT / "test" / "CMakeLists.txt").read_text(encoding="utf-8")
        modules = re.search(r"pkg_check_modules\(GOOGLETEST REQUIRED IMPORTED_TARGET ([^)]*)\)", tests)
        assert modules is not None
        found = re.findall(r"^ *find_package\((\w+)", tests, re.MULTILINE)
        self.check(named([*modules[1].split(), *found, "pytest"]), "test_depend")

    def test_what_installed_headers_include(self) -> None:
        found = set()
        for header in (ROOT / "include").rglob("*.h"):
            found.update(re.findall(r"^#include <(\w+)/", header.read_text(encoding="utf-8"), re.MULTILINE))
        self.check(named({"Eigen3" if name == "Eigen" else name for name in found}), "build_export_depend")

    def test_what_scripts_import(self) -> None:
        self.check(imported(scripts()), "exec_depend")

    def test_what_tests_import(self) -> None:
        self.check(imported((ROOT / "test").rglob("*.py")), "exec_depend", "test_depend")

    def test_what_launch_files_need(self) -> None:
        """But for those of an example's robot, which it has."""
        text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "launch").glob("*.launch"))
        needed = named(re.findall(r'pkg="(\w+)"', text)) | {"roslaunch"}
        self.assertEqual(needed - declared()["exec_depend"], set())


if __name__ == "__main__":
    unittest.main()
