#!/usr/bin/python3
"""Writes the log of a robot that drives through a simulated place, and where it truly was.

Wheels: good ones; those that tell way and rotation too long and pull to one side; and good ones that slip or freeze as
those of worse_wheels.py.
"""
from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, List, Optional, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "ros"), str(Path(__file__).resolve().parents[2] / "scripts")]
from argument_types import whole, within  # noqa: E402
from commands import command, written  # noqa: E402
from simulated_bag import Mount, cast, mount_message, odometry_message  # noqa: E402
from simulated_places import PLACES, Place, disc  # noqa: E402
from trajectory import Trajectory, between, compose, write_tum  # noqa: E402
from worse_wheels import freezing, slipping  # noqa: E402

START = 1000.0  # [s]
SPEED = 0.5  # [m/s]
ODOMETRY = 4  # messages from scan to scan
MOUNT = Mount(x=0.1, z=0.3)
SEED = 7


@dataclass(frozen=True)
class Wheels:
    way: float = 1.0  # told per metre
    rotation: float = 1.0  # told per radian
    pull: float = 0.0  # [rad/m] told too much
    noise: float = 0.01  # of the way
    yaw_noise: float = 0.002  # [rad/√m]
    pile: Tuple[float, float] = (0.0, 0.0)  # [1] of a carpet: so far it takes the robot along, in the world, per metre
    worse: Optional[Callable[[np.ndarray], np.ndarray]] = None  # of what they would tell of the steps, what they do


WHEELS: Dict[str, Wheels] = {
    "good": Wheels(),
    "drifting": Wheels(1.05, 1.03, math.radians(2.0), 0.03, 0.01),
    "carpet": Wheels(pile=(0.013, 0.009)),
    "slipping": Wheels(worse=slipping),
    "freezing": Wheels(worse=freezing),
}


@dataclass(frozen=True)
class Laser:
    beams: int = 181  # over half a turn
    reach: float = 80.0  # [m]
    no_return: float = 81.9  # [m] written where nothing is seen; as CARMEN's lasers do

    @property
    def angles(self) -> np.ndarray:
        return np.linspace(-math.pi / 2.0, math.pi / 2.0, self.beams)


def drive(way: np.ndarray, step: float) -> np.ndarray:
    """Poses, a step [m] and 36 degrees per metre of it apart: from corner to corner, swaying; there it turns."""
    sway, turn = 0.15, math.radians(36.0) * step
    poses: List[np.ndarray] = []
    yaw = math.atan2(way[1, 1] - way[0, 1], way[1, 0] - way[0, 0])
    for begin, end in zip(way[:-1], way[1:]):
        to_left = math.remainder(math.atan2(end[1] - begin[1], end[0] - begin[0]) - yaw, 2.0 * math.pi)
        turns = yaw + to_left * np.linspace(0.0, 1.0, int(abs(to_left) / turn) + 2)[1:]
        poses.append(np.column_stack((np.tile(begin, (len(turns), 1)), turns)))
        yaw = turns[-1]
        length = math.hypot(*(end - begin))

        def aside(s: np.ndarray, length: float = length) -> np.ndarray:
            return sway * np.sin(s / 3.0) * np.clip(np.minimum(s, length - s) / 2.5, 0.0, 1.0)

        s = np.arange(step, length, step)
        swayed = np.arctan((aside(s + 1e-3) - aside(s - 1e-3)) / 2e-3)
        on_line = np.column_stack((s, aside(s), swayed))
        poses.append(compose(np.array([*begin, yaw]), on_line))
    return np.concatenate(poses)


def told_by(wheels: Wheels, poses: np.ndarray, draws: np.random.Generator) -> np.ndarray:
    """Poses of the odometry at the same times, from the origin on."""
    steps = between(poses[:-1], poses[1:])
    way = np.hypot(steps[:, 0], steps[:, 1])
    yaw_std = wheels.yaw_noise * np.sqrt(way) + 0.01 * abs(steps[:, 2])
    noise = draws.normal(size=steps.shape) * np.column_stack((wheels.noise * way, 0.3 * wheels.noise * way, yaw_std))
    drift = np.column_stack((np.zeros((len(steps), 2)), wheels.pull * way))
    headings = poses[:-1] * np.array([0.0, 0.0, 1.0])
    steps[:, :2] -= between(headings, np.outer(way, (*wheels.pile, 0.0)))[:, :2]
    steps = steps * np.array([wheels.way, wheels.way, wheels.rotation]) + drift + noise
    told = [np.zeros(3)]
    for step in wheels.worse(steps) if wheels.worse else steps:
        told.append(compose(told[-1], step))
    return np.array(told)


def legs(at: np.ndarray, stride: float) -> np.ndarray:
    """Of somebody who faces along a pose, one ahead of the other by twice the stride [m]."""
    feet = compose(at, np.array([(stride, 0.12, 0.0), (-stride, -0.12, 0.0)]))
    return np.concatenate([disc(foot[:2], 0.07, 6) for foot in feet])


class Somebody:
    """Walks along the robot's way for 25 s of each minute, 0.4 m to the left of it: ahead, at its speed, or towards it."""

    def __init__(self, which: Optional[str], truth: Trajectory):
        self.which = which
        self.poses = truth.poses
        self.way = truth.way

    def seen(self, k: int, time: float) -> np.ndarray:
        since = time % 60.0
        if self.which is None or since >= 25.0:
            return np.zeros((0, 2, 2))
        distance = 2.5 if self.which == "ahead" else max(0.8, 12.0 - 2.0 * SPEED * since)
        there = self.poses[min(np.searchsorted(self.way, self.way[k] + distance), len(self.poses) - 1)]
        at = compose(there, np.array([0.0, 0.4, 0.0]))
        if math.hypot(*between(self.poses[k], at)[:2]) < 0.7:
            return np.zeros((0, 2, 2))
        return legs(at, 0.15 * math.sin(1.7 * k))


def measured(ranges: np.ndarray, place: Place, laser: Laser, draws: np.random.Generator) -> np.ndarray:
    """With noise that grows with the range, in centimetres."""
    std = 0.012 + 0.001 * np.where(np.isfinite(ranges), ranges, 0.0) + (0.01 if place.outdoors else 0.0)
    if place.outdoors:
        ranges = np.where(draws.random(len(ranges)) < 0.05, np.inf, ranges)
        ground = draws.uniform(5.0, 20.0, len(ranges))
        ranges = np.where(draws.random(len(ranges)) < 0.02, ground, ranges)
    seen = np.isfinite(ranges) & (ranges < laser.reach)
    return np.where(seen, np.round(ranges + draws.normal(0.0, std), 2), laser.no_return)


def scan_message(stamp: rospy.Time, laser: Laser, ranges: np.ndarray) -> LaserScan:
    message = LaserScan()
    message.header.stamp, message.header.frame_id = stamp, MOUNT.frame
    message.angle_min, message.angle_max = laser.angles[0], laser.angles[-1]
    message.angle_increment = laser.angles[1] - laser.angles[0]
    message.range_min, message.range_max = 0.02, 80.0
    message.ranges = ranges.tolist()
    return message


def simulate(place_name: str, bag: Path, tum: Path, wheels: str = "good", step: float = 0.5, laser: Laser = Laser(),
             somebody: Optional[str] = None, seed: int = SEED) -> None:
    """With the same seed always the same. Step: from scan to scan [m]. Somebody: who walks ahead or towards the robot."""
    draws = np.random.default_rng(seed)
    place = PLACES[place_name](draws)
    poses = drive(place.way, step)
    truth = Trajectory(START + step / SPEED * np.arange(len(poses)), poses)
    odometry = told_by(WHEELS[wheels], poses, draws)
    strollers = draws.uniform(place.way.min(axis=0) - 3.0, place.way.max(axis=0) + 3.0, (place.strollers, 2))
    walker = Somebody(somebody, truth)
    with written(bag) as out:
        begin = rospy.Time.from_sec(START)
        out.write("/tf_static", mount_message(begin, MOUNT), begin)
        for k, (stamp, pose) in enumerate(zip(truth.stamps, poses)):
            time = rospy.Time.from_sec(stamp)
            strollers += draws.normal(0.0, 0.3, strollers.shape)
            near = [legs(np.array([*at, 0.0]), 0.1) for at in strollers if 0.7 < math.hypot(*(at - pose[:2])) < 15.0]
            walls = np.concatenate([place.walls, walker.seen(k, stamp - START), *near])
            eye = compose(pose, np.array([MOUNT.x, 0.0, 0.0]))
            ranges = cast(eye[:2], eye[2] + laser.angles, walls)
            out.write("/scan", scan_message(time, laser, measured(ranges, place, laser, draws)), time)
            step_told = between(odometry[k], odometry[min(k + 1, len(poses) - 1)])
            for j in range(ODOMETRY if k + 1 < len(poses) else 1):
                time = rospy.Time.from_sec(stamp + j / ODOMETRY * step / SPEED)
                out.write("/odom", odometry_message(time, compose(odometry[k], j / ODOMETRY * step_told)), time)
    write_tum(tum, truth)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("place", choices=sorted(PLACES))
    parser.add_argument("output_bag", type=Path)
    parser.add_argument("output_tum", type=Path)
    parser.add_argument("--wheels", choices=sorted(WHEELS), default="good")
    parser.add_argument("--step", type=within(0.01, 10.0), default=0.5, help="from scan to scan [m] (default: 0.5)")
    parser.add_argument("--beams", type=whole(2, 100000), default=181, help="of the laser, over half a turn (default: 181)")
    parser.add_argument("--reach", type=within(0.1, 1000.0), default=80.0, help="of the laser [m] (default: 80)")
    parser.add_argument("--no-return", type=within(0.1, 1000.0), default=Laser.no_return,
                        help="what is written where nothing is seen [m], range_max being 80 (default: %(default)s)")
    parser.add_argument("--somebody", choices=("ahead", "towards"), help="walks along the robot's way")
    parser.add_argument("--seed", type=whole(0), default=SEED,
                        help="of all that is drawn: where doors, trees and pictures are, noise (default: %(default)s)")
    options = parser.parse_args()
    simulate(options.place, options.output_bag, options.output_tum, options.wheels, options.step,
             Laser(options.beams, options.reach, options.no_return), options.somebody, options.seed)


if __name__ == "__main__":
    command(main)
