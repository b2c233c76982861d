#!/usr/bin/python3
"""What the README and doc/ say of parameters, of files, and to those who come from other packages: it is so in the package."""
from __future__ import annotations

import re
import unittest
from pathlib import Path
from typing import Dict, Iterator, List, Set

import yaml

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "doc").glob("*.md"))]
LINK = re.compile(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)")
TOPIC_OR_SERVICE = re.compile(r"(?:topics?|services?|TF) (?:(?:, )?`[^`]*`)+(?: → `[^`]*`)?")


def rows() -> List[List[str]]:
    """The cells of the tables in the sections "Coming from …", without their headings."""
    text = README.read_text(encoding="utf-8")
    sections = re.findall(r"^## Coming from .*?(?=^## (?!Coming from))", text, re.MULTILINE | re.DOTALL)
    lines = "".join(sections).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    return [row for row in cells if "`" in row[0]]


def tables(page: Path) -> Iterator[List[List[str]]]:
    """The cells of each table, its heading first."""
    text = page.read_text(encoding="utf-8")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        yield [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in table.splitlines()]


def anchors(page: Path) -> Set[str]:
    """Where a link to a page may lead: its headings, as GitHub writes them."""
    headings = re.findall(r"^#+ (.*)", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def names(cell: str) -> Set[str]:
    return set(re.findall(r"`([a-z_0-9]+)`", cell))


def defaults() -> Dict[str, object]:
    return yaml.safe_load((ROOT / "config" / "sckf_odometry.yaml").read_text(encoding="utf-8"))


def parameters() -> Set[str]:
    return set(defaults())


def aliases() -> Dict[str, str]:
    source = (ROOT / "src" / "ros" / "parameter_list.cpp").read_text(encoding="utf-8")
    return dict(re.findall(r'\{"(\w+)", "(\w+)"\}', source[source.index("kAliases"):]))


class ReadmeTest(unittest.TestCase):
    def test_there_are_two_tables(self) -> None:
        self.assertGreater(len(rows()), 30)

    def test_what_is_named_as_a_parameter_of_ours_is_one(self) -> None:
        for row in rows():
            self.assertLessEqual(names(TOPIC_OR_SERVICE.sub("", row[1])), parameters(), row)

    def test_what_works_is_an_alias(self) -> None:
        working = [row for row in rows() if "**works**" in row[2]]
        self.assertGreaterEqual(len(working), 3)
        for row in working:
            old, new = (next(iter(re.findall(r"`(\w+)`", cell))) for cell in row[:2])
            self.assertEqual(aliases().get(old), new, row)

    def test_every_alias_of_these_packages_is_told(self) -> None:
        told = {name for row in rows() if "**works**" in row[2] for name in names(row[0])}
        of_others = {"odom_frame_id", "base_frame_id"}  # rf2o, amcl
        self.assertLessEqual(set(aliases()) - of_others, told)

    def test_what_is_the_same_is_a_parameter(self) -> None:
        for row in rows():
            if row[1].startswith("the same (") or row[1] == "the same" and "topic" not in row[0]:
                self.assertLessEqual(names(row[0]), parameters(), row)

    def test_each_row_of_a_table_has_the_cells_of_its_heading(self) -> None:
        all_tables = [table for page in PAGES for table in tables(page)]
        self.assertGreater(len(all_tables), 15)
        for heading, *others in all_tables:
            for row in others:
                self.assertEqual(len(row), len(heading), row)

    def test_what_pages_link_to_is_there(self) -> None:
        self.assertGreater(len(PAGES), 3)
        for page in PAGES:
            for path, anchor in LINK.findall(page.read_text(encoding="utf-8")):
                target = (page.parent / path).resolve() if path else page
                self.assertTrue(target.exists(), f"{page.name}: {path}")
                if anchor:
                    self.assertIn(anchor, anchors(target), f"{page.name}: {path}#{anchor}")

    def test_parameters_whose_choice_is_measured_are_some(self) -> None:
        [table] = [table for table in tables(ROOT / "doc" / "accuracy.md") if table[0][0].startswith("what is different")]
        told = {name for row in table[2:] for name in re.findall(r"`([a-z_]+[a-z])`", row[0])} - {"sckf"}
        self.assertGreater(len(told), 25)
        self.assertLessEqual(told, parameters())

    def test_the_defaults_that_it_tells_are_those(self) -> None:
        [(_, _, *told)] = [table for table in tables(README) if table[0][:2] == ["parameter", "default"]]
        self.assertGreater(len(told), 10)
        for name_cell, value_cell, _ in told:
            for name, value in zip(re.findall(r"`(\w+)`", name_cell), re.split(r", (?![^\[]*\])", value_cell)):
                default = defaults()[name]
                self.assertEqual(yaml.safe_load(value if isinstance(default, (str, list)) else value.split()[0]), default,
                                 name)

    def test_the_examples_that_it_names_are_there(self) -> None:
        text = README.read_text(encoding="utf-8")
        told = set(re.findall(r"^\| `(\w+\.launch)", text, re.MULTILINE))
        self.assertEqual(told, {path.name for path in (ROOT / "config" / "examples").glob("*.launch")})


if __name__ == "__main__":
    unittest.main()
