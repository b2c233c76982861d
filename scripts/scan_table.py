"""What the pipeline tells of each scan of a log: the table of program replay, for the scripts that look at it."""
from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

import numpy as np
import yaml

from argument_types import not_negative, topic
from programs import run_program
from recording import Topics
from trajectory import TrajectoryError

AXES = ("x", "y", "yaw")
Row = Dict[str, str]


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """The log, and how it is to be replayed."""
    parser.add_argument("bag")
    parser.add_argument("--params", help="parameter file, as config/sckf_odometry.yaml")
    parser.add_argument("--scan-topic", type=topic, help="of one laser, instead of the parameter file's scan_topics")
    parser.add_argument("--odom-topic", type=topic, default=Topics.odometry)


def add_reference_arguments(parser: argparse.ArgumentParser) -> None:
    """A reference trajectory, and how far it is to be believed."""
    parser.add_argument("--reference", metavar="TUM", help="the reference trajectory, of base_link at the scans")
    parser.add_argument("--reference-std", nargs=2, type=not_negative, default=(0.02, 0.3), metavar=("M", "DEG"),
                        help="its own error between two scans, for the NEES (default: 0.02 0.3)")


def reference_covariance(log: argparse.Namespace) -> np.ndarray:
    """Of the error of x, y [m], yaw [rad] between two poses of the reference."""
    meters, degrees = log.reference_std
    return np.diag(np.square([meters, meters, np.radians(degrees)]))


def read_params(path: Optional[str]) -> Dict[str, Any]:
    """What a parameter file gives; nothing without one."""
    if not path:
        return {}
    try:
        given = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise TrajectoryError(f"--params {path}: expected a parameter file (YAML): {error}") from error
    if given is not None and not isinstance(given, dict):
        raise TrajectoryError(f"--params {path}: expected lines 'parameter: value', as in config/sckf_odometry.yaml")
    return given or {}


def scan_table(log: argparse.Namespace, options: Sequence[object] = ()) -> List[Row]:
    """The rows of replay's table, for a log as add_log_arguments takes it; further options as replay takes them."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "scans.csv"
        arguments = [log.bag, "--csv", table, "--odom-topic", log.odom_topic, *options]
        for option, value in ("--scan-topic", log.scan_topic), ("--params", log.params):
            arguments += [option, value] if value else []
        run_program("replay", arguments)
        with open(table, newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))


def vector(row: Row, kind: str = "") -> np.ndarray:
    """kind_x, kind_y, kind_yaw of a row; without a kind the estimate."""
    return np.array([float(row[kind + axis]) for axis in AXES])


def covariance(row: Row, kind: str = "") -> np.ndarray:
    """The 3 x 3 covariance of what vector() tells."""
    matrix = np.empty((3, 3))
    for i, first in enumerate(AXES):
        for j, second in enumerate(AXES[i:], i):
            name = f"var_{first}" if i == j else f"cov_{first}{second}"
            matrix[i, j] = matrix[j, i] = float(row[kind + name])
    return matrix
