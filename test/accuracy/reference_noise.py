#!/usr/bin/python3
"""How much of a log's drift is the reference's own.

Every other scan of the log makes one estimate, the other ones another, and neither knows of the reference. By how much
the three differ from each other tells how far each is off, where their errors are independent: the square of what the
reference errs by is half of the squares of its distances from the two less that of theirs from each other. What the two
estimates have in common, wheels and the laser's systematic errors, is counted to the reference: it errs by at most so much.

With --other the two are the estimate by all scans and that of another program, which has to know as little of the
reference; less is common to these.
"""
from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import List, Sequence

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from commands import command  # noqa: E402
from logs import run  # noqa: E402
from thinned import thin  # noqa: E402
from trajectory import (DEFAULT_LENGTHS, DEFAULT_MAX_GAP, Trajectory, TrajectoryError, between, read_tum,  # noqa: E402
                        sample)


@dataclass(frozen=True)
class Rms:
    """Over segments of one length."""
    percent: float  # translation, of the length
    deg_per_m: float


@dataclass(frozen=True)
class Share:
    length: float  # [m]
    first: Rms  # by which the first estimate is off the reference …
    estimates: Rms  # … by which the two differ …
    reference: Rms  # … and which are the reference's own; 0 where that comes out negative


def rms(mean_squares: np.ndarray) -> Rms:
    """Of translation and yaw, per metre."""
    percent, deg_per_m = np.sqrt(np.maximum(mean_squares, 0.0)) * (100.0, np.degrees(1.0))
    return Rms(percent, deg_per_m)


def shares(reference: Trajectory, estimates: Sequence[Trajectory]) -> List[Share]:
    """Of two estimates. A segment counts if both cover its ends."""
    sampled = [sample(estimate, reference.stamps, DEFAULT_MAX_GAP) for estimate in estimates]
    covered = sampled[0][1] & sampled[1][1]
    poses = [reference.poses, sampled[0][0], sampled[1][0]]
    result = []
    for length in DEFAULT_LENGTHS:
        end = np.searchsorted(reference.way, reference.way + length)
        start = np.flatnonzero(end < len(reference.way))
        end = end[start]
        counts = covered[start] & covered[end]
        if not counts.any():
            continue
        moved = [between(each[start[counts]], each[end[counts]]) for each in poses]

        def mean_squares(a: int, b: int, moved=moved, length=length) -> np.ndarray:
            apart = between(moved[a], moved[b]) / length
            return np.array([(apart[:, :2]**2).sum(axis=1).mean(), (apart[:, 2]**2).mean()])

        first, second, apart = mean_squares(0, 1), mean_squares(0, 2), mean_squares(1, 2)
        result.append(Share(length, rms(first), rms(apart), rms(0.5 * (first + second - apart))))
    if not result:
        times = ", ".join(f"{each.stamps[0]:.3f} to {each.stamps[-1]:.3f} s" for each in (reference, *estimates))
        raise TrajectoryError(f"no segment of {DEFAULT_LENGTHS[0]:g} m or more that the reference and both estimates cover: they "
                              f"are from {times}")
    return result


def replayed(bag: Path) -> Trajectory:
    with tempfile.TemporaryDirectory() as folder:
        estimate = Path(folder) / "estimate.tum"
        run("replay", bag, "--trajectory", estimate)
        return read_tum(estimate)


def by_halves(bag: Path, tum: Path) -> List[Share]:
    reference = read_tum(tum)
    halves = []
    with tempfile.TemporaryDirectory() as folder:
        half = Path(folder) / "half.bag"
        for first in (0, 1):
            thin(bag, half, 2, first)
            halves.append(replayed(half))
    return shares(reference, halves)


def by_another(bag: Path, tum: Path, other: Path) -> List[Share]:
    reference, of_other = read_tum(tum), read_tum(other)
    return shares(reference, [replayed(bag), of_other])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for argument in ("bag", "reference"):
        parser.add_argument(argument, type=Path)
    parser.add_argument("--other", type=Path, help="another program's estimate")
    options = parser.parse_args()
    table = (by_another(options.bag, options.reference, options.other)
             if options.other else by_halves(options.bag, options.reference))
    print(f"rms{'estimate off reference':>31}{'estimates differ':>26}{'reference errs':>26}")
    for share in table:
        cells = [f"{each.percent:.2f} %, {each.deg_per_m:.3f} °/m" for each in (share.first, share.estimates, share.reference)]
        print(f"{share.length:6g} m" + "".join(f"{cell:>26}" for cell in cells))


if __name__ == "__main__":
    command(main)
