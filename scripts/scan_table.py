"""What the pipeline tells of each scan of a log: the table of program replay, for the scripts that look at it."""
from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path
from typing import Dict, List, Sequence

import numpy as np

from programs import run_program
from recording import Topics

AXES = ("x", "y", "yaw")
Row = Dict[str, str]


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """The log, and how it is to be replayed."""
    parser.add_argument("bag")
    parser.add_argument("--params", help="parameter file, as config/sckf_odometry.yaml")
    parser.add_argument("--scan-topic", default=Topics.scan)
    parser.add_argument("--odom-topic", default=Topics.odometry)


def add_reference_arguments(parser: argparse.ArgumentParser) -> None:
    """A reference trajectory, and how far it is to be believed."""
    parser.add_argument("--reference", metavar="TUM", help="the reference trajectory, of base_link at the scans")
    parser.add_argument("--reference-std", nargs=2, type=float, default=(0.02, 0.3), metavar=("M", "DEG"),
                        help="its own error between two scans, for the NEES (default: 0.02 0.3)")


def reference_covariance(log: argparse.Namespace) -> np.ndarray:
    """Of the error of x, y [m], yaw [rad] between two poses of the reference."""
    meters, degrees = log.reference_std
    return np.diag(np.square([meters, meters, np.radians(degrees)]))


def scan_table(log: argparse.Namespace, options: Sequence[object] = ()) -> List[Row]:
    """The rows of replay's table, for a log as add_log_arguments takes it; further options as replay takes them."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "scans.csv"
        arguments = [log.bag, "--csv", table, "--scan-topic", log.scan_topic, "--odom-topic", log.odom_topic, *options]
        run_program("replay", arguments + (["--params", log.params] if log.params else []))
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
