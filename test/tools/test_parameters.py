#!/usr/bin/python3
"""Every parameter does something: those of the pipeline are changed one by one, and replay tells another story then; the
others are named by a test of their own.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, Tuple

import yaml

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "accuracy"), str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
import simulated_log  # noqa: E402

REPLAY = Path(os.environ.get("SCKF_BIN_DIR", ROOT / "build" / "devel" / "lib" / "sckf_odometry")) / "replay"
CONFIG = ROOT / "config" / "sckf_odometry.yaml"

Parameters = Dict[str, Any]


# Scenes, and what is changed of the parameters there: to values that a user might try. With a group, what turns it on.
MUSEUM: Tuple[Parameters, Parameters] = ({}, dict(
    method="sckf", odometry_model="differential",
    odometry_translation_per_meter=0.1, odometry_translation_per_radian=0.08, odometry_yaw_per_meter=0.2,
    odometry_yaw_per_radian=0.3,
    calibration_distance_std=0.0, calibration_rotation_std=0.0, calibration_rotation_per_meter_std=0.0,
    calibration_laser_ahead_std=0.0, calibration_floor_std=0.0, calibration_way=10.0,
    references_kept=4, older_references=1, older_dist_linear=1.0,
    older_dist_angular=0.5, older_min_overlap=0.6, older_inflation=2.0, matching_common=0.0,
    gate_probability=0.9, trust_scans_on_slip=False, slip_std_translation=0.2, slip_std_yaw=0.2, slip_max_misfit=0.3,
    range_min=3.0, range_max=8.0, range_noise_min=0.03, range_noise_max=0.03, range_offset_std=0.0, sweep_duration_std=0.0,
    min_points=182, max_beams=90, surface_straightness=1.2, surface_length=0.4, surface_max_normal_std=0.03,
    icp_pair_distance=0.3, max_iterations=2, match_both_ways=False, prior_std_translation=0.2, prior_std_yaw=0.2,
    search_below_agreement=0.95, search_yaw_step=0.06, search_yaw_steps=0, min_pairs=100, min_overlap=0.6, min_agreement=0.9,
    moved_place_min_share=0.1, max_refinement=0.02, max_correspondence_dist=0.1, max_normal_angle=0.3, normal_agreement=0.5,
    surface_roughness=0.03, point_std=0.05, robust_width=1.5, observable_max_std=0.05, observable_min_information_ratio=2.0,
    correlated_beams=5, matching_inflation=1.0, place_size=1.5, place_std=0.1))
FAR_TURNS: Tuple[Parameters, Parameters] = ({}, dict(
    wide_search_below_agreement=0.0, wide_search_yaw=0.1, wide_search_translation=0.1))
FAST: Tuple[Parameters, Parameters] = (
    dict(motion_max_speed=0.3, motion_max_yaw_rate=0.1, motion_slack_translation=0.05, motion_slack_yaw=0.05),
    dict(motion_max_speed=3.0, motion_max_yaw_rate=3.0, motion_slack_translation=1.0, motion_slack_yaw=1.0,
         motion_unknown_speed_std=2.0, motion_unknown_yaw_rate_std=2.0))
ROOM: Tuple[Parameters, Parameters] = ({}, dict(kf_dist_linear=0.3, kf_dist_angular=0.2, kf_min_overlap=0.99))
DIFFERENTIAL: Tuple[Parameters, Parameters] = (dict(odometry_model="differential"), dict(odometry_lateral_share=1.0))
LANDMARKS: Tuple[Parameters, Parameters] = (dict(landmarks="corners_and_lines"), dict(
    landmarks="corners", landmarks_only=True, landmarks_max=3, landmark_sightings=10, landmark_misses=1,
    landmark_max_share=0.02, landmark_max_std=0.01, landmark_gate_probability=0.01,
    corner_min_length=0.6, corner_max_length=0.7, corner_min_points=8, corner_roughness=0.005, corner_min_angle=1.4,
    corner_std_position=0.1, corner_std_yaw=0.1, line_min_length=1.0, line_min_points=30, line_points=3,
    line_roughness=0.005, line_std_offset=0.2, line_std_yaw=0.2))
IMU: Tuple[Parameters, Parameters] = (dict(use_imu=True, use_imu_orientation=True), dict(
    use_imu=False, gyro_noise=0.05, gyro_bias_std=0.001, gyro_bias_drift=0.05, use_imu_orientation=False,
    imu_orientation_std=0.5, imu_heading_drift=0.5))
SLOW_IS_STANDING: Tuple[Parameters, Parameters] = (
    dict(standstill_time=1.0, standstill_speed=0.3, standstill_yaw_rate=0.3),
    dict(standstill_time=10.0, standstill_speed=0.0, standstill_yaw_rate=0.0, standstill_std=0.1))
CLOUDS: Tuple[Parameters, Parameters] = (dict(use_cloud_input=True), dict(
    cloud_height_min=-1.0, cloud_height_max=3.0, cloud_range_min=2.0, cloud_range_max=2.0, cloud_beams=90))
POSES: Tuple[Parameters, Parameters] = (dict(use_pose_updates=True, gate_probability=0.5), dict(
    pose_update_max_rejected=1))
# By the name of a bag.
SCENES = {"museum": [MUSEUM, DIFFERENTIAL, FAST], "far": [FAR_TURNS], "room": [ROOM, LANDMARKS, SLOW_IS_STANDING],
          "imu": [IMU], "clouds": [CLOUDS], "poses": [POSES]}


class ParametersTest(unittest.TestCase):
    folder: tempfile.TemporaryDirectory[str]

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        simulated_log.simulate("museum", cls.path("museum.bag"), cls.path("museum.tum"), "slipping")
        simulated_log.simulate("museum", cls.path("far.bag"), cls.path("far.tum"), "freezing", step=1.0)
        simulated_bag.write(str(cls.path("room.bag")), duration=60.0)
        simulated_bag.write(str(cls.path("imu.bag")), duration=20.0, imu=simulated_bag.ImuUnit())
        simulated_bag.write(str(cls.path("clouds.bag")), duration=10.0, clouds=True)
        simulated_bag.write(str(cls.path("poses.bag")), duration=40.0, poses=True)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    @classmethod
    def path(cls, name: str) -> Path:
        return Path(cls.folder.name) / name

    def story(self, bag: str, parameters: Parameters) -> str:
        """What becomes of each scan, but for the reason in words, and where the robot is in the map, if it is."""
        output = self.path("_".join([bag, *(f"{name}-{value}" for name, value in parameters.items())]))
        output.mkdir(exist_ok=True)
        (output / "parameters.yaml").write_text(yaml.safe_dump(parameters))
        command = [REPLAY, self.path(bag + ".bag"), "--duration", "400", "--params", output / "parameters.yaml",
                   "--csv", output / "table.csv", "--trajectory", output / "odom.tum"]
        in_map = parameters.get("use_pose_updates", False)
        done = subprocess.run([*map(str, command), *(["--map-trajectory", str(output / "map.tum")] if in_map else [])],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(done.returncode, 0, f"{bag}: {parameters}: {done.stderr}")
        with open(output / "table.csv", newline="", encoding="utf-8") as file:
            table = "\n".join(",".join(row[:-1]) for row in csv.reader(file))
        return table + ((output / "map.tum").read_text() if in_map else "")

    def test_every_one_of_the_pipeline_changes_what_replay_tells(self) -> None:
        defaults = yaml.safe_load(CONFIG.read_text())
        for bag, given, changes in ((bag, *group) for bag, groups in SCENES.items() for group in groups):
            same = [name for name, value in changes.items() if {**defaults, **given}[name] == value]
            self.assertEqual(same, [], "they are no changes")
            before = self.story(bag, given)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                after = pool.map(lambda change: self.story(bag, {**given, **dict([change])}), changes.items())
                no_effect = [name for name, story in zip(changes, after) if story == before]
            self.assertEqual(no_effect, [], f"{bag}, {given}: they do nothing")

    def test_every_other_one_is_named_by_a_test(self) -> None:
        tried = {name for groups in SCENES.values() for _, changes in groups for name in changes}
        files = [*(ROOT / "test").rglob("*"), *(ROOT / "config" / "examples").glob("*")]  # which tests launch
        tests = "".join(path.read_text() for path in files
                        if path.suffix in (".cpp", ".py", ".test", ".launch") and path != Path(__file__).resolve())
        others = [name for name in yaml.safe_load(CONFIG.read_text()) if name not in tried]
        self.assertEqual([name for name in others if not re.search(rf"\b{name}\b", tests)], [], "no test tries them")


if __name__ == "__main__":
    unittest.main(verbosity=2)
