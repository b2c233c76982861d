"""The logs that accuracy is measured on, and the programs that are measured.

Those that come with MRPT are found where Debian's mrpt-common puts them; the recorded ones in the folder that the
environment variable SCKF_DATA names, NAME.bag with its reference trajectory NAME.tum. A test of one that is not there is
skipped. SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import os
import sys
import unittest
from pathlib import Path
from typing import Tuple

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from programs import run_program  # noqa: E402

BIN_DIR = Path(os.environ.get("SCKF_BIN_DIR", ROOT / "build" / "devel" / "lib" / "sckf_odometry"))
DATASETS = Path("/usr/share/mrpt/datasets")
SIMULATED = DATASETS / "graphslam-engine-demos" / "action_observations_map"
MALAGA = DATASETS / "2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"


def run(program: str, *arguments: str | Path) -> None:
    run_program(program, arguments, BIN_DIR)


def recorded(name: str) -> Path:
    """The log's bag; beside it, as .tum, is the reference."""
    folder = os.environ.get("SCKF_DATA")
    if not folder:
        raise unittest.SkipTest("SCKF_DATA does not name the folder of the recorded logs")
    bag = Path(folder) / f"{name}.bag"
    for file in (bag, bag.with_suffix(".tum")):
        if not file.is_file():
            raise unittest.SkipTest(f"{file} is missing")
    return bag


def installed(path: Path) -> Path:
    if not path.is_file():
        raise unittest.SkipTest(f"{path} is missing: it comes with Debian's mrpt-common")
    return path


def simulated(folder: Path) -> Tuple[Path, Path]:
    """MRPT's simulated log as a bag in the folder, and its true trajectory."""
    bag, tum = folder / "simulated.bag", folder / "simulated.tum"
    run("rawlog_to_bag", installed(SIMULATED / "simul.rawlog"), bag, "--ground-truth",
        installed(SIMULATED / "simul.rawlog.GT.txt"), "--tum", tum)
    return bag, tum
