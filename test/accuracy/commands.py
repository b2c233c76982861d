"""What the commands of this folder have in common: bags that are read and written, and one line for what cannot be."""
from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Iterator, Tuple

import rosbag

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from programs import ProgramError  # noqa: E402
from recording import opened  # noqa: E402
from trajectory import TrajectoryError  # noqa: E402


def expect_another(output: Path, bag: Path) -> None:
    if bag.exists() and output.exists() and bag.samefile(output):
        raise TrajectoryError(f"{output}: expected another file than the bag that is read")


@contextmanager
def rewritten(bag: Path, output: Path) -> Iterator[Tuple[rosbag.Bag, rosbag.Bag]]:
    """A bag to read, and another to write."""
    expect_another(output, bag)
    with opened(bag) as source, written(output) as out:
        yield source, out


@contextmanager
def written(output: Path) -> Iterator[rosbag.Bag]:
    """A bag to write, which is there only if it is whole."""
    output = output.resolve()
    if output.exists() and not output.is_file():
        raise TrajectoryError(f"{output}: cannot be written: expected a file")
    part = output.with_name(output.name + ".part")
    try:
        out = rosbag.Bag(str(part), "w")
    except OSError as error:
        raise TrajectoryError(f"{output}: cannot be written: {error.strerror or error}") from error
    try:
        with out:
            yield out
        part.replace(output)
    finally:
        if part.exists():
            part.unlink()


def command(main: Callable[[], None]) -> None:
    """Runs it; what is wrong is a line on stderr, in the command's name."""
    name = Path(sys.argv[0]).name
    try:
        main()
    except (TrajectoryError, ProgramError) as error:
        sys.exit(f"{name}: {error}")
    except OSError as error:
        sys.exit(f"{name}: {error.filename}: {error.strerror}" if error.filename else f"{name}: {error}")
