"""What one update of the filter with several clones costs, by what is in its state."""
from __future__ import annotations

from typing import Dict

import numpy as np

from experiment_base import (GREEN, GREY, WITH, WITHOUT, Result, Setting, markdown_table, new_figure, paragraph,
                             read_table, save_figure, simulate)

# What grows: its column, what it is called, and its colour.
VARIED = {"clones": ("states", "states N, by clones of 360 ranges each", WITH),
          "landmarks": ("states", "states N, by landmarks", GREEN),
          "ranges": ("ranges", "ranges M of a scan", WITHOUT)}


def update_cost(setting: Setting) -> Result:
    simulate(setting, "update_cost")
    table = read_table(setting.output / "update_cost.csv")
    parts = {name: table[table["varied"] == name] for name in VARIED}
    result = Result("update_cost", "what one update costs", figures=[_draw(setting, parts)])
    rows = []
    for name, part in parts.items():
        column, label, _ = VARIED[name]
        upper = part[len(part) // 2:]
        slope = float(np.polyfit(np.log(upper[column].astype(float)), np.log(upper["time"]), 1)[0])
        result.numbers[f"slope_{name}"] = slope
        rows.append([label, f"{part[column][0]} to {part[column][-1]}",
                     f"{1e3 * part['time'][0]:.3f} to {1e3 * part['time'][-1]:.3f} ms", f"{slope:.2f}"])
    result.text = [
        paragraph("""
            Innovation and update by a displacement from the oldest clone, which corrects every state, without the
            matching. With every clone come the ranges of its scan, whose correlation with every state is kept and
            corrected, by the q combinations of them that displacements were made of: the time is of the order of
            N² + N Σq + q M, linear in the points and at most quadratic in the states; one matrix of all would take
            (N + ΣM)². The exponent is fitted to the upper half. By default 16 references are
            kept, of each laser; what no cache holds any more costs more than its size tells."""),
        markdown_table(["what grows", "from … to", "time", "exponent"], rows)]
    return result


def _draw(setting: Setting, parts: Dict[str, np.ndarray]) -> str:
    figure, panels = new_figure(1, 2, 11.0, 4.2)
    by_states, by_ranges = panels[0]
    for name, part in parts.items():
        column, label, colour = VARIED[name]
        panel = by_ranges if name == "ranges" else by_states
        panel.plot(part[column], 1e3 * part["time"], "o-", color=colour, label=label)
    for panel, power, column in ((by_states, 2, "states"), (by_ranges, 1, "ranges")):
        last = parts["clones" if column == "states" else "ranges"]
        x = last[column].astype(float)
        panel.plot(x, 1e3 * last["time"][-1] * (x / x[-1]) ** power, ":", color=GREY, label=f"exponent {power}")
        panel.set(xscale="log", yscale="log", ylabel="time of an update [ms]",
                  xlabel="states N" if column == "states" else "ranges M of a scan, three clones")
        panel.legend(loc="upper left")
    return save_figure(figure, setting, "extensions_update_cost.png")
