"""Scripts of the package, run as a person runs them, on bags and files in a folder that is gone afterwards.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import os
import subprocess
import tempfile
import unittest
from pathlib import Path
from typing import Dict

import rosbag

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("SCKF_BIN_DIR", ROOT / "build" / "devel" / "lib" / "sckf_odometry"))


def rename_topics(bag: str, output: str, names: Dict[str, str]) -> None:
    """Writes the bag with other names; what gets an empty one is left out."""
    with rosbag.Bag(bag) as source, rosbag.Bag(output, "w") as out:
        for topic, message, stamp in source.read_messages():
            if names.get(topic, topic):
                out.write(names.get(topic, topic), message, stamp)


class FolderCase(unittest.TestCase):
    """With a folder that is gone afterwards."""
    folder: tempfile.TemporaryDirectory[str]

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    @classmethod
    def path(cls, name: str) -> str:
        return str(Path(cls.folder.name) / name)


class ScriptCase(FolderCase):
    """SCRIPT is the one under test."""
    SCRIPT: str

    def run_script(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        path = f"{BIN.parents[1]}:{os.environ.get('CMAKE_PREFIX_PATH', '')}"
        return subprocess.run([str(ROOT / "scripts" / self.SCRIPT), *arguments], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True, check=False,
                              env={**os.environ, "CMAKE_PREFIX_PATH": path})

    def said(self, *arguments: str) -> str:
        done = self.run_script(*arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def refused(self, *arguments: str) -> str:
        done = self.run_script(*arguments)
        self.assertIn(done.returncode, (1, 2), done.stderr)
        self.assertRegex(done.stderr, rf"(?m)^{self.SCRIPT}: ")
        self.assertNotRegex(done.stderr, r"Traceback|(?m:^replay: )|scans\.csv", "what the script runs is its own matter")
        return done.stderr
