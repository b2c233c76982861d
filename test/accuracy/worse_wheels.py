#!/usr/bin/python3
"""Writes a log as it would be with worse wheels, which slip or freeze."""
from __future__ import annotations

import argparse
import math
import random
import sys
from pathlib import Path
from typing import Callable

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from commands import command, rewritten  # noqa: E402
from trajectory import TrajectoryError, between, compose  # noqa: E402

Told = Callable[[np.ndarray], np.ndarray]  # of the steps of the odometry (n x 3: x, y [m], yaw [rad]), what is told
SLIPS = 1 / 8  # of the steps in motion
SLIP = (math.radians(5), math.radians(15))
TURN = (math.radians(60), math.radians(80))  # one that is not told, from so much on, and so much of it
PAUSE = 15  # steps at least between two such turns


def slipping(steps: np.ndarray) -> np.ndarray:
    """Now and then the yaw of a step is 5 to 15 degrees off, to either side."""
    draws = random.Random(5)

    def slip(step: np.ndarray) -> float:
        moves = abs(step[0]) > 0.02 or abs(step[2]) > 0.05
        slips = draws.random() < SLIPS
        off = draws.choice((-1, 1)) * draws.uniform(*SLIP)
        return off if moves and slips else 0.0

    return steps + np.array([(0.0, 0.0, slip(step)) for step in steps])


def freezing(steps: np.ndarray) -> np.ndarray:
    """Of most turns of 60 degrees and more, and of the way in them, nothing is told."""
    told = steps.copy()
    k = since = 0
    while k < len(steps):
        since += 1
        turned, end = 0.0, k
        while end < len(steps) and end < k + 400 and abs(turned) < TURN[1] and steps[end, 2] * turned >= -1e-6:
            turned += steps[end, 2]
            end += 1
        if abs(turned) >= TURN[0] and since > PAUSE:
            told[k:end] = 0.0
            k, since = end, 0
        else:
            k += 1
    return told


def worsen(path: str, output: str, told: Told, topic: str = "/odom") -> None:
    """Writes the bag with its odometry, step by step, as it is told by worse wheels."""
    def pose(message) -> np.ndarray:
        position, q = message.pose.pose.position, message.pose.pose.orientation
        return np.array([position.x, position.y, 2.0 * math.atan2(q.z, q.w)])

    with rewritten(Path(path), Path(output)) as (source, out):
        poses = np.array([pose(message) for _, message, _ in source.read_messages(topics=[topic])])
        if len(poses) == 0:
            raise TrajectoryError(f"{path}: no odometry on {topic}")
        steps = iter(told(between(poses[:-1], poses[1:])))
        now = poses[0]
        for name, message, stamp in source.read_messages():
            if name == topic:
                position, q = message.pose.pose.position, message.pose.pose.orientation
                position.x, position.y, q.z, q.w = now[0], now[1], math.sin(0.5 * now[2]), math.cos(0.5 * now[2])
                now = compose(now, next(steps, np.zeros(3)))
            out.write(name, message, stamp)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    parser.add_argument("output")
    parser.add_argument("wheels", choices=("slipping", "freezing"))
    options = parser.parse_args()
    worsen(options.bag, options.output, {"slipping": slipping, "freezing": freezing}[options.wheels])


if __name__ == "__main__":
    command(main)
