"""What the package does beyond the paper's experiments: a section for each extension."""
from __future__ import annotations

import math
from typing import Callable, Dict

from experiment_base import (GREEN, GREY, WITH, WITHOUT, Result, Setting, markdown_table, new_figure, paragraph,
                             read_table, save_figure, simulate)
from experiment_cost import update_cost
from experiment_landmarks import landmarks
from experiment_references import references
from experiment_sensors import absolute_poses, calibration, imu, several_lasers, standstill


def deskewing(setting: Setting) -> Result:
    simulate(setting, "deskewing")
    table = read_table(setting.output / "deskewing.csv")
    figure, ((position, yaw),) = new_figure(1, 2, 11.0, 4.2)
    for name, colour, style, label in (("without", WITHOUT, "s--", "scans as they are"),
                                       ("estimated", GREEN, "^-.", "by default, sweep_duration_std"),
                                       ("with", WITH, "o-", "deskew: true")):
        position.plot(table["yaw_rate"], 100.0 * table[f"{name}_position"], style, color=colour, label=label)
        yaw.plot(table["yaw_rate"], 180.0 / math.pi * table[f"{name}_yaw"], style, color=colour, label=label)
    position.set(xlabel="largest yaw rate [rad/s]", ylabel="rms error of the position [cm]", ylim=(0.0, None))
    yaw.set(xlabel="largest yaw rate [rad/s]", ylabel="rms error of the yaw [°]", ylim=(0.0, None))
    position.legend(loc="upper left")
    fastest = table[-1]
    result = Result("deskewing", "the motion while a scan is taken (`deskew`)",
                    figures=[save_figure(figure, setting, "extensions_deskewing.png")])
    for name in ("with", "estimated", "without"):
        result.numbers.update({f"{name}_position": float(fastest[f"{name}_position"]),
                               f"{name}_yaw": float(fastest[f"{name}_yaw"]),
                               f"{name}_yaw_slow": float(table[0][f"{name}_yaw"])})
    result.text = [paragraph(f"""
        A robot on a round of 15 s turns its head to and fro; its laser takes {1e3 * table['sweep'][0]:.0f} ms for a
        scan. The same scans with and without: at {fastest['yaw_rate']:.1f} rad/s the rms error is
        {100 * fastest['with_position']:.1f} cm and {math.degrees(fastest['with_yaw']):.2f}°, and without
        {100 * fastest['without_position']:.1f} cm and {math.degrees(fastest['without_yaw']):.2f}°. By default the
        duration of the sweep is estimated, and the motion undone by the twist of the wheels before the scan, about its
        stamp: {100 * fastest['estimated_position']:.1f} cm and {math.degrees(fastest['estimated_yaw']):.2f}°. What is
        left without any turning is what the matching errs by.""")]
    return result


def cloud_input(setting: Setting) -> Result:
    simulate(setting, "cloud_input")
    table = read_table(setting.output / "cloud_input.csv")
    clouds = table[table["input"] == "cloud"]
    laser, everything = (table[table["input"] == name][0] for name in ("laser", "cloud of every height"))
    figure, ((panel,),) = new_figure(1, 1, 8.0, 4.2)
    panel.plot(clouds["beams"], 100.0 * clouds["position"], "o-", color=WITH, label="cloud as a scan (use_cloud_input)")
    panel.axhline(100.0 * laser["position"], color=GREEN, linestyle="--", label=f"laser of {laser['beams']} beams")
    panel.set(xlabel="cloud_beams", ylabel="rms error of the position [cm]", xscale="log", ylim=(0.0, None),
              xticks=clouds["beams"])
    panel.set_xticklabels([str(beams) for beams in clouds["beams"]])
    panel.minorticks_off()
    panel.legend(loc="upper right")
    result = Result("cloud_input", "clouds of points instead of scans (`use_cloud_input`)",
                    figures=[save_figure(figure, setting, "extensions_cloud_input.png")])
    result.numbers = {"laser_position": float(laser["position"]), "everything_position": float(everything["position"])}
    result.numbers.update({f"cloud_{row['beams']}_position": float(row["position"]) for row in clouds})
    rows = [[str(row["input"]), str(row["beams"]), f"{100 * row['position']:.1f} cm",
             f"{math.degrees(row['yaw']):.2f}°", f"{row['used']} of {row['scans']}"] for row in table]
    result.text = [
        paragraph("""
            The same drive seen by a planar laser, and by a tilted lidar of eight rings, of whose cloud a band of
            heights is projected to the plane. Without the band the floor around the robot, which moves with it, is
            taken for walls."""),
        markdown_table(["input", "beams", "position, rms", "yaw, rms", "scans used"], rows)]
    return result


def odometry_models(setting: Setting) -> Result:
    simulate(setting, "odometry_models")
    table = read_table(setting.output / "odometry_models.csv")
    kinds = list(dict.fromkeys(str(row["robot"]) for row in table))
    figure, ((panel,),) = new_figure(1, 1, 8.0, 4.2)
    for i, (model, colour) in enumerate(zip(kinds, (GREY, WITH, WITHOUT))):
        bars = [table[(table["robot"] == robot) & (table["model"] == model)]["nees"][0] for robot in kinds]
        panel.bar([x + 0.27 * (i - 1) for x in range(len(kinds))], bars, width=0.25, color=colour, label=model)
    panel.axhline(3.0, color="black", linestyle="--", label="right: 3")
    panel.set(ylabel="NEES of the wheels alone", yscale="log", xticks=range(len(kinds)), ylim=(None, 200.0))
    panel.set_xticklabels([f"{kind} robot" for kind in kinds])
    panel.legend(loc="upper center", title="odometry_model", ncol=4)
    result = Result("odometry_models", "the noise of the wheels (`odometry_model`)",
                    figures=[save_figure(figure, setting, "extensions_odometry_models.png")])
    result.numbers = {f"{row['robot']}_by_{row['model']}": float(row["nees"]) for row in table}
    rows = [[str(row["robot"]), str(row["model"]), f"{row['nees']:.2f}",
             f"{100 * row['largest_std']:.1f} cm, {100 * row['smallest_std']:.1f} cm"] for row in table]
    result.text = [
        paragraph(f"""
            {int(table['runs'][0])} robots of each kind drive straight on and through bends by their wheels alone,
            whose errors are drawn as their mechanics make them: in every direction; of each of two wheels; of the way
            and the steered curvature. Each model is told the numbers that are true of the robot. NEES at the end, 3 is
            right: more, and the covariance is too small; less, and it is too large. The robot of two wheels turns on
            the spot, which for a car is no motion that can be believed."""),
        markdown_table(["robot", "`odometry_model`", "NEES", "std of the position along and across its ellipse"], rows)]
    return result


SECTIONS: Dict[str, Callable[[Setting], Result]] = {
    "references": references, "several_lasers": several_lasers, "imu": imu, "absolute_poses": absolute_poses,
    "standstill": standstill, "calibration": calibration, "landmarks": landmarks,
    "deskewing": deskewing, "cloud_input": cloud_input, "odometry_models": odometry_models,
    "update_cost": update_cost}


def extensions(setting: Setting) -> Result:
    """The sections one after the other; of their numbers each has its section's name before it."""
    result = Result("extensions", "beyond the paper's experiments")
    for name, section in SECTIONS.items():
        part = section(setting)
        result.text += [f"### {part.title}", *part.text, *(f"![{name}]({figure})" for figure in part.figures)]
        result.numbers.update({f"{name}_{key}": value for key, value in part.numbers.items()})
    return result
