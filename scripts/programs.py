"""The package's programs, run by its scripts."""
from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Optional, Sequence

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
    """Returns what it prints."""
    command = [str(find_program(name, bin_dir)), *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, universal_newlines=True, check=False)
    if done.returncode != 0:
        raise ProgramError(f"{' '.join(map(shlex.quote, command))}: ended with {done.returncode}")
    return done.stdout
