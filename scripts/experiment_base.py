"""What the experiments have in common: what is asked for, tables, pictures, and what is told of them."""
from __future__ import annotations

import csv
import json
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Optional, Sequence

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from programs import run_program  # noqa: E402

WITH, WITHOUT, TRUTH, GREY, GREEN = "#1f6fb4", "#e4572e", "black", "#7a8fa6", "#3a8f5c"
COLOURS = {"sckf": WITH, "sckf_nc": WITHOUT, "pseudo_absolute": GREEN, "dead_reckoning": GREY,
           "displacement_only": WITH, "displacement_only_nc": WITHOUT}
NAMES = {"sckf": "SC-KF", "sckf_nc": "SC-KF-NC", "pseudo_absolute": "pseudo-absolute",
         "dead_reckoning": "dead reckoning", "displacement_only": "with C (33)", "displacement_only_nc": "without C"}


class ExperimentError(Exception):
    """Why an experiment cannot be, for a person to read."""


@dataclass
class Setting:
    """What the command line asks for."""
    output: Path
    bin_dir: Optional[Path] = None
    runs: int = 0
    seed: int = 1
    bag: Optional[Path] = None
    reference: Optional[Path] = None
    simulation: List[str] = field(default_factory=list)
    scan_topic: str = "/scan"
    odom_topic: str = "/odom"
    base_frame: str = "base_link"


@dataclass
class Result:
    """One experiment, ready to be told: numbers are what a test looks at, the rest is for the reader."""
    name: str
    title: str
    text: List[str] = field(default_factory=list)
    figures: List[str] = field(default_factory=list)
    numbers: Dict[str, float] = field(default_factory=dict)

    def markdown(self) -> str:
        parts = [f"## `{self.name}`: {self.title}", *self.text]
        parts += [f"![{self.name}]({figure})" for figure in self.figures]
        return "\n\n".join(parts) + "\n"

    def save(self, output: Path) -> None:
        (output / f"{self.name}.json").write_text(json.dumps(self.numbers, indent=2) + "\n")


def run(setting: Setting, name: str, arguments: Sequence[object]) -> str:
    """Runs a program of the package; returns what it prints."""
    return run_program(name, arguments, setting.bin_dir)


def simulate(setting: Setting, name: str) -> None:
    run(setting, "experiment_data", [name, "--output", setting.output, "--runs", setting.runs, "--seed", setting.seed,
                                     *setting.simulation])


def read_table(path: Path) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of no rows, which is told below
        with open(path, newline="", encoding="utf-8") as file:  # where a reason has commas it is quoted
            rows = [",".join(cell.replace(",", ";") for cell in row) for row in csv.reader(file)]
        table = np.atleast_1d(np.genfromtxt(rows, delimiter=",", names=True, dtype=None, encoding="utf-8"))
    if table.size == 0:
        raise ExperimentError(f"{path}: expected rows, there are none: with these options nothing is simulated")
    return table


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def paragraph(text: str) -> str:
    """The text on one line, wherever its lines break in the source."""
    return " ".join(text.split())


def new_figure(rows: int, columns: int, width: float, height: float,
               **options: object) -> tuple[plt.Figure, np.ndarray]:
    plt.rcParams.update({"font.size": 12, "axes.titlesize": 13, "legend.fontsize": 11, "legend.framealpha": 0.85})
    figure, panels = plt.subplots(rows, columns, figsize=(width, height), squeeze=False, **options)
    for panel in panels.flat:
        panel.grid(alpha=0.3)
    return figure, panels


def save_figure(figure: plt.Figure, setting: Setting, name: str) -> str:
    figure.tight_layout()
    figure.savefig(setting.output / name, dpi=90, bbox_inches="tight")
    plt.close(figure)
    return name
