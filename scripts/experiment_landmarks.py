"""Landmarks beside displacements, on a robot's log: each alone, and both (section VI-5 of the paper)."""
from __future__ import annotations

from pathlib import Path
from typing import Dict, NamedTuple

import numpy as np

from experiment_base import (GREEN, GREY, WITH, WITHOUT, Result, Setting, markdown_table, new_figure, paragraph, run,
                             save_figure)
from experiment_logs import Estimates, end_error, last_revisit, log_bag, read_estimates
from recording import Topics, read_recording
from trajectory import Trajectory, drift, read_tum, sample


class Mode(NamedTuple):
    """Which landmarks, and how they are drawn."""
    name: str
    landmarks: str
    only: bool
    colour: str
    style: str


MODES = {"none": Mode("displacements", "none", False, WITH, "-"),
         "only": Mode("landmarks", "corners_and_lines", True, GREY, ":"),
         "corners": Mode("both, corners", "corners", False, GREEN, "--"),
         "lines": Mode("both, lines", "lines", False, WITHOUT, "-."),
         "corners_and_lines": Mode("both, corners and lines", "corners_and_lines", False, "black", ":")}


def replay_with(setting: Setting, bag: Path, mode: str) -> Estimates:
    params = setting.output / f"landmarks_{mode}.yaml"
    # Alone they have to be found again from where the wheels lead.
    alone = "landmarks_only: true\nlandmark_max_std: 0.5\n" if MODES[mode].only else ""
    params.write_text(f"landmarks: {MODES[mode].landmarks}\n{alone}")
    csv = setting.output / f"landmarks_{mode}.csv"
    run(setting, "replay", [bag, "--params", params, "--csv", csv, "--trajectory", csv.with_suffix(".tum"),
                            "--scan-topic", setting.scan_topic, "--odom-topic", setting.odom_topic])
    return read_estimates(csv)


def rms_after_alignment(reference: Trajectory, estimate: Trajectory) -> float:
    """Of the distances between the two [m], the estimate moved and turned so that they are as small as possible."""
    poses, covered = sample(estimate, reference.stamps)
    truth, found = reference.poses[covered, :2], poses[covered, :2]
    truth, found = truth - truth.mean(axis=0), found - found.mean(axis=0)
    dot, cross = (truth * found).sum(), (found[:, 0] * truth[:, 1] - found[:, 1] * truth[:, 0]).sum()
    yaw = np.arctan2(cross, dot)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return float(np.sqrt(((truth - found @ turn.T) ** 2).sum(axis=1).mean()))


def landmarks(setting: Setting) -> Result:
    bag = log_bag(setting)
    estimates = {mode: replay_with(setting, bag, mode) for mode in MODES}
    result = Result("landmarks", "corners and lines as landmarks in the state (`landmarks`)",
                    figures=[_draw(setting, estimates)])
    columns = _at_the_revisit(setting, bag, estimates, result)
    if setting.reference:
        columns.update(_against_reference(read_tum(setting.reference), estimates, result))
    rows = [[mode.name, *(column[key] for column in columns.values())] for key, mode in MODES.items()]
    result.text = [
        paragraph(f"""
            Log: `{bag.name}`. The same scans by displacements only, by landmarks only (corners and lines), and by
            both, where what a landmark is made of is taken out of the scans that are matched. The drift over short
            segments says how well the pose goes on from where it is; a landmark that is seen again takes back what has
            come together since, in a step, which the drift counts as an error and the whole trajectory as none."""),
        markdown_table(["", *columns], rows)]
    return result


def _at_the_revisit(setting: Setting, bag: Path, estimates: Dict[str, Estimates],
                    result: Result) -> Dict[str, Dict[str, str]]:
    recording = read_recording(str(bag), Topics(setting.scan_topic, setting.odom_topic, base_frame=setting.base_frame))
    revisit = last_revisit(recording, estimates["none"])
    if not revisit:
        return {}
    errors = {mode: end_error(revisit, recording.stamps, each) for mode, each in estimates.items()}
    result.numbers.update({f"{mode}_end": error.distance for mode, error in errors.items()})
    return {"error at the end": {mode: f"{error.distance:.2f} m, {abs(np.degrees(error.yaw)):.2f}°"
                                 for mode, error in errors.items()}}


def _against_reference(reference: Trajectory, estimates: Dict[str, Estimates],
                       result: Result) -> Dict[str, Dict[str, str]]:
    columns: Dict[str, Dict[str, str]] = {"drift": {}, "rms error of the whole": {}}
    for mode, each in estimates.items():
        found = drift(reference, each.trajectory)
        rms = rms_after_alignment(reference, each.trajectory)
        result.numbers.update({f"{mode}_drift_percent": found.translation_percent, f"{mode}_rms": rms})
        columns["drift"][mode] = f"{found.translation_percent:.2f} %, {found.rotation_deg_per_m:.3f} °/m"
        columns["rms error of the whole"][mode] = f"{rms:.2f} m"
    return columns


def _draw(setting: Setting, estimates: Dict[str, Estimates]) -> str:
    figure, ((panel,),) = new_figure(1, 1, 8.0, 6.0)
    for key, mode in MODES.items():
        path = estimates[key].poses
        panel.plot(path[:, 0], path[:, 1], mode.style, color=mode.colour, linewidth=1.8, label=mode.name)
    panel.set(xlabel="x [m]", ylabel="y [m]")
    panel.set_aspect("equal")
    panel.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return save_figure(figure, setting, "extensions_landmarks.png")
