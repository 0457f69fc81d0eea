"""Make the README's pictures anew, runs included.

    python docs/screenshot.py --readme
    python docs/screenshot.py --readme --to FOLDER

Other pictures are made by `brrt view RUN --screenshot OUT.png --at-iteration N`, which says what
to install where the viewer cannot run.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

SIZE, WIDTH = (1600, 900), 1024
"""Of the viewer, and of the pictures in pixels: a few hundred kB would be too much to load."""

STAR = "--planner rrt-star --seed 3 --iterations 600"
README: dict[str, tuple[tuple[str, ...], int | None]] = {
    "rrt2d.png": (
        ("--world squares2d:n=120,seed=4,min_side=3,max_side=10 --seed 7 --param step=2.5",),
        648,
    ),
    "bi_rrt_star.png": (
        ("--planner bi-rrt-star --world squares2d:n=60,seed=3 --seed 1 --iterations 5000",),
        600,
    ),
    "pair.png": ((STAR, f"{STAR} --param informed=true"), None),
}
"""How each run is made, one or two, and the iteration to show; None is where the two part."""


def shoot_readme(folder: Path) -> None:
    """Make the README's pictures."""
    brrt = str(Path(sys.executable).with_name("brrt"))
    size = "x".join(map(str, SIZE))
    with tempfile.TemporaryDirectory() as made:
        for name, (options, iteration) in README.items():
            runs = [str(Path(made, f"{letter}.mcap")) for letter, _ in zip("AB", options)]  # noqa: B905
            for run, each in zip(runs, options, strict=True):
                command = [brrt, "plan", *each.split(), "--out", run, "--force"]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            picture = folder / name
            shown = ["--at-iteration", str(iteration)] if iteration is not None else []
            command = [brrt, "view", *runs, *shown, "--size", size, "--screenshot", str(picture)]
            subprocess.run([*command, "--force"], check=True)
            shrink(picture)


def shrink(picture: Path) -> None:
    """Scale a picture to the width that the README shows."""
    with Image.open(picture) as whole:
        whole.thumbnail((WIDTH, WIDTH))
        whole.save(picture, optimize=True)


def main() -> None:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--readme", action="store_true", required=True)
    parser.add_argument("--to", type=Path, default=Path(__file__).parent, metavar="FOLDER")
    given = parser.parse_args()
    shoot_readme(given.to)


if __name__ == "__main__":
    main()
