#!/usr/bin/python3
"""How much of a log's drift is the reference's own.

Every other scan of the log makes one estimate, the other ones another, and neither knows of the reference. By how much
the three differ from each other tells how far each is off, where their errors are independent: the square of what the
reference errs by is half of the squares of its distances from the two less that of theirs from each other. What the two
estimates have in common, wheels and the laser's systematic errors, is counted to the reference: it errs by at most so much.
"""
from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import List

import numpy as np
import rosbag

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from logs import run  # noqa: E402
from trajectory import DEFAULT_LENGTHS, DEFAULT_MAX_GAP, Trajectory, between, read_tum, sample  # noqa: E402


@dataclass(frozen=True)
class Share:
    """Of segments of a length [m]: rms of the translation, in percent of it."""
    length: float
    of_halves: float  # by which the two estimates differ
    of_reference: float  # of its own; 0 where it comes out negative


def every_other(bag: Path, output: Path, first: int, topic: str = "/scan") -> None:
    """Writes the bag with every second scan, from the one with that number on."""
    scans = 0
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(output), "w") as out:
        for name, message, time in source.read_messages():
            scans += name == topic
            if name != topic or scans % 2 != first % 2:
                out.write(name, message, time)


def shares(reference: Trajectory, halves: List[Trajectory]) -> List[Share]:
    """halves: the two estimates. A segment counts if both cover its ends."""
    sampled = [sample(half, reference.stamps, DEFAULT_MAX_GAP) for half in halves]
    covered = sampled[0][1] & sampled[1][1]
    poses = [reference.poses, sampled[0][0], sampled[1][0]]
    result = []
    for length in DEFAULT_LENGTHS:
        end = np.searchsorted(reference.way, reference.way + length)
        start = np.flatnonzero(end < len(reference.way))
        end = end[start]
        counts = covered[start] & covered[end]
        moved = [between(each[start[counts]], each[end[counts]]) for each in poses]

        def mean_square(a: int, b: int, moved=moved, length=length) -> float:
            apart = between(moved[a], moved[b])[:, :2] / length
            return float((apart**2).sum(axis=1).mean())

        own = 0.5 * (mean_square(0, 1) + mean_square(0, 2) - mean_square(1, 2))
        result.append(Share(length, 100.0 * mean_square(1, 2)**0.5, 100.0 * max(0.0, own)**0.5))
    return result


def measured(bag: Path, tum: Path) -> List[Share]:
    halves = []
    with tempfile.TemporaryDirectory() as folder:
        for first in (0, 1):
            half, estimate = Path(folder) / "half.bag", Path(folder) / "half.tum"
            every_other(bag, half, first)
            run("replay", half, "--trajectory", estimate)
            halves.append(read_tum(estimate))
    return shares(read_tum(tum), halves)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for argument in ("bag", "reference"):
        parser.add_argument(argument, type=Path)
    options = parser.parse_args()
    print(f"{'length':>8}{'halves differ by':>20}{'reference errs by':>20}")
    for each in measured(options.bag, options.reference):
        print(f"{each.length:6g} m{each.of_halves:18.2f} %{each.of_reference:18.2f} %")
