"""Values of the command line that the scripts share, refused where they cannot be."""
from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Callable, Optional

from matplotlib.backend_bases import FigureCanvasBase


def topic(text: str) -> str:
    """With the slash that a bag has before each name, as replay takes it."""
    if not text.strip("/"):
        raise argparse.ArgumentTypeError(f"expected the name of a topic: '{text}'")
    return text if text.startswith("/") else f"/{text}"


def picture(text: str) -> str:
    """A file of a kind that can be drawn; PNG where the name tells none."""
    kinds = FigureCanvasBase.get_supported_filetypes()
    path = Path(text)
    if path.is_dir() or path.suffix[1:].lower() not in ("", *kinds):
        raise argparse.ArgumentTypeError(f"expected a file, by its name one of {', '.join(sorted(kinds))}: {text}")
    return text


def not_negative(text: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"expected a number: {text}") from error
    if not (math.isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"expected 0 or more, finite: {text}")
    return value


def within(least: float, most: float) -> Callable[[str], float]:
    """A number of a range."""
    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"expected {least:g} to {most:g}: {text}")
        return value
    return parse


def whole(least: int, most: Optional[int] = None) -> Callable[[str], int]:
    """A whole number of a range."""
    expected = f"a whole number, {least} or more" if most is None else f"a whole number, {least} to {most}"

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"expected {expected}: {text}") from error
        if value < least or most is not None and value > most:
            raise argparse.ArgumentTypeError(f"expected {expected}: {text}")
        return value
    return parse
