"""How well a trajectory closes where the robot comes back: a fair measure without ground truth.

Where the robot passes a place a second time, the two scans that it took there say by themselves how the two poses lie to
each other: ICP brings the second scan onto the first. What a trajectory says of the same two poses should agree. The
difference is the drift that it has gathered in between, in metres and degrees. All trajectories are held against the
same pairs of scans and the same ICP, whatever their own error.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Iterator, List, Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from trajectory import between, compose, wrap

MIN_WAY_BETWEEN = 20.0  # [m] between the two passes
MAX_DISTANCE = 2.0  # [m] between the two poses
MAX_ANGLE = math.radians(30.0)  # between their headings
MIN_OVERLAP = 0.7  # share of the second scan's points that must fall on the first, for the pair to count
ON_SURFACE = 0.10  # [m] a point this near to the first scan falls on it
START_OFFSETS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0),
                 (0.0, 0.0, 0.2), (0.0, 0.0, -0.2))


@dataclass(frozen=True)
class Alignment:
    """The pose of the second scan in the frame of the first, and the share of its points that then fall on it."""
    pose: np.ndarray
    overlap: float


@dataclass(frozen=True)
class Revisit:
    """Two scans of one place, by index, and what ICP says of them: the second's pose in the frame of the first."""
    first: int
    second: int
    first_from_second: np.ndarray


@dataclass(frozen=True)
class Closure:
    """What a trajectory makes of one revisit."""
    translation: float  # [m] by which it misses the pose that the scans show
    rotation: float  # [rad] the same, without sign
    point_distance: float  # [m] median distance of the second pass's points to the first pass's


class Surface:
    """The points of a scan with the directions of their normals, ready to be aligned to."""

    def __init__(self, points: np.ndarray, neighbours: int = 5) -> None:
        self.points = points
        self.tree = cKDTree(points)
        _, nearest = self.tree.query(points, k=min(neighbours, len(points)))
        spread = points[nearest] - points[nearest].mean(axis=1, keepdims=True)
        _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
        self.normals = vectors[:, :, 0]  # of the smallest eigenvalue

    def distances(self, points: np.ndarray) -> np.ndarray:
        return self.tree.query(points)[0]

    def overlap(self, points: np.ndarray) -> float:
        return float((self.distances(points) < ON_SURFACE).mean())


def transformed(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n x 2) of the frame whose pose is given, in the frame in which it is given."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]


def icp(surface: Surface, points: np.ndarray, guess: np.ndarray) -> Alignment:
    """Point-to-line ICP from the guess, with a gate on the pairs that narrows from 1 m to 0.15 m."""
    pose = np.asarray(guess, dtype=float)
    for iteration in range(60):
        gate = max(0.15, 0.8 ** iteration)
        moved = transformed(pose, points)
        distance, index = surface.tree.query(moved, distance_upper_bound=gate)
        paired = np.isfinite(distance)
        if paired.sum() < 10:
            return Alignment(pose, 0.0)
        step = _gauss_newton(moved[paired], surface.points[index[paired]], surface.normals[index[paired]])
        # The step turns about the origin of the surface's frame: it is applied from the left.
        pose = compose(step, pose)
        if gate == 0.15 and np.abs(step).max() < 1e-6:
            break
    return Alignment(pose, surface.overlap(transformed(pose, points)))


def _gauss_newton(moved: np.ndarray, targets: np.ndarray, normals: np.ndarray) -> np.ndarray:
    residuals = np.einsum("ni,ni->n", moved - targets, normals)
    scale = max(0.01, 1.5 * float(np.median(np.abs(residuals))))
    weights = np.minimum(1.0, scale / np.maximum(np.abs(residuals), 1e-12))  # Huber
    jacobian = np.column_stack((normals, normals[:, 1] * moved[:, 0] - normals[:, 0] * moved[:, 1]))
    weighted = jacobian * weights[:, None]
    # A whiff of damping, for corridors in which one direction is not seen.
    return np.linalg.solve(weighted.T @ jacobian + 1e-6 * np.eye(3), -weighted.T @ residuals)


def align(surface: Surface, points: np.ndarray, guess: np.ndarray) -> Alignment:
    """ICP from the guess; where that does not fit, the best of several starts around it."""
    best = Alignment(guess, -1.0)
    for offset in START_OFFSETS:
        found = icp(surface, points, compose(guess, np.array(offset)))
        if found.overlap > best.overlap:
            best = found
        if best.overlap > 0.9:
            break
    return best


def candidates(poses: np.ndarray, way: np.ndarray) -> Iterator[Tuple[int, int]]:
    """For each pose the nearest one of an earlier pass, if there is one near enough with a similar heading."""
    for second in range(len(poses)):
        earlier = np.flatnonzero(way < way[second] - MIN_WAY_BETWEEN)
        distance = np.hypot(*(poses[earlier, :2] - poses[second, :2]).T)
        angle = np.abs(wrap(poses[earlier, 2] - poses[second, 2]))
        # A radian counts as much as two metres.
        cost = np.where((distance < MAX_DISTANCE) & (angle < MAX_ANGLE), distance + 2.0 * angle, np.inf)
        if cost.size and np.isfinite(cost.min()):
            yield int(earlier[cost.argmin()]), second


def find_revisits(clouds: Sequence[np.ndarray], poses: np.ndarray, min_step: float = 0.2) -> List[Revisit]:
    """Pairs of scans of one place, at least min_step metres apart along the second pass.

    clouds: the points of every scan (n x 2) in the robot's frame; poses: where a trajectory puts the robot at each scan.
    The poses only say where to look; a pair counts if ICP finds that the scans overlap.
    """
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))
    revisits: List[Revisit] = []
    for first, second in candidates(poses, way):
        if revisits and way[second] - way[revisits[-1].second] < min_step and second != len(poses) - 1:
            continue
        found = align(Surface(clouds[first]), clouds[second], between(poses[first], poses[second]))
        if found.overlap >= MIN_OVERLAP:
            revisits.append(Revisit(first, second, found.pose))
    return revisits


def closure(revisit: Revisit, clouds: Sequence[np.ndarray], poses: np.ndarray, window: int = 3) -> Closure:
    """What the trajectory with these poses makes of a revisit. The first pass: its scan and `window` on either side."""
    first_from_second = between(poses[revisit.first], poses[revisit.second])
    miss = between(revisit.first_from_second, first_from_second)
    near = range(max(0, revisit.first - window), revisit.first + window + 1)
    first_pass = np.vstack([transformed(poses[i], clouds[i]) for i in near])
    distance, _ = cKDTree(first_pass).query(transformed(poses[revisit.second], clouds[revisit.second]))
    return Closure(float(np.hypot(miss[0], miss[1])), float(abs(miss[2])), float(np.median(distance)))
