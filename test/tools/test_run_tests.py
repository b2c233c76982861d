#!/usr/bin/python3
"""scripts/run_tests on a build folder made by hand: what counts as passed and as failed."""
from __future__ import annotations

import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

RUN_TESTS = Path(__file__).resolve().parents[2] / "scripts" / "run_tests"
PASSED = '<testcase classname="C" name="good"/>'
FAILED = '<testcase classname="C" name="bad"><failure message="no"/></testcase>'
ERROR = '<testcase classname="C" name="broken"><error message="no"/></testcase>'
SKIPPED = '<testcase classname="C" name="left_out"><skipped message="no data"/></testcase>'


class RunTestsTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.builds = [Path(folder.name) / name for name in ("build", "another_build")]
        for build in self.builds:
            (build / "test_results" / "pkg").mkdir(parents=True)
            (build / "run_tests.py").write_text("# stands for catkin's\n", encoding="utf-8")
        self.use(self.builds[0])

    def use(self, build: Path) -> None:
        """The build folder that tests are registered in from here on."""
        self.build = build
        self.results = build / "test_results" / "pkg"

    def register(self, name: str, cases: str | None, exit_code: int = 0, kind: str = "gtest",
                 beside: dict[str, str] | None = None, labels: str = "") -> None:
        """A test called as catkin calls it, whose program writes a result (unless None) and ends with the exit code."""
        commands = []
        files = dict(beside or {})
        if cases is not None:
            files[f"{kind}-{name}.xml"] = cases
        for file, content in files.items():
            source = self.build / f"{name}-{file}.source"
            source.write_text(f"<testsuites><testsuite>{content}</testsuite></testsuites>", encoding="utf-8")
            commands.append(f"cp '{source}' '{self.results / file}'")
        script = self.build / f"{name}.sh"
        script.write_text("\n".join([*commands, f"exit {exit_code}"]), encoding="utf-8")
        result = self.results / f"{kind}-{name}.xml"
        self.add_test(f"_ctest_pkg_{kind}_{name}", f'"/bin/sh" "{script}" "run_tests.py" "{result}"', labels)

    def add_test(self, name: str, command: str, labels: str = "") -> None:
        with open(self.build / "CTestTestfile.cmake", "a", encoding="utf-8") as file:
            file.write(f"add_test({name} {command})\n")
            if labels:
                file.write(f'set_tests_properties({name} PROPERTIES LABELS "{labels}")\n')

    def check(self, last_line: str, exit_code: int, *mentioned: str, selection: tuple[str, ...] = (),
              builds: int = 1) -> None:
        done = subprocess.run([str(RUN_TESTS), *map(str, self.builds[:builds]), *(["--", *selection] if selection else [])],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, check=False)
        self.assertEqual(done.stdout.splitlines()[-1], last_line, done.stdout)
        self.assertEqual(done.returncode, exit_code, done.stdout)
        for each in mentioned:
            self.assertIn(each, done.stdout)

    def test_cases_are_counted_not_programs(self) -> None:
        self.register("one", PASSED * 3)
        self.register("two", PASSED * 2, kind="pytest")
        self.check("5 passed, 0 failed", 0)

    def test_failures_and_errors_are_failed_cases(self) -> None:
        self.register("one", PASSED + FAILED + ERROR, exit_code=1)
        self.check("1 passed, 2 failed", 1, "FAILED: C.bad", "FAILED: C.broken")

    def test_a_skipped_case_neither_passed_nor_failed(self) -> None:
        self.register("one", PASSED + SKIPPED)
        self.check("1 passed, 0 failed", 0, "skipped: C.left_out", "1 skipped")

    def test_a_crash_without_a_result_is_a_failure(self) -> None:
        self.register("one", PASSED)
        self.register("crashes", None, exit_code=139)
        self.check("1 passed, 1 failed", 1, "FAILED: pkg_gtest_crashes: no result")

    def test_a_silent_program_without_a_result_is_a_failure(self) -> None:
        self.register("one", PASSED)
        self.register("silent", None)
        self.check("1 passed, 1 failed", 1, "FAILED: pkg_gtest_silent: no result")

    def test_a_crash_after_the_last_case_is_a_failure(self) -> None:
        self.register("one", PASSED * 2, exit_code=1)
        self.check("2 passed, 1 failed", 1, "failed although its cases passed")

    def test_a_result_cut_short_is_a_failure(self) -> None:
        self.register("one", PASSED + "<testcase", exit_code=0)
        self.check("0 passed, 1 failed", 1, "FAILED: gtest-one.xml")

    def test_results_of_an_earlier_run_do_not_count(self) -> None:
        (self.results / "gtest-one.xml").write_text(f"<testsuite>{PASSED}</testsuite>", encoding="utf-8")
        self.register("one", None)
        self.check("0 passed, 1 failed", 1)

    def test_no_tests_at_all_is_a_failure(self) -> None:
        (self.build / "CTestTestfile.cmake").write_text("", encoding="utf-8")
        self.check("0 passed, 0 failed", 1)

    def test_a_program_without_cases_is_a_failure(self) -> None:
        self.register("one", PASSED)
        self.register("empty", "")
        self.check("1 passed, 1 failed", 1, "it has no cases")

    def test_a_plain_ctest_counts_as_one(self) -> None:
        self.add_test("good", '"/bin/true"')
        self.add_test("bad", '"/bin/false"')
        self.check("1 passed, 1 failed", 1, "FAILED: bad")

    def test_the_cases_of_a_rostest_are_those_of_its_nodes(self) -> None:
        self.register("nodes", '<testcase classname="rostest" name="testfilter"/>', kind="rostest",
                      beside={"rosunit-filter.xml": PASSED * 4})
        self.check("4 passed, 0 failed", 0)

    def test_a_failed_case_of_a_rostests_node_counts_once(self) -> None:
        self.register("nodes", '<testcase classname="rostest" name="testfilter"/>', kind="rostest", exit_code=2,
                      beside={"rosunit-filter.xml": PASSED * 4 + FAILED})
        self.check("4 passed, 1 failed", 1)

    def test_a_node_that_dies_in_a_rostest_is_a_failure(self) -> None:
        died = '<testcase classname="rostest" name="testfilter"><failure message="did not generate results"/></testcase>'
        self.register("nodes", died, kind="rostest", exit_code=1)
        self.check("0 passed, 1 failed", 1, "FAILED: rostest.testfilter")

    def test_the_cases_of_each_kind_are_counted(self) -> None:
        self.register("one", PASSED * 3 + SKIPPED, labels="unit")
        self.register("two", PASSED + FAILED, exit_code=1, labels="unit")
        self.register("three", PASSED * 4, kind="pytest", labels="programs and scripts")
        self.add_test("four", '"/bin/true"', labels="unit")
        self.check("9 passed, 1 failed", 1, "     6 unit\n", "     4 programs and scripts\n")

    def test_that_it_runs_on_request_only_is_no_kind(self) -> None:
        self.register("one", PASSED, labels="soak;long")
        self.check("1 passed, 0 failed", 0, "     1 soak\n")

    def test_a_test_registered_without_a_kind_is_seen(self) -> None:
        self.register("one", PASSED * 2)
        self.check("2 passed, 0 failed", 0, "     2 of no kind\n")

    def test_several_builds_have_one_count(self) -> None:
        self.register("one", PASSED * 2, labels="unit")
        self.use(self.builds[1])
        self.register("one", PASSED + FAILED, exit_code=1, labels="sanitizers")
        self.check("3 passed, 1 failed", 1, "     2 unit\n", "     2 sanitizers\n", builds=2)

    def test_a_build_folder_that_is_none_is_a_failure(self) -> None:
        self.register("one", PASSED)
        self.builds[1] = self.builds[1] / "nowhere"
        self.check("1 passed, 1 failed", 1, builds=2)

    def test_a_selection_is_ctests(self) -> None:
        self.register("one", PASSED)
        self.register("two", PASSED * 2)
        self.check("2 passed, 0 failed", 0, selection=("-R", "two"))

    @unittest.skipUnless(os.environ.get("SCKF_BUILD_DIR"), "no build folder in SCKF_BUILD_DIR")
    def test_every_test_of_the_package_has_a_kind(self) -> None:
        listing = subprocess.run(["ctest", "--show-only=json-v1"], cwd=os.environ["SCKF_BUILD_DIR"], check=True,
                                 stdout=subprocess.PIPE)
        tests = json.loads(listing.stdout)["tests"]
        labelled = {test["name"] for test in tests for each in test["properties"] if each["name"] == "LABELS"}
        self.assertGreater(len(labelled), 10)
        limited = {test["name"] for test in tests for each in test["properties"] if each["name"] == "TIMEOUT"}
        self.assertEqual({name for name in labelled - limited if "rostest" not in name}, set(), "may run for ever")
        self.assertEqual({test["name"] for test in tests} - labelled, set())


if __name__ == "__main__":
    unittest.main()
