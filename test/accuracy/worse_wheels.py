"""Logs as they would be with worse wheels."""
from __future__ import annotations

import math
import random
from typing import Callable, List, Tuple

import rosbag

Step = Tuple[float, float, float]  # x, y [m] and yaw [rad], in the robot's frame before it
SLIPS = 1 / 8  # of the steps in motion
SLIP = (math.radians(5), math.radians(15))
TURN = (math.radians(60), math.radians(80))  # one that is not told, from so much on, and so much of it
PAUSE = 15  # steps at least between two such turns


def compose(a: Step, b: Step) -> Step:
    c, s = math.cos(a[2]), math.sin(a[2])
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]


def between(a: Step, b: Step) -> Step:
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    return c * x + s * y, -s * x + c * y, math.remainder(b[2] - a[2], 2 * math.pi)


def slipping(steps: List[Step]) -> List[Step]:
    """Now and then the yaw of a step is 5 to 15 degrees off, to either side."""
    draws = random.Random(5)

    def slipped(step: Step) -> Step:
        moves = abs(step[0]) > 0.02 or abs(step[2]) > 0.05
        slips = draws.random() < SLIPS
        off = draws.choice((-1, 1)) * draws.uniform(*SLIP)
        return step[0], step[1], step[2] + (off if moves and slips else 0.0)

    return [slipped(step) for step in steps]


def freezing(steps: List[Step]) -> List[Step]:
    """Of most turns of 60 degrees and more, and of the way in them, nothing is told."""
    told = list(steps)
    k = since = 0
    while k < len(steps):
        since += 1
        turned, end = 0.0, k
        while end < len(steps) and end < k + 400 and abs(turned) < TURN[1] and steps[end][2] * turned >= -1e-6:
            turned += steps[end][2]
            end += 1
        if abs(turned) >= TURN[0] and since > PAUSE:
            told[k:end] = [(0.0, 0.0, 0.0)] * (end - k)
            k, since = end, 0
        else:
            k += 1
    return told


def worsen(path: str, output: str, told: Callable[[List[Step]], List[Step]], topic: str = "/odom") -> None:
    """Writes the bag with its odometry, step by step, as it is told by worse wheels."""
    def pose(message) -> Step:
        position, q = message.pose.pose.position, message.pose.pose.orientation
        return position.x, position.y, 2.0 * math.atan2(q.z, q.w)

    with rosbag.Bag(path) as source, rosbag.Bag(output, "w") as out:
        poses = [pose(message) for _, message, _ in source.read_messages(topics=[topic])]
        steps = told([between(*pair) for pair in zip(poses, poses[1:])])
        now, steps = poses[0], iter(steps)
        for name, message, stamp in source.read_messages():
            if name == topic:
                position, q = message.pose.pose.position, message.pose.pose.orientation
                position.x, position.y, q.z, q.w = now[0], now[1], math.sin(0.5 * now[2]), math.cos(0.5 * now[2])
                now = compose(now, next(steps, (0.0, 0.0, 0.0)))
            out.write(name, message, stamp)
