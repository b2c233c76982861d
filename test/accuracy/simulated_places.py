"""Places that a simulated robot drives through, each hard for a scan matcher in its own way."""
from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, Sequence

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "ros"))
from simulated_bag import polygon  # noqa: E402


@dataclass(frozen=True)
class Place:
    """Walls: n x 2 x 2, the ends of each in x and y [m]. Way: the corners of the robot's, m x 2."""
    walls: np.ndarray
    way: np.ndarray
    strollers: int = 0  # people who walk about
    outdoors: bool = False  # beams get lost, or meet the ground


def disc(centre: Sequence[float], radius: float, sides: int = 8) -> np.ndarray:
    angles = np.arange(sides) * 2.0 * math.pi / sides
    return polygon(np.asarray(centre) + radius * np.column_stack((np.cos(angles), np.sin(angles))))


def box(x: float, y: float, width: float, height: float, turned: float = 0.0) -> np.ndarray:
    c, s = math.cos(turned), math.sin(turned)
    corners = np.array([(-width, -height), (width, -height), (width, height), (-width, height)]) / 2.0
    return polygon(np.array([x, y]) + corners @ np.array([[c, s], [-s, c]]))


def rough(walls: np.ndarray, draws: np.random.Generator, step: float = 0.3, std: float = 0.05) -> np.ndarray:
    """Each wall with a corner every step [m] that stands out or back."""
    pieces = []
    for begin, end in walls:
        along = end - begin
        length = math.hypot(*along)
        count = max(1, int(length / step))
        off = np.concatenate(([0.0], draws.normal(0.0, std, count - 1), [0.0]))
        corners = begin + np.outer(np.arange(count + 1) / count, along) + np.outer(off, (-along[1], along[0])) / length
        pieces.append(np.stack((corners[:-1], corners[1:]), axis=1))
    return np.concatenate(pieces)


def distance_to_way(point: Sequence[float], way: np.ndarray) -> float:
    steps = np.diff(way, axis=0)
    from_begins = np.asarray(point) - way[:-1]
    shares = np.clip((from_begins * steps).sum(axis=1) / (steps**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(from_begins - shares[:, None] * steps).T).min())


def with_doors(corners: np.ndarray, depth: float, jitter: float, draws: np.random.Generator) -> np.ndarray:
    """The walls of a polygon, with a door every 4 m that is set back to the right of who walks along them. Jitter: how
    far doors are from where the next one would be expected [m]."""
    width, period = 0.9, 4.0
    outline = []
    for begin, end in polygon(corners):
        length = math.hypot(*(end - begin))
        along = (end - begin) / length
        back = depth * np.array([along[1], -along[0]])
        outline.append(begin)
        for door in np.arange(period / 2.0, length - width - jitter, period):
            left = begin + (door + draws.uniform(-jitter, jitter)) * along
            right = left + width * along
            outline += [left, left + back, right + back, right]
    return polygon(np.array(outline))


def ring(depth: float, jitter: float, draws: np.random.Generator) -> Place:
    """A corridor of 2.4 m round a block."""
    length, height, width = 150.0, 60.0, 2.4
    outer = np.array([(0, 0), (length, 0), (length, height), (0, height)], dtype=float)
    inner = np.array([(width, width), (width, height - width), (length - width, height - width), (length - width, width)])
    walls = [with_doors(each, depth, jitter, draws) if depth else polygon(each) for each in (outer, inner)]
    near, far, top = width / 2.0, length - width / 2.0, height - width / 2.0
    return Place(np.concatenate(walls), np.array([(near, near), (far, near), (far, top), (near, top), (near, near + 1.0)]))


def corridor(draws: np.random.Generator) -> Place:
    """Long, with shallow doors here and there."""
    return ring(0.12, 1.2, draws)


def hotel(draws: np.random.Generator) -> Place:
    """Long, with doors that are one as the other, every four metres."""
    return ring(0.25, 0.0, draws)


def bare(draws: np.random.Generator) -> Place:
    """Long, with nothing but two walls."""
    return ring(0.0, 0.0, draws)


def museum(draws: np.random.Generator) -> Place:
    """Three halls full of round and square things, among which people stroll."""
    width, height = 60.0, 40.0
    round_two_halls = [(57, 17), (57, 2.5), (43, 2.5), (43, 17), (23, 17), (23, 2.5), (37, 2.5), (37, 17), (17, 17)]
    way = np.array([(3, 17), *round_two_halls, (17, 2.5), (3, 2.5), (3, 17), *round_two_halls], dtype=float)
    walls = [box(width / 2.0, height / 2.0, width, height)]
    for x in (20.0, 40.0):  # between halls, with a passage
        walls.append(np.array([[(x, 0), (x, 15)], [(x, 19), (x, height)]], dtype=float))
    for x in np.arange(4.0, width, 6.0):
        for y in np.arange(5.0, height, 7.0):
            at = (x + draws.uniform(-1.0, 1.0), y + draws.uniform(-1.0, 1.0))
            is_round, size, turned = draws.random() < 0.6, draws.uniform(0.2, 0.5), draws.uniform(0.0, math.pi)
            if distance_to_way(at, way) > 1.5 and abs(x % 20.0) > 1.5:
                walls.append(disc(at, size, 12) if is_round else box(*at, 1.2, 0.8, turned))
    return Place(np.concatenate(walls), way, strollers=25)


def castle(draws: np.random.Generator) -> Place:
    """Round a keep, between walls of rough stone, twice."""
    width, height, gap = 50.0, 35.0, 3.0
    walls = [box(width / 2.0, height / 2.0, width, height), box(width / 2.0, height / 2.0, width - 12.0, height - 12.0)]
    for _ in range(18):  # blocks along the outer wall
        at = draws.uniform(1.0, width - 1.0), draws.choice((0.7, height - 0.7))
        walls.append(box(*at, draws.uniform(0.5, 2.0), draws.uniform(0.4, 1.2), draws.uniform(0.0, math.pi)))
    once = [(gap, gap), (width - gap, gap), (width - gap, height - gap), (gap, height - gap)]
    return Place(rough(np.concatenate(walls), draws), np.array([*once, *once, (gap, gap + 2.0)]))


def campus(draws: np.random.Generator) -> Place:
    """Trees and bushes, and houses far away."""
    way = np.array([(0, 0), (80, 0), (90, 15), (60, 25), (0, 20), (-5, 5), (30, 0), (40, -15), (80, -15), (85, 0), (0, 0)],
                   dtype=float)
    houses = [(40, 45, 60, 20), (-20, 10, 18, 60), (110, 10, 18, 70), (40, -35, 70, 18)]
    walls = [rough(box(*house), draws, step=1.0) for house in houses]
    for _ in range(160):
        at, radius = (draws.uniform(-10.0, 100.0), draws.uniform(-25.0, 34.0)), draws.uniform(0.08, 0.35)
        if distance_to_way(at, way) > 1.0:
            walls.append(disc(at, radius))
    return Place(np.concatenate(walls), way, outdoors=True)


PLACES: Dict[str, Callable[[np.random.Generator], Place]] = {
    build.__name__: build for build in (corridor, hotel, bare, museum, castle, campus)}
