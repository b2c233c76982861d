#!/usr/bin/python3
"""scripts/programs.py: what a program says, and why it fails, reaches who has called the script; with programs of its own."""
from __future__ import annotations

import os
import pty
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Tuple

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
CALL = """import sys
from pathlib import Path
from programs import ProgramError, run_program
try:
    print(run_program("program", sys.argv[2:], Path(sys.argv[1])), end="")
except ProgramError as error:
    print(f"script: {error}", file=sys.stderr)
    sys.exit(1)
"""


class ProgramsTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.program = Path(folder.name) / "program"

    def write(self, script: str) -> None:
        self.program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        self.program.chmod(0o755)

    def call(self, on_terminal: bool = False) -> Tuple[int, str, str]:
        """The exit code, and what came on stdout and stderr."""
        reader, writer = pty.openpty() if on_terminal else os.pipe()
        with open(reader, "rb", buffering=0) as stderr:
            with subprocess.Popen([sys.executable, "-c", CALL, str(self.program.parent), "--option", "a value"],
                                  stdout=subprocess.PIPE, stderr=writer, text=True, cwd=SCRIPTS) as script:
                os.close(writer)
                said = b""
                try:
                    for chunk in iter(lambda: stderr.read(4096), b""):
                        said += chunk
                except OSError:  # how a terminal ends
                    pass
                printed, _ = script.communicate()
        return script.returncode, printed, said.decode().replace("\r\n", "\n")

    def test_what_it_prints_and_says_is_passed_on(self) -> None:
        self.write('echo "$2"; echo "log.bag: a remark" >&2; printf "no end" >&2')
        self.assertEqual(self.call(), (0, "a value\n", "log.bag: a remark\nno end"))

    def test_why_it_fails_is_one_message_of_the_script(self) -> None:
        self.write('echo "a remark" >&2; echo "program: log.bag: bad parameters:" >&2; echo "  a = 1: 2 expected" >&2; exit 1')
        said = "a remark\nscript: log.bag: bad parameters:\n  a = 1: 2 expected\n"
        for on_terminal in (False, True):
            self.assertEqual(self.call(on_terminal), (1, "", said))

    def test_one_that_crashes_is_named(self) -> None:
        self.write("kill -SEGV $$")
        self.assertEqual(self.call(), (1, "", "script: program ended with -11\n"))

    def test_on_a_terminal_it_draws_how_far_it_is(self) -> None:
        self.write(r'if [ -t 2 ]; then printf "\r[##] 50 %%\r      \r" >&2; fi; echo "program: reason" >&2; exit 2')
        self.assertEqual(self.call(), (1, "", "script: reason\n"))
        self.assertEqual(self.call(on_terminal=True), (1, "", "\r[##] 50 %\r      \rscript: reason\n"))


if __name__ == "__main__":
    unittest.main()
