"""Planar trajectories in TUM files (stamp x y z qx qy qz qw) and the drift of one against another.

Used by the scripts beside it. A trajectory's poses are rows of x, y [m], yaw [rad]; roll, pitch and z are dropped.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Sequence, Tuple

import numpy as np

DEFAULT_LENGTHS = (5.0, 10.0, 20.0, 50.0)
DEFAULT_MAX_GAP = 5.0
STAMP_TOLERANCE = 1e-3  # [s] files carry stamps of six to nine digits: closer than this is the same instant
TUM_COLUMNS = ("stamp", "x", "y", "z", "qx", "qy", "qz", "qw")


class TrajectoryError(Exception):
    """What is wrong with an input, with file and line where there is one; meant to be shown to a person."""


@dataclass(frozen=True)
class Trajectory:
    """Poses at increasing stamps: stamps (n) [s], poses (n x 3) x, y [m], yaw [rad] of the robot in its frame."""
    stamps: np.ndarray
    poses: np.ndarray

    @property
    def way(self) -> np.ndarray:
        """Length of the path from the first pose to each pose [m]."""
        steps = np.hypot(np.diff(self.poses[:, 0]), np.diff(self.poses[:, 1]))
        return np.concatenate(([0.0], np.cumsum(steps)))


@dataclass(frozen=True)
class SegmentDrift:
    """Mean error over the segments of one length; the means are None where no segment is that long."""
    length: float
    segments: int
    translation_percent: Optional[float]
    rotation_deg_per_m: Optional[float]


@dataclass(frozen=True)
class Drift:
    """The result of drift(): per length, and the mean over the lengths that have segments."""
    per_length: Tuple[SegmentDrift, ...]
    translation_percent: float
    rotation_deg_per_m: float
    segments: int
    covered: int
    reference_poses: int


def wrap(angle: np.ndarray) -> np.ndarray:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def compose(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a ∘ b for poses in the last axis (x, y, yaw)."""
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack((a[..., 0] + cos * b[..., 0] - sin * b[..., 1], a[..., 1] + sin * b[..., 0] + cos * b[..., 1],
                     wrap(a[..., 2] + b[..., 2])), axis=-1)


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """inverse(a) ∘ b for poses in the last axis: b seen from a."""
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack((cos * dx + sin * dy, cos * dy - sin * dx, wrap(b[..., 2] - a[..., 2])), axis=-1)


def read_tum(path: str | Path) -> Trajectory:
    """Reads a TUM file. Blank lines and comments (#) are skipped; of equal stamps the last line counts."""
    rows: List[Tuple[float, ...]] = []
    try:
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, start=1):
                text = line.split("#", 1)[0].strip()
                if text:
                    _append(rows, _parse_row(text, f"{path}:{number}"), f"{path}:{number}")
    except OSError as error:
        raise TrajectoryError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"{path}: not a text file") from error
    if len(rows) < 2:
        raise TrajectoryError(f"{path}: {len(rows)} pose(s), a trajectory needs at least two")
    table = np.array(rows)
    return Trajectory(stamps=table[:, 0], poses=np.column_stack((table[:, 1:3], _yaw(table[:, 4:]))))


def write_tum(path: str | Path, trajectory: Trajectory) -> None:
    """Writes stamps with nine decimals, which is what a double of this century's seconds holds and more."""
    with open(path, "w", encoding="utf-8") as file:
        for stamp, (x, y, yaw) in zip(trajectory.stamps, trajectory.poses):
            file.write(f"{stamp:.9f} {x:.9f} {y:.9f} 0 0 0 {math.sin(yaw / 2):.12f} {math.cos(yaw / 2):.12f}\n")


def _parse_row(text: str, where: str) -> Tuple[float, ...]:
    fields = text.split()
    if len(fields) != len(TUM_COLUMNS):
        raise TrajectoryError(f"{where}: {len(fields)} values, expected {len(TUM_COLUMNS)} ({' '.join(TUM_COLUMNS)})")
    try:
        row = tuple(float(field) for field in fields)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from error
    if not all(math.isfinite(value) for value in row):
        raise TrajectoryError(f"{where}: a value is not finite")
    norm = math.sqrt(sum(value * value for value in row[4:]))
    if abs(norm - 1.0) > 0.01:
        raise TrajectoryError(f"{where}: the quaternion's norm is {norm:.4g}, not 1")
    return row


def _append(rows: List[Tuple[float, ...]], row: Tuple[float, ...], where: str) -> None:
    if rows and row[0] < rows[-1][0]:
        raise TrajectoryError(f"{where}: stamp {row[0]:.6f} is before the one above it, {rows[-1][0]:.6f}")
    if rows and row[0] == rows[-1][0]:
        rows.pop()
    rows.append(row)


def _yaw(quaternions: np.ndarray) -> np.ndarray:
    qx, qy, qz, qw = quaternions.T
    return np.arctan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)


def sample(trajectory: Trajectory, stamps: np.ndarray,
           max_gap: float = DEFAULT_MAX_GAP) -> Tuple[np.ndarray, np.ndarray]:
    """The trajectory's poses at other stamps (n x 3), and for each stamp whether it is covered.

    Between two poses: x and y linear, yaw by the shorter way. Covered means that a pose lies within STAMP_TOLERANCE or
    that the poses on both sides are at most max_gap seconds apart. Nothing is extrapolated.
    """
    known = trajectory.stamps
    after = np.clip(np.searchsorted(known, stamps), 1, len(known) - 1)
    before = after - 1
    span = known[after] - known[before]
    ratio = np.clip((stamps - known[before]) / span, 0.0, 1.0)
    difference = trajectory.poses[after] - trajectory.poses[before]
    difference[:, 2] = wrap(difference[:, 2])
    poses = trajectory.poses[before] + ratio[:, None] * difference
    distance = np.minimum(np.abs(stamps - known[before]), np.abs(stamps - known[after]))
    inside = (stamps >= known[0]) & (stamps <= known[-1]) & (span <= max_gap)
    return poses, inside | (distance <= STAMP_TOLERANCE)


def drift(reference: Trajectory, estimate: Trajectory, lengths: Sequence[float] = DEFAULT_LENGTHS,
          max_gap: float = DEFAULT_MAX_GAP) -> Drift:
    """Error of the estimate's relative poses over segments of the reference's path, per metre.

    A segment starts at every reference pose and ends at the first one whose way is at least the length further on; it
    counts if the estimate covers both. Its error is inverse(reference's relative pose) ∘ (estimate's relative pose):
    the norm of its translation and its angle, each divided by the length. The result is the mean over the lengths of
    the means over their segments.
    """
    estimated, covered = sample(estimate, reference.stamps, max_gap)
    if not covered.any():
        raise TrajectoryError("the two trajectories share no time: reference {:.3f} to {:.3f} s, estimate {:.3f} to "
                              "{:.3f} s".format(*reference.stamps[[0, -1]], *estimate.stamps[[0, -1]]))
    per_length = tuple(_segment_drift(reference, estimated, covered, length) for length in lengths)
    found = [each for each in per_length if each.segments]
    if not found:
        raise TrajectoryError(f"no segment of {min(lengths):g} m or more is covered: the reference's way is "
                              f"{reference.way[-1]:.2f} m, {covered.sum()} of its {covered.size} poses are covered")
    return Drift(per_length=per_length,
                 translation_percent=float(np.mean([each.translation_percent for each in found])),
                 rotation_deg_per_m=float(np.mean([each.rotation_deg_per_m for each in found])),
                 segments=sum(each.segments for each in found), covered=int(covered.sum()),
                 reference_poses=int(covered.size))


def _segment_drift(reference: Trajectory, estimated: np.ndarray, covered: np.ndarray, length: float) -> SegmentDrift:
    way = reference.way
    # A length that the way meets exactly must not be missed for a rounding error of the sum.
    last = np.searchsorted(way, way + length - 1e-9)
    first = np.flatnonzero(last < len(way))
    first = first[covered[first] & covered[last[first]]]
    last = last[first]
    if first.size == 0:
        return SegmentDrift(length, 0, None, None)
    error = between(between(reference.poses[first], reference.poses[last]), between(estimated[first], estimated[last]))
    translation = np.hypot(error[:, 0], error[:, 1]).mean() / length
    rotation = np.degrees(np.abs(error[:, 2])).mean() / length
    return SegmentDrift(length, int(first.size), 100.0 * float(translation), float(rotation))
