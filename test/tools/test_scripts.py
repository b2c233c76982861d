#!/usr/bin/python3
"""The scripts that a person runs: executable, free of what shellcheck finds, and helpful when called wrongly."""
from __future__ import annotations

import fnmatch
import os
import re
import shutil
import subprocess
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import List

ROOT = Path(__file__).resolve().parents[2]
ALL_REPEAT = {"test_batch_solution.cpp"}  # a comparison with what no robot runs


def scripts(interpreter: str) -> List[Path]:
    """The files in scripts/ and .ci/ whose first line names the interpreter."""
    files = [path for folder in ("scripts", ".ci") for path in sorted((ROOT / folder).iterdir()) if path.is_file()]
    return [path for path in files if path.read_bytes().split(b"\n", 1)[0] == b"#!" + interpreter.encode()]


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(each) for each in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True, check=False)


class ScriptsTest(unittest.TestCase):
    def test_all_are_there(self) -> None:
        names = {path.name for path in scripts("/bin/bash") + scripts("/usr/bin/python3")}
        self.assertLessEqual({"setup", "demo", "test", "run", "calibrate_odometry", "evaluate", "pairs", "plot",
                              "run_tests"}, names)

    def test_every_script_is_executable(self) -> None:
        for path in scripts("/bin/bash") + scripts("/usr/bin/python3"):
            self.assertTrue(os.access(path, os.X_OK), path)

    def test_bash_scripts_are_sound(self) -> None:
        for path in scripts("/bin/bash"):
            self.assertIn("set -euo pipefail", path.read_text(encoding="utf-8"), path)
            done = run("bash", "-n", path)
            self.assertEqual(done.returncode, 0, done.stdout)

    @unittest.skipUnless(shutil.which("shellcheck"), "shellcheck is not installed")
    def test_shellcheck_finds_nothing(self) -> None:
        done = run("shellcheck", *scripts("/bin/bash"))
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_python_scripts_explain_themselves(self) -> None:
        for path in scripts("/usr/bin/python3"):
            done = run(path, "--help")
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertIn("usage:", done.stdout)

    def test_python_scripts_run_through_catkins_wrappers(self) -> None:
        """In the devel space another file executes them, with __file__ set to the script but not the search path."""
        wrapper = "import sys; path = sys.argv.pop(1); exec(compile(open(path).read(), path, 'exec'), " \
                  "{'__file__': path, '__name__': '__main__', '__doc__': None})"
        for path in scripts("/usr/bin/python3"):
            done = run("/usr/bin/python3", "-B", "-c", wrapper, path, "--help")
            self.assertEqual(done.returncode, 0, done.stdout)

    def test_a_wrong_argument_is_refused_before_anything_is_done(self) -> None:
        for name in ("setup", "test"):
            done = run(ROOT / "scripts" / name, "--nonsense")
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("unknown argument --nonsense", done.stdout)

    def test_what_is_left_out_under_sanitizers_is_there(self) -> None:
        """And never all tests of a file: what it is about runs there."""
        lists = (ROOT / "test" / "CMakeLists.txt").read_text(encoding="utf-8")
        repeats = re.search(r"set\(REPEATS\n([^)]*)\)", lists)
        assert repeats is not None
        left_out = {name.split("/")[0]: "/" in name for name in repeats[1].split()}
        self.assertGreater(len(left_out), 30)
        unknown = set(left_out)
        for file in sorted((ROOT / "test").rglob("test_*.cpp")):
            tests = re.findall(r"^TEST(?:_F|_P)?\((\w+), (\w+)\)", file.read_text(encoding="utf-8"), re.MULTILINE)
            names = {f"{suite}.{name}" for suite, name in tests}
            found = {pattern for pattern in left_out if fnmatch.filter(names, pattern)}
            unknown -= found
            gone = {name for pattern in found if not left_out[pattern] for name in fnmatch.filter(names, pattern)}
            self.assertTrue(names - gone or file.name in ALL_REPEAT, file)
        self.assertEqual(unknown, set())

    def test_the_demos_launch_file_is_xml(self) -> None:
        self.assertEqual(ElementTree.parse(ROOT / "scripts" / "demo.launch").getroot().tag, "launch")


if __name__ == "__main__":
    unittest.main()
