"""Sensors beside one laser and the wheels (section V-A of the paper), each with and without."""
from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Dict, List, Sequence

import matplotlib.pyplot as plt
import numpy as np

from experiment_base import (GREEN, GREY, TRUTH, WITH, WITHOUT, Result, Setting, markdown_table, new_figure, paragraph,
                             read_table, run, save_figure, simulate)
from experiment_references import log_with_reference
from recording import halved
from trajectory import Drift, Trajectory, drift, read_tum

SETTLED = 10  # scans after which the filter is no longer as certain as it was told to be at the start


def _of(table: np.ndarray, column: str, name: str) -> np.ndarray:
    return table[table[column] == name]


def _robots(setting: Setting, experiment: str) -> Dict[str, np.ndarray]:
    """The table of each kind of robot."""
    simulate(setting, experiment)
    table = read_table(setting.output / f"{experiment}.csv")
    return {str(name): _of(table, "robots", name) for name in dict.fromkeys(table["robots"])}


def _nees(table: np.ndarray, column: str = "nees") -> float:
    return float(table[column][SETTLED:].mean())


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values[SETTLED:] ** 2)))


def _note(result: Result, robots: Dict[str, np.ndarray], quantities: Sequence[str]) -> None:
    """Of each kind of robot the mean NEES, and quantities at the end."""
    for name, table in robots.items():
        result.numbers[f"{name}_nees"] = _nees(table)
        result.numbers.update({f"{name}_{quantity}": float(table[quantity][-1]) for quantity in quantities})


def _draw_trace(panel: plt.Axes, table: np.ndarray, state: str, unit: str, factor: float) -> None:
    time, found, std = table["time"], factor * table[f"found_{state}"], factor * table[f"{state}_std"]
    panel.fill_between(time, found - 2.0 * std, found + 2.0 * std, color=WITH, alpha=0.2, label="± 2 std")
    panel.plot(time, found, color=WITH, label="estimated")
    panel.plot(time, factor * table[f"true_{state}"], "--", color=TRUTH, label="true")
    panel.set(xlabel="time [s]", ylabel=unit)
    panel.legend(loc="best")


# ---- several lasers

def several_lasers(setting: Setting) -> Result:
    simulate(setting, "several_lasers")
    table = read_table(setting.output / "several_lasers.csv")
    mounted = read_table(setting.output / "mounted_lasers.csv")
    robots = {name: _of(table, "lasers", name) for name in ("fast", "slow", "both")}
    bag, reference = log_with_reference(setting)
    halves = _halves(setting, bag, reference)
    result = Result("several_lasers", "several lasers, each at its own rate (`scan_topics`)",
                    figures=[_draw_lasers(setting, robots)])
    for name, each in robots.items():
        result.numbers.update({f"{name}_position": _rms(each["position"]), f"{name}_nees": _nees(each)})
    result.numbers.update({f"mounted_{row['lasers']}_{key}": float(row[key])
                           for row in mounted for key in ("position", "yaw")})
    result.numbers.update({f"log_{name}_drift_percent": each.translation_percent for name, each in halves.items()})
    labels = {"fast": "fast: 40 Hz, 30 mm of noise", "slow": "slow: 5 Hz, 10 mm", "both": "both"}
    mounts = {"front": "front: 40 Hz", "rear": "rear: 5 Hz, upside down", "both": "both"}
    result.text = [
        paragraph(f"""
            {int(table['runs'][0])} robots in a hall, with lasers that look around, each with clones and range noise of
            its own in the one filter: error and NEES over the way (3 is right). Between its scans the slow one leaves
            the robot to its wheels."""),
        markdown_table(["lasers", "position, rms", "NEES"], [
            [labels[name], f"{1e3 * _rms(each['position']):.1f} mm", f"{_nees(each):.2f}"]
            for name, each in robots.items()]),
        "Robots through the whole pipeline, with lasers at two places, each of which sees half a round; at the scans:",
        markdown_table(["lasers", "position, rms", "yaw, rms", "scans used"], [
            [mounts[str(row["lasers"])], f"{1e3 * row['position']:.1f} mm", f"{math.degrees(row['yaw']):.3f}°",
             f"{row['used']} of {row['scans']}"] for row in mounted]),
        f"The log `{bag.name}`, each scan cut into two halves as of two lasers:",
        markdown_table(["scans", "drift"], [
            [name, f"{each.translation_percent:.2f} %, {each.rotation_deg_per_m:.3f} °/m"]
            for name, each in halves.items()])]
    return result


def _halves(setting: Setting, bag: Path, reference: Trajectory) -> Dict[str, Drift]:
    # Without --reference it is not the bag that was asked for, and its topics are not those.
    scan_topic = setting.scan_topic if setting.reference else Setting.scan_topic
    odom_topic = setting.odom_topic if setting.reference else Setting.odom_topic
    cut = setting.output / "halves.bag"
    halved(str(bag), str(cut), scan_topic)
    lasers = {"right": (cut, ["/right/scan"]), "left": (cut, ["/left/scan"]),
              "both": (cut, ["/right/scan", "/left/scan"]), "uncut": (bag, [scan_topic])}

    def replayed(name: str) -> Drift:
        source, topics = lasers[name]
        output = setting.output / f"halves_{name}.tum"
        arguments: List[object] = [source, "--trajectory", output, "--odom-topic", odom_topic]
        for topic in topics:
            arguments += ["--scan-topic", topic]
        run(setting, "replay", arguments)
        return drift(reference, read_tum(output))

    with ThreadPoolExecutor(2) as pool:  # nobody takes the time of these
        return dict(zip(lasers, pool.map(replayed, lasers)))


def _draw_lasers(setting: Setting, robots: Dict[str, np.ndarray]) -> str:
    figure, ((position, nees),) = new_figure(1, 2, 11.0, 4.2)
    for (name, each), colour, style in zip(robots.items(), (WITHOUT, GREY, WITH), ("--", "-.", "-")):
        position.plot(each["time"], 1e3 * each["position"], style, color=colour, label=name)
        nees.plot(each["time"], each["nees"], style, color=colour, label=name)
    nees.axhline(3.0, color="black", linestyle=":", label="right: 3")
    position.set(xlabel="time [s]", ylabel="rms error of the position [mm]", ylim=(0.0, None))
    nees.set(xlabel="time [s]", ylabel="NEES", ylim=(0.0, None))
    position.legend(loc="upper left", title="lasers")
    nees.legend(loc="lower right", ncol=2)
    return save_figure(figure, setting, "extensions_several_lasers.png")


# ---- an IMU

IMU = {"wheels": ("without", GREY, ":"), "gyro": ("use_imu", WITH, "-"),
       "orientation": ("use_imu_orientation", GREEN, "-."), "both": ("both", WITHOUT, "--")}


def imu(setting: Setting) -> Result:
    robots = _robots(setting, "imu")
    figure, ((yaw, bias),) = new_figure(1, 2, 11.0, 4.2)
    for name, (label, colour, style) in IMU.items():
        table = robots[f"blind_{name}"]
        yaw.plot(table["time"], np.degrees(table["yaw"]), style, color=colour, label=label)
    yaw.set(xlabel="time [s]", ylabel="rms error of the yaw without scans [°]", ylim=(0.0, None))
    yaw.legend(loc="upper left")
    _draw_trace(bias, robots["seeing_gyro"], "bias", "bias of the gyro, first robot [°/s]", 180.0 / math.pi)
    result = Result("imu", "an IMU (`use_imu`, `use_imu_orientation`)",
                    figures=[save_figure(figure, setting, "extensions_imu.png")])
    _note(result, robots, ("position", "yaw"))
    for name in ("gyro", "both"):
        result.numbers.update({f"{name}_bias": float(robots[f"seeing_{name}"]["bias"][-1]),
                               f"{name}_bias_nees": _nees(robots[f"seeing_{name}"], "bias_nees")})
    rows = [[label, *(cell for scans in ("seeing", "blind") for cell in (
        f"{100 * robots[f'{scans}_{name}']['position'][-1]:.1f} cm, "
        f"{math.degrees(robots[f'{scans}_{name}']['yaw'][-1]):.2f}°", f"{_nees(robots[f'{scans}_{name}']):.2f}"))]
        for name, (label, _, _) in IMU.items()]
    drawn = math.degrees(float(robots["seeing_gyro"]["bias"][0]))
    result.text = [
        paragraph(f"""
            Robots on a way of 8 s with a gyro, whose bias is another one for each and wanders, and with an orientation
            whose zero is not known. Rms errors of position and yaw at the end, and NEES as the mean over the way (3 is
            right). The bias errs by {drawn:.2f} °/s after the first scan and by
            {math.degrees(result.numbers['gyro_bias']):.2f} °/s at the end, with a NEES of
            {result.numbers['gyro_bias_nees']:.2f} (1 is right)."""),
        markdown_table(["IMU", "with scans", "NEES", "without scans", "NEES"], rows)]
    return result


# ---- absolute poses

def absolute_poses(setting: Setting) -> Result:
    robots = _robots(setting, "absolute_poses")
    every = robots.pop("every_sensor")
    drive = read_table(setting.output / "absolute_poses_drive.csv")
    placed = drive[np.isfinite(drive["map_step"])]
    figure, ((position, steps),) = new_figure(1, 2, 11.0, 4.2)
    for name, (label, colour, style) in {"blind_without": ("without", WITHOUT, "--"),
                                         "blind_with": ("use_pose_updates", WITH, "-")}.items():
        position.plot(robots[name]["time"], 100.0 * robots[name]["position"], style, color=colour, label=label)
    position.set(xlabel="time [s]", ylabel="rms error without scans [cm]", ylim=(0.0, None))
    steps.plot(drive["time"], 100.0 * drive["map_step"], color=WITH, label="map → base_link")
    steps.plot(drive["time"], 100.0 * drive["odom_step"], "--", color=WITHOUT, label="odom → base_link")
    steps.set(xlabel="time [s]", ylabel="error of a step [cm]", ylim=(0.0, None))
    for panel in (position, steps):
        panel.legend(loc="upper left")
    result = Result("absolute_poses", "absolute poses (`use_pose_updates`)",
                    figures=[save_figure(figure, setting, "extensions_absolute_poses.png")])
    _note(result, robots, ("position", "yaw"))
    result.numbers.update({
        "every_sensor_nees": _nees(every), "every_sensor_calibration_nees": _nees(every, "calibration_nees"),
        "every_sensor_bias_nees": _nees(every, "bias_nees"),
        "odom_step": float(placed["odom_step"].max()), "map_step": float(placed["map_step"].max()),
        "odom_moved": float(drive["moved"].max()), "odom_end": float(drive["odom_error"][-1]),
        "map_end": float(drive["map_error"][-1])})
    n = result.numbers
    names = {"seeing_without": "scans", "seeing_with": "scans, absolute poses", "blind_without": "no scans",
             "blind_with": "no scans, absolute poses"}
    result.text = [
        paragraph(f"""
            Robots that are told where they are about three times a second, to 10 cm and 0.1 rad, in a map of which they
            knew nothing before; rms errors at the end, and NEES as the mean over the way (3 is right). Where scans tell
            the motion better the poses only say where the whole is. With them, all other sensors of this section and
            wheels that err: NEES {n['every_sensor_nees']:.2f}, of the calibration
            {n['every_sensor_calibration_nees']:.2f} (6 is right), of the gyro's bias
            {n['every_sensor_bias_nees']:.2f} (1 is right)."""),
        markdown_table(["", "position", "yaw", "NEES"], [
            [label, f"{100 * n[f'{name}_position']:.1f} cm", f"{math.degrees(n[f'{name}_yaw']):.2f}°",
             f"{n[f'{name}_nees']:.2f}"] for name, label in names.items()]),
        paragraph(f"""
            A robot without scans through the whole pipeline, told once a second: odom → base_link ends
            {100 * n['odom_end']:.0f} cm off and map → base_link {100 * n['map_end']:.0f} cm. From scan to scan odom →
            base_link moves otherwise than the robot by {1e3 * n['odom_step']:.1f} mm at most, which are the wheels'
            errors, and is nowhere moved by an absolute pose ({1e3 * n['odom_moved']:.1f} mm); map → base_link steps by up to
            {1e3 * n['map_step']:.0f} mm.""")]
    return result


# ---- standstill

def standstill(setting: Setting) -> Result:
    robots = _robots(setting, "standstill")
    figure, ((position, bias),) = new_figure(1, 2, 11.0, 4.2)
    for name, colour, style in (("without", WITHOUT, "--"), ("with", WITH, "-")):
        table = robots[name]
        label = "standstill_time" if name == "with" else "without"
        position.plot(table["time"], 100.0 * table["position"], style, color=colour, label=label)
        bias.plot(table["time"], np.degrees(robots[f"gyro_{name}"]["bias"]), style, color=colour, label=label)
    position.set(xlabel="time [s]", ylabel="rms error of the position [cm]", ylim=(0.0, None))
    bias.set(xlabel="time [s]", ylabel="rms error of the gyro's bias [°/s]", ylim=(0.0, None))
    position.legend(loc="upper left")
    bias.legend(loc="upper right")
    result = Result("standstill", "a robot that stands, and knows it (`standstill_time`)",
                    figures=[save_figure(figure, setting, "extensions_standstill.png")])
    _note(result, robots, ("position", "yaw", "bias"))
    n = result.numbers
    labels = {"without": "without", "with": "`standstill_time`", "gyro_without": "a gyro, without",
              "gyro_with": "a gyro, and `standstill_time`"}
    result.text = [
        paragraph("""
            Robots without scans that stand for 0.3 s of each second, while their encoders jitter by 1 cm. Rms errors
            after 8 s, and NEES as the mean over the way (3 is right). A gyro at rest tells its bias."""),
        markdown_table(["", "position", "yaw", "bias of the gyro", "NEES"], [
            [label, f"{100 * n[f'{name}_position']:.1f} cm", f"{math.degrees(n[f'{name}_yaw']):.2f}°",
             f"{math.degrees(n[f'{name}_bias']):.2f} °/s" if "gyro" in name else "", f"{n[f'{name}_nees']:.2f}"]
            for name, label in labels.items()])]
    return result


# ---- calibration of the wheels

def calibration(setting: Setting) -> Result:
    robots = _robots(setting, "calibration")
    trusting, calibrated = robots["without"], robots["with"]
    middle = len(calibrated) // 2
    figure, ((scale, position),) = new_figure(1, 2, 11.0, 4.2)
    _draw_trace(scale, calibrated, "scale", "scale of the way, first robot [%]", 100.0)
    for table, colour, style, label in ((trusting, WITHOUT, "--", "without"),
                                        (calibrated, WITH, "-", "calibration_..._std")):
        position.plot(table["time"], 100.0 * table["position"], style, color=colour, label=label)
    position.axvline(calibrated["time"][middle - 1], color=GREY, linestyle=":", label="blind from here on")
    position.set(xlabel="time [s]", ylabel="rms error of the position [cm]", ylim=(0.0, None))
    position.legend(loc="upper left")
    result = Result("calibration", "systematic errors of the wheels (`calibration_..._std`)",
                    figures=[save_figure(figure, setting, "extensions_calibration.png")])
    _note(result, robots, ("position", "yaw"))
    result.numbers.update({"scale_at_first": float(calibrated["scale"][0]),
                           "scale": float(calibrated["scale"][middle - 1]),
                           "scale_nees": _nees(calibrated, "calibration_nees")})
    n = result.numbers
    result.text = [
        paragraph(f"""
            Robots whose wheels err by 10 % (std) of the way, 10 % of rotations and 0.1 rad/m, whose laser is 10 cm
            farther ahead or behind, on a floor that takes them along by 5 % of the way to each side, and all of it
            forgotten within 20 m: 8 s in a hall, then 8 s blind. The scale of the way is known to {100 * n['scale_at_first']:.1f} %
            after the first scan and to {100 * n['scale']:.1f} % (rms) before the robot is blind, where 10 % would be
            not to know it; NEES of the six errors {n['scale_nees']:.2f} (6 is right). At the end, after the blind
            stretch:"""),
        markdown_table(["", "position", "yaw", "NEES"], [
            [label, f"{100 * n[f'{name}_position']:.1f} cm", f"{math.degrees(n[f'{name}_yaw']):.2f}°",
             f"{n[f'{name}_nees']:.1f}"]
            for name, label in (("without", "without"), ("with", "estimated"))])]
    return result
