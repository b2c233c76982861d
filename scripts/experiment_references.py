"""Several states (section V-B of the paper): a scan compared with one pose of the past and with more, on a log."""
from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Tuple

from experiment_base import (GREY, WITH, WITHOUT, ExperimentError, Result, Setting, markdown_table, new_figure,
                             paragraph, run, save_figure)
from trajectory import Drift, Trajectory, drift, read_tum

SIMULATED = Path("/usr/share/mrpt/datasets/graphslam-engine-demos/action_observations_map/simul.rawlog")
# Poses that a displacement constrains: the present one, that of the newest reference, and those of older ones.
POSES = (2, 3, 4, 5, 8)
DEFAULT = 5


@dataclass(frozen=True)
class Outcome:
    drift: Drift
    older: float           # references that correct the estimate beside the newest, mean of those scans
    time: float            # median of a scan that becomes a reference, and is compared with older ones [s] …
    time_of_others: float  # … and of every scan [s]


def log_with_reference(setting: Setting) -> Tuple[Path, Trajectory]:
    """What was asked for, if both were; otherwise the simulated log that comes with MRPT, and its truth."""
    if setting.bag and setting.reference:
        return setting.bag, read_tum(setting.reference)
    bag, tum = setting.output / "simulated.bag", setting.output / "simulated.tum"
    if not SIMULATED.exists():
        raise ExperimentError(f"{SIMULATED}: not there; install mrpt-common, or name --bag and --reference")
    if not tum.exists():
        run(setting, "rawlog_to_bag", [SIMULATED, bag, "--ground-truth", f"{SIMULATED}.GT.txt", "--tum", tum])
    return bag, read_tum(tum)


def replay_with(setting: Setting, bag: Path, reference: Trajectory, poses: int) -> Outcome:
    params = setting.output / f"references_{poses}.yaml"
    params.write_text(f"older_references: {poses - 2}\n")
    output = setting.output / f"references_{poses}.tum"
    topics = ["--scan-topic", setting.scan_topic, "--odom-topic", setting.odom_topic] if setting.reference else []
    said = run(setting, "replay", [bag, "--params", params, "--trajectory", output, *topics])
    medians = re.findall(r"^(time of .+): median ([0-9.]+) ms", said, re.MULTILINE)
    times = {what: 1e-3 * float(milliseconds) for what, milliseconds in medians}
    used = re.search(r"older references used ([0-9]+) times, by ([0-9]+) scans", said)
    return Outcome(drift(reference, read_tum(output)), int(used[1]) / int(used[2]) if used else 0.0,
                   times["time of a scan that became a reference"], times["time of a scan"])


def references(setting: Setting) -> Result:
    bag, reference = log_with_reference(setting)
    outcomes = {poses: replay_with(setting, bag, reference, poses) for poses in POSES}
    result = Result("references", "several references at once (`older_references`, section V-B)",
                    figures=[_draw(setting, outcomes)])
    two = outcomes[POSES[0]]
    rows: List[List[str]] = []
    for poses, each in outcomes.items():
        result.numbers.update({f"{poses}_drift_percent": each.drift.translation_percent,
                               f"{poses}_drift_deg_per_m": each.drift.rotation_deg_per_m,
                               f"{poses}_older": each.older, f"{poses}_time_ratio": each.time / two.time})
        rows.append([f"{poses}{' (default)' if poses == DEFAULT else ''}", str(poses - 2), f"{each.older:.1f}",
                     f"{each.drift.translation_percent:.2f} %, {each.drift.rotation_deg_per_m:.3f} °/m",
                     f"{1e3 * each.time:.2f} ms", f"{each.time / two.time:.2f}", f"{1e3 * each.time_of_others:.2f} ms"])
    result.text = [
        paragraph(f"""
            Log: `{bag.name}`. A scan that becomes a reference is matched with L − 1 references, and the displacements
            correct the present pose and the clones of all references in one filter that knows how they are correlated,
            by poses and by the ranges that they share. The time is the median of such a scan, everything counted:
            it is nearly all matching, and grows with the number of references that are used: those that are near enough
            and show enough of what the scan shows. Scans in between are compared with the newest one alone."""""),
        markdown_table(["poses L", "`older_references`", "used, mean", "drift",
                        "time of a scan that becomes a reference", "… over that of L = 2", "of every scan"], rows)]
    return result


def _draw(setting: Setting, outcomes: Dict[int, Outcome]) -> str:
    figure, ((accuracy, cost),) = new_figure(1, 2, 11.0, 4.2)
    poses = list(outcomes)
    accuracy.plot(poses, [each.drift.translation_percent for each in outcomes.values()], "o-", color=WITH)
    accuracy.set(xlabel="poses L", ylabel="drift [%]", ylim=(0.0, None), xticks=poses)
    cost.plot(poses, [1e3 * each.time for each in outcomes.values()], "s-", color=WITHOUT,
              label="of a scan that becomes a reference")
    cost.plot(poses, [1e3 * each.time_of_others for each in outcomes.values()], "^--", color=GREY, label="of all scans")
    cost.set(xlabel="poses L", ylabel="median time [ms]", ylim=(0.0, None), xticks=poses)
    cost.legend(loc="center right")
    return save_figure(figure, setting, "extensions_references.png")
