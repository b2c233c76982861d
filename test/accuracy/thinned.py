#!/usr/bin/python3
"""Writes a log with every n-th scan only, and its reference at these."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from argument_types import whole  # noqa: E402
from commands import command, rewritten  # noqa: E402
from trajectory import Trajectory, TrajectoryError, read_tum, sample, write_tum  # noqa: E402


def thin(bag: Path, output: Path, every: int, first: int = 0, topic: str = "/scan") -> np.ndarray:
    """From the scan with the number `first` on. Returns the stamps of those that are left [s]."""
    stamps = []
    scans = 0
    with rewritten(bag, output) as (source, out):
        for name, message, time in source.read_messages():
            if name == topic:
                scans += 1
                if (scans - 1) % every != first:
                    continue
                stamps.append(message.header.stamp.to_sec())
            out.write(name, message, time)
        if len(stamps) < 2:
            raise TrajectoryError(f"{bag}: of {scans} scans on {topic} {len(stamps)} are left: expected 2 or more")
    return np.array(stamps)


def thin_reference(tum: Path, output: Path, stamps: np.ndarray) -> None:
    """stamps: of the scans that are left, in the order of time [s]."""
    reference = read_tum(tum)
    _, left = sample(Trajectory(stamps, np.zeros((len(stamps), 3))), reference.stamps, max_gap=0.0)
    if not left.any():
        raise TrajectoryError(f"{tum}: no pose at the scans that are left: expected the reference of the bag, "
                              f"{stamps[0]:.3f} to {stamps[-1]:.3f} s")
    write_tum(output, Trajectory(reference.stamps[left], reference.poses[left]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for argument in ("bag", "tum", "output_bag", "output_tum"):
        parser.add_argument(argument, type=Path)
    parser.add_argument("every", type=whole(1), help="n: 2 leaves every other scan")
    options = parser.parse_args()
    thin_reference(options.tum, options.output_tum, thin(options.bag, options.output_bag, options.every))


if __name__ == "__main__":
    command(main)
