"""The package's programs, run by its scripts."""
from __future__ import annotations

import codecs
import os
import pty
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import BinaryIO, Optional, Sequence

PACKAGE = "sckf_odometry"


class ProgramError(Exception):
    """What is wrong, for a person to read."""


def find_program(name: str, bin_dir: Optional[Path] = None) -> Path:
    """Beside this script where it is installed, or in the workspace that has been sourced."""
    folders = [bin_dir] if bin_dir else [Path(sys.argv[0]).resolve().parent, Path(__file__).resolve().parent]
    if not bin_dir:
        prefixes = os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
        folders += [Path(prefix) / "lib" / PACKAGE for prefix in prefixes if prefix]
    folders = list(dict.fromkeys(folders))
    for folder in folders:
        if os.access(folder / name, os.X_OK):
            return folder / name
    remedy = "is that what --bin-dir should be?" if bin_dir else "build the package and source its setup.bash"
    raise ProgramError(f"{name} is not in {', '.join(map(str, folders))}: {remedy}")


def run_program(name: str, arguments: Sequence[object], bin_dir: Optional[Path] = None) -> str:
    """Returns what it prints. What it says on stderr is passed on, but for why it fails, which the ProgramError says."""
    command = [str(find_program(name, bin_dir)), *map(str, arguments)]
    reader, writer = pty.openpty() if sys.stderr.isatty() else os.pipe()  # on a terminal it draws how far it is
    with tempfile.TemporaryFile("w+", encoding="utf-8") as printed, open(reader, "rb", buffering=0) as stderr:
        with subprocess.Popen(command, stdout=printed, stderr=writer) as program:
            os.close(writer)
            reason = _pass_on(stderr, name)
        if program.returncode != 0:
            raise ProgramError(reason or f"{name} ended with {program.returncode}")
        if reason:
            sys.stderr.write(f"{name}: {reason}\n")
        printed.seek(0)
        return printed.read()


def _pass_on(stderr: BinaryIO, name: str) -> str:
    """Writes what comes, but for what the program says in its name, which is the last: that is returned."""
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    waiting = ""  # of a line that is not at its end
    chunk = b"begin"
    while chunk:
        chunk = _read(stderr)
        waiting += decoder.decode(chunk, final=not chunk)
        reason = re.search(rf"(^|(?<=[\r\n])){re.escape(name)}: ", waiting)
        end = reason.start() if reason else max(waiting.rfind("\r"), waiting.rfind("\n")) + 1
        sys.stderr.write(waiting[:end].replace("\r\n", "\n"))
        sys.stderr.flush()
        waiting = waiting[end:]
    if waiting.startswith(f"{name}: "):
        return waiting[len(name) + 2:].replace("\r\n", "\n").rstrip()
    sys.stderr.write(waiting)
    return ""


def _read(stderr: BinaryIO) -> bytes:
    try:
        return stderr.read(4096)
    except OSError:  # how a terminal ends
        return b""
