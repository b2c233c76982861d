"""What scans tell of the wheels: systematic errors, the laser's place, the floor, and how much is noise."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np
from scipy.optimize import nnls

UNKNOWN = np.array([0.3, 0.3, 0.3, 0.5, 0.03, 0.03])  # std of each error before the log has been looked at
DEFAULT_NOISE = np.array([0.05, 0.04, 0.10, 0.15])  # as in config/sckf_odometry.yaml
LEAST_NOISE = 0.005  # a log on which nothing is seen of one does not say that there is none
ROBUST = 2.0  # residuals of so many std weigh half: wheels that slip are nothing systematic
ITERATIONS = 20


class CalibrationError(ValueError):
    """What the displacements do not tell, and what is expected of them."""


@dataclass(frozen=True)
class Calibration:
    """errors: s and r, by which way and rotation are longer than the wheels say [1]; k, the rotation that goes with the
    way [rad/m]; l, how much farther ahead the laser is of the point about which the wheels turn than is told [m]; by how
    much the floor takes the robot along per metre, in x and y of the frame of the headings [1].
    noise: std after 1 m and 1 rad, of x and y [m] and of yaw [rad]: the odometry_... parameters in their order."""
    errors: np.ndarray
    std: np.ndarray
    noise: np.ndarray


def _problem(wheels: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """What each of the errors adds to x, y, yaw: n x 3 x 6."""
    x, y, yaw = wheels.T
    rows = np.zeros((len(wheels), 3, len(UNKNOWN)))
    rows[:, 0, 0], rows[:, 1, 0] = x, y
    rows[:, 2, 1], rows[:, 2, 2] = yaw, x
    rows[:, 0, 3], rows[:, 1, 3] = np.cos(yaw) - 1.0, np.sin(yaw)
    ahead, across = np.hypot(x, y) * np.cos(headings), np.hypot(x, y) * np.sin(headings)
    rows[:, 0, 4], rows[:, 1, 4] = ahead, -across
    rows[:, 0, 5], rows[:, 1, 5] = across, ahead
    return rows


def _variance(wheels: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Of x, y, yaw by the wheels' noise, n x 3."""
    way, turned = np.hypot(wheels[:, 0], wheels[:, 1]), np.abs(wheels[:, 2])
    place = noise[0] ** 2 * way + noise[1] ** 2 * turned
    return np.stack([place, place, noise[2] ** 2 * way + noise[3] ** 2 * turned], axis=1)


def _errors(rows: np.ndarray, difference: np.ndarray, variance: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Robust least squares (Cauchy), and the std of what it finds, whatever the residuals are like (sandwich)."""
    A, z = rows.reshape(-1, len(UNKNOWN)), difference.reshape(-1)
    p = np.zeros(len(UNKNOWN))
    for _ in range(ITERATIONS):
        e = z - A @ p
        weight = 1.0 / (variance.reshape(-1) * (1.0 + e ** 2 / (ROBUST ** 2 * variance.reshape(-1))))
        inverse = np.linalg.inv((A * weight[:, None]).T @ A + np.diag(UNKNOWN ** -2.0))
        p = inverse @ (A * weight[:, None]).T @ z
    e = z - A @ p
    far = e ** 2 / (ROBUST ** 2 * variance.reshape(-1))
    slope = (1.0 - far) / (1.0 + far) ** 2 / variance.reshape(-1)  # of e x weight: by so much p follows a residual
    spread = A * (weight * e)[:, None]
    inverse = np.linalg.inv((A * slope[:, None]).T @ A + np.diag(UNKNOWN ** -2.0))
    return p, np.sqrt(np.diag(inverse @ (spread.T @ spread + np.diag(UNKNOWN ** -2.0)) @ inverse))


def _noise(wheels: np.ndarray, residual: np.ndarray, matching: np.ndarray) -> np.ndarray:
    """From the squares of the residuals less what matching errs by; those that the gate would take for slip aside."""
    way, turned = np.hypot(wheels[:, 0], wheels[:, 1]), np.abs(wheels[:, 2])
    squared = residual ** 2 - matching
    noise = DEFAULT_NOISE
    for _ in range(ITERATIONS):
        expected = _variance(wheels, noise) + matching
        kept = np.all(residual ** 2 < 9.0 * expected, axis=1)
        if not kept.any():
            x, y, yaw = np.median(np.abs(residual), axis=0)
            raise CalibrationError(f"wheels and scans contradict each other at each of {len(wheels)} displacements, by "
                                   f"{x:.2g} m, {y:.2g} m, {yaw:.2g} rad (median): expected some that differ by what wheels err")
        found = []
        for axes in ((0, 1), (2,)):
            weight = np.concatenate([1.0 / expected[kept, axis] for axis in axes])
            A = np.concatenate([np.stack([way[kept], turned[kept]], axis=1) for _ in axes])
            z = np.concatenate([squared[kept, axis] for axis in axes])
            found += list(np.sqrt(nnls(A * weight[:, None], z * weight)[0]))
        noise = np.maximum(np.array(found), LEAST_NOISE)
    return noise


def calibrate(wheels: np.ndarray, displacements: np.ndarray, matching: np.ndarray, headings: np.ndarray) -> Calibration:
    """wheels, displacements: x, y [m], yaw [rad] from scan to scan, by the wheels alone and by the scans; matching: what
    the latter err by, variances. All n x 3. headings: n, of the robot at the scans before [rad]."""
    difference = displacements - wheels
    difference[:, 2] = np.remainder(difference[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    rows = _problem(wheels, headings)
    noise = DEFAULT_NOISE
    for _ in range(3):  # the noise weighs the errors, which leave the noise
        errors, std = _errors(rows, difference, _variance(wheels, noise) + matching)
        noise = _noise(wheels, difference - rows @ errors, matching)
    return Calibration(errors, std, noise)
