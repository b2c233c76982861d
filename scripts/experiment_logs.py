"""The experiments of the paper on a robot's log: all methods, and displacements alone."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional

import numpy as np

from experiment_base import (COLOURS, GREY, NAMES, TRUTH, ExperimentError, Result, Setting, markdown_table, new_figure,
                             paragraph, read_table, run, save_figure)
from recording import Recording, Topics, read_recording
from revisit import MIN_OVERLAP, Revisit, Surface, align, candidates, transformed
from trajectory import Trajectory, TrajectoryError, between, compose, drift, read_tum, sample, wrap

MALAGA = Path("/usr/share/mrpt/datasets/2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog")
FUSING = ("sckf", "sckf_nc", "pseudo_absolute", "dead_reckoning")
# What the paper tells of its own log: m, m, degrees, percent of the way.
PAPER = {"sckf": (0.50, 0.44, -0.11, 0.4), "sckf_nc": (0.61, 0.65, -0.13, 0.54),
         "pseudo_absolute": (15.0, 7.1, -32.0, 10.6), "dead_reckoning": (32.4, 6.0, -70.0, 19.9)}
COMPONENTS = (("x", "m²"), ("y", "m²"), ("yaw", "rad²"))


@dataclass(frozen=True)
class Estimates:
    """What a method made of a log: at the stamps (n), poses and covariances (n x 3 x 3)."""
    stamps: np.ndarray
    poses: np.ndarray
    covariances: np.ndarray

    @property
    def trajectory(self) -> Trajectory:
        return Trajectory(self.stamps, self.poses)


@dataclass(frozen=True)
class EndError:
    """How far a trajectory is off where the robot comes back, in the axes of odom."""
    x: float
    y: float
    yaw: float  # [rad]

    @property
    def distance(self) -> float:
        return float(np.hypot(self.x, self.y))


def log_bag(setting: Setting) -> Path:
    """The bag that was asked for, or that of the log of the Málaga campus that comes with MRPT."""
    if setting.bag:
        return setting.bag
    bag = setting.output / "malaga.bag"
    if not bag.exists():
        if not MALAGA.exists():
            raise ExperimentError(f"{MALAGA}: not there; install mrpt-common, or name a bag with --bag")
        run(setting, "rawlog_to_bag", [MALAGA, bag])
    return bag


def replay(setting: Setting, bag: Path, method: str, every_scan: bool) -> Estimates:
    """every_scan: each scan becomes the reference of the next, as in the paper; otherwise references are kept."""
    params = setting.output / "reference_at_every_scan.yaml"
    params.write_text("kf_dist_linear: 0.0\nkf_dist_angular: 0.0\n")
    name = f"{method}_{'every_scan' if every_scan else 'kept'}"
    csv = setting.output / f"log_{name}.csv"
    run(setting, "replay", [bag, "--method", method, "--csv", csv, "--trajectory", setting.output / f"log_{name}.tum",
                            "--scan-topic", setting.scan_topic, "--odom-topic", setting.odom_topic,
                            *(["--params", params] if every_scan else [])])
    return read_estimates(csv)


def read_estimates(path: Path) -> Estimates:
    table = read_table(path)
    table = table[np.isfinite(table["x"].astype(float))]
    entries = [["var_x", "cov_xy", "cov_xyaw"], ["cov_xy", "var_y", "cov_yyaw"], ["cov_xyaw", "cov_yyaw", "var_yaw"]]
    covariances = np.array([[table[entry] for entry in row] for row in entries]).transpose(2, 0, 1)
    return Estimates(table["stamp"], np.column_stack([table[name] for name in ("x", "y", "yaw")]), covariances)


def end_error(revisit: Revisit, stamps: np.ndarray, estimates: Estimates) -> EndError:
    """The pose at the revisit against the one that the scans show, seen from the pose of the first pass."""
    poses, covered = sample(estimates.trajectory, stamps[[revisit.first, revisit.second]])
    if not covered.all():
        raise ExperimentError("an estimate does not reach to where the robot comes back")
    expected = compose(poses[0], revisit.first_from_second)
    return EndError(*(poses[1][:2] - expected[:2]), float(wrap(poses[1][2] - expected[2])))


def last_revisit(recording: Recording, estimates: Estimates) -> Optional[Revisit]:
    """As the last of revisit.find_revisits(), found from the end."""
    poses, covered = sample(estimates.trajectory, recording.stamps)
    scans = np.flatnonzero(covered)
    way = Trajectory(recording.stamps[scans], poses[scans]).way
    for first, second in reversed(list(candidates(poses[scans], way))):
        guess = between(poses[scans[first]], poses[scans[second]])
        found = align(Surface(recording.clouds[scans[first]]), recording.clouds[scans[second]], guess)
        if found.overlap >= MIN_OVERLAP:
            return Revisit(int(scans[first]), int(scans[second]), found.pose)
    return None


def mean_nees(reference: Trajectory, estimates: Estimates) -> float:
    """Of the poses, the reference moved so that both start alike."""
    truth, covered = sample(reference, estimates.stamps)
    first, *rest = np.flatnonzero(covered)
    moved = compose(compose(estimates.poses[first], _inverse(truth[first])), truth[rest])
    errors = np.column_stack((moved[:, :2] - estimates.poses[rest, :2], wrap(moved[:, 2] - estimates.poses[rest, 2])))
    growth = estimates.covariances[rest]
    regular = np.linalg.det(growth) > 0.0
    return float(np.einsum("ni,nij,nj->n", errors[regular], np.linalg.inv(growth[regular]), errors[regular]).mean())


def _inverse(pose: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array([-cos * pose[0] - sin * pose[1], sin * pose[0] - cos * pose[1], -pose[2]])


def four_methods(setting: Setting) -> Result:
    bag = log_bag(setting)
    recording = read_recording(str(bag), Topics(setting.scan_topic, setting.odom_topic, base_frame=setting.base_frame))
    paper = {method: replay(setting, bag, method, True) for method in FUSING}
    kept = {method: replay(setting, bag, method, False) for method in FUSING}
    way = float(paper["sckf"].trajectory.way[-1])
    result = Result("four_methods", "one log, all methods (figures 2 and 3)")
    result.figures = [_draw_trajectories(setting, recording, paper), _draw_covariances(setting, paper, log=True)]
    result.text = [f"Log: `{bag.name}`, {len(recording.stamps)} scans, {way:.0f} m. In the figures every scan is the "
                   "reference of the next, as in the paper."]
    revisit = last_revisit(recording, kept["sckf"])
    if revisit:
        result.text += _tell_end_errors(result, revisit, recording.stamps, {"every_scan": paper, "kept": kept})
    else:
        result.text.append("The robot does not come back to a place where it was: no error at the end is known.")
    if setting.reference:
        result.text.append(_tell_reference(result, setting.reference, {"every_scan": paper, "kept": kept}))
    return result


def _tell_end_errors(result: Result, revisit: Revisit, stamps: np.ndarray,
                     runs: Dict[str, Dict[str, Estimates]]) -> List[str]:
    way = np.interp(stamps[[revisit.first, revisit.second]], runs["kept"]["sckf"].stamps,
                    runs["kept"]["sckf"].trajectory.way)
    between_passes = float(way[1] - way[0])
    rows = []
    for method in FUSING:
        cells = [NAMES[method]]
        for kind, estimates in runs.items():
            error = end_error(revisit, stamps, estimates[method])
            percent = 100.0 * error.distance / between_passes
            result.numbers.update({f"{method}_{kind}_x": error.x, f"{method}_{kind}_y": error.y,
                                   f"{method}_{kind}_yaw_deg": float(np.degrees(error.yaw)),
                                   f"{method}_{kind}_percent": percent})
            cells.append(_form(error.x, error.y, np.degrees(error.yaw), percent))
        rows.append([*cells, _form(*PAPER[method])])
    order = sorted(FUSING, key=lambda m: result.numbers[f"{m}_every_scan_percent"])
    return [paragraph(f"""
        Error at the end (x, y, yaw, share of the way). The true end is not known, but the robot passes a place a
        second time: ICP of the last scan that it takes there onto one of the first pass, {between_passes:.0f} m of
        way before, tells the pose between the two. The error is what the trajectory says of it less what ICP says,
        in the axes of odom. All are held against the same pair of scans."""),
            markdown_table(["", "reference at every scan (the paper's)", "references kept (the package's default)",
                            "the paper, on its own log of 165 m"], rows),
            "Order of the errors with a reference at every scan: " + ", ".join(NAMES[method] for method in order) + "."]


def _form(x: float, y: float, yaw_deg: float, percent: float) -> str:
    return f"{x:.2f} m, {y:.2f} m, {yaw_deg:.2f}°, {percent:.2f} %"


def _tell_reference(result: Result, path: Path, runs: Dict[str, Dict[str, Estimates]]) -> str:
    reference = read_tum(path)
    rows = []
    for method in FUSING:
        cells = [NAMES[method]]
        for kind, estimates in runs.items():
            found = drift(reference, estimates[method].trajectory)
            nees = mean_nees(reference, estimates[method])
            result.numbers.update({f"{method}_{kind}_drift_percent": found.translation_percent,
                                   f"{method}_{kind}_nees": nees})
            cells += [f"{found.translation_percent:.2f} %, {found.rotation_deg_per_m:.3f} °/m", f"{nees:.2f}"]
        rows.append(cells)
    return f"Against the reference `{path.name}`; NEES is the mean over the way, and 3 would be right:\n\n" + \
        markdown_table(["", "drift, reference at every scan", "NEES", "drift, references kept", "NEES"], rows)


def _draw_trajectories(setting: Setting, recording: Recording, estimates: Dict[str, Estimates]) -> str:
    figure, ((panel,),) = new_figure(1, 1, 8.0, 7.0)
    sckf = estimates["sckf"]
    poses, covered = sample(sckf.trajectory, recording.stamps)
    points = np.vstack([transformed(poses[i], recording.clouds[i]) for i in np.flatnonzero(covered)])
    panel.plot(points[:, 0], points[:, 1], ",", color="#c5cbd3", rasterized=True, zorder=0)
    for method, style in zip(FUSING, ("-", "--", "-.", ":")):
        path = estimates[method].poses
        panel.plot(path[:, 0], path[:, 1], style, color=COLOURS[method], linewidth=2.0, label=NAMES[method])
        panel.plot(*path[-1, :2], "o", color=COLOURS[method])
    paths = np.vstack([each.poses[:, :2] for each in estimates.values()])
    low, high = paths.min(axis=0) - 6.0, paths.max(axis=0) + 6.0
    panel.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    panel.set_aspect("equal")
    panel.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), title="dots: ends")
    return save_figure(figure, setting, "four_methods.png")


def _draw_covariances(setting: Setting, estimates: Dict[str, Estimates], log: bool,
                      name: str = "four_methods_covariance.png") -> str:
    figure, panels = new_figure(3, 1, 9.0, 7.6, sharex=True)
    start = next(iter(estimates.values())).stamps[0]
    for i, (panel, (component, unit)) in enumerate(zip(panels[:, 0], COMPONENTS)):
        for (method, each), style in zip(estimates.items(), ("-", "--", "-.", ":")):
            variance = each.covariances[:, i, i]
            shown = variance > 0.0
            panel.plot(each.stamps[shown] - start, variance[shown], style, color=COLOURS[method], linewidth=1.8,
                       label=NAMES[method])
        panel.set(ylabel=f"var. of {component} [{unit}]", yscale="log" if log else "linear")
    panels[0, 0].legend(loc="lower right" if log else "upper left", ncol=2)
    panels[2, 0].set_xlabel("time [s]")
    return save_figure(figure, setting, name)


def displacement_only(setting: Setting) -> Result:
    bag = log_bag(setting)
    recording = read_recording(str(bag), Topics(setting.scan_topic, setting.odom_topic, base_frame=setting.base_frame))
    estimates = {method: replay(setting, bag, method, True) for method in ("displacement_only", "displacement_only_nc")}
    with_c, without_c = estimates["displacement_only"], estimates["displacement_only_nc"]
    result = Result("displacement_only", "the pose by scan matching alone (figures 5 and 6)")
    result.figures = [_draw_map(setting, recording, with_c),
                      _draw_covariances(setting, estimates, log=False, name="displacement_only_covariance.png")]
    ratios = []
    for i, (component, _) in enumerate(COMPONENTS):
        both = [each.covariances[:, i, i] for each in (with_c, without_c)]
        moved = both[1] > 0.0
        result.numbers[f"ratio_{component}"] = float(both[0][-1] / both[1][-1])
        result.numbers[f"median_ratio_{component}"] = float(np.median(both[0][moved] / both[1][moved]))
        result.numbers[f"share_below_{component}"] = float(np.mean(both[0][moved] <= both[1][moved] * (1 + 1e-9)))
        ratios.append("{:.2f} and {:.2f} ({})".format(result.numbers[f"ratio_{component}"],
                                                      result.numbers[f"median_ratio_{component}"], component))
    result.text = [paragraph(f"""
        Log: `{bag.name}`. Every scan is matched to the one before; wheels guide the search and fill in what scans
        do not see. The variance with C, as a share of that without, at the end and as the median over the way:
        {', '.join(ratios)}. A match of little overlap, whose error is its own, adds the same to both. How much C
        takes away depends on what the error of a displacement consists of: C holds what two displacements share,
        the range noise of one scan; the matching noise, that two scans do not meet the same points, they do not
        share. The map is all scans, drawn where the estimate puts them; it takes no part in the estimation.""")]
    return result


def _draw_map(setting: Setting, recording: Recording, estimates: Estimates) -> str:
    poses, covered = sample(estimates.trajectory, recording.stamps)
    points = np.vstack([transformed(poses[i], recording.clouds[i]) for i in np.flatnonzero(covered)])
    figure, ((panel,),) = new_figure(1, 1, 8.0, 7.0)
    panel.plot(points[:, 0], points[:, 1], ".", color=GREY, markersize=1.0, rasterized=True, label="all scans")
    panel.plot(poses[covered, 0], poses[covered, 1], color=COLOURS["displacement_only"], linewidth=2.0,
               label="trajectory")
    panel.plot(*poses[covered][-1, :2], "o", color=TRUTH, label="its end")
    low, high = (np.percentile(points, q, axis=0) for q in (1, 99))
    panel.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0] - 2, high[0] + 2), ylim=(low[1] - 2, high[1] + 2))
    panel.set_aspect("equal")
    legend = panel.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    for line in legend.get_lines():
        line.set_markersize(7)
    return save_figure(figure, setting, "displacement_only.png")


__all__ = ["TrajectoryError", "displacement_only", "four_methods"]
