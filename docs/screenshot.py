"""Make the pictures of the README and of the gallery, and the runs that they show.

    python docs/screenshot.py
    python docs/screenshot.py rrt2d.png web.png --to FOLDER

It needs `pip install -e '.[test]'`; if the viewer cannot run, `brrt view --screenshot` says what to
install. Without Chromium the picture of the browser is left out.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.support.browser import CHROMIUM, browser  # noqa: E402 - it is not installed

SIZE, WIDTH = (1600, 900), 1024
"""Size of the viewer and width of the pictures, in pixels; a page loads small pictures faster."""
SLIDER = 0.62, 0.981
"""Where the time slider is clicked, as parts of the page."""

STAR = "--planner rrt-star --seed 3 --iterations 600"


class Picture(NamedTuple):
    """How a picture is made.

    Attributes:
        runs: Options of `brrt plan`, for one run or two.
        shown: Options of `brrt view`, or of `brrt plot` after the word "plot", or "web".
    """

    runs: tuple[str, ...]
    shown: str


PICTURES = {
    "rrt2d.png": Picture(
        ("--world squares2d:n=120,seed=4,min_side=3,max_side=10 --seed 7 --param step=2.5",),
        "--at-iteration 648",
    ),
    "rrt3d.png": Picture(("--world gap3d --seed 2",), "--at-iteration 4000"),
    "bi_rrt_star.png": Picture(
        ("--planner bi-rrt-star --world squares2d:n=60,seed=3 --seed 1 --iterations 5000",),
        "--at-iteration 600",
    ),
    "pair.png": Picture((STAR, f"{STAR} --param informed=true"), ""),
    "polygon.png": Picture((f"{ROOT}/examples/house-hard.toml",), "--at-event 1422"),
    "chain.png": Picture((f"{ROOT}/examples/arm-hard.toml",), "--at-event 619"),
    "lrta2d.png": Picture(
        ("--planner lrta-star --world bugtrap2d --param cell=1",), "--at-iteration 30000"
    ),
    "lrta3d.png": Picture(
        ("--planner lrta-star --world window3d --param cell=1",), "--at-iteration 8000"
    ),
    "web.png": Picture(("--planner rrt-connect --world maze2d:seed=4 --seed 2",), "web"),
    "plot.png": Picture((), f"plot {ROOT}/recordings/circles2d-rrt-star.mcap --dpi 150"),
}


def make(name: str, folder: Path) -> None:
    """Make a picture."""
    picture, out = PICTURES[name], folder / name
    with tempfile.TemporaryDirectory(prefix="pictures-") as made:
        runs = [str(Path(made, f"{letter}.mcap")) for letter in "AB"[: len(picture.runs)]]
        for run, options in zip(runs, picture.runs, strict=True):
            brrt("plan", *options.split(), "--out", run, "--json", quiet=True)
        if picture.shown == "web":
            take_web_picture(runs[0], out)
        elif picture.shown.startswith("plot "):
            brrt(*picture.shown.split(), "--out", str(out), "--force")
        else:
            size = "x".join(map(str, SIZE))
            shot = ("--size", size, "--screenshot", str(out), "--force")
            brrt("view", *runs, *picture.shown.split(), *shot)
    if not picture.shown.startswith("plot "):
        shrink(out)


def brrt(*args: str, quiet: bool = False) -> None:
    """Run the command of this Python's environment."""
    command = [str(Path(sys.executable).with_name("brrt")), *args]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL if quiet else None)


def take_web_picture(run: str, out: Path) -> None:
    """Take a picture of the viewer in the browser, in the middle of the run."""
    command = [str(Path(sys.executable).with_name("brrt")), "view", run, "--web"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server,
        tempfile.TemporaryDirectory(prefix="browser-") as profile,
    ):
        try:
            assert server.stdout is not None  # noqa: S101 - it is a pipe
            address = server.stdout.readline().split(" at ")[1].strip()
            with browser(Path(profile), SIZE, 300) as page:
                page.visit(address)
                picture_at_rest(page.picture)
                page.click(*(part * side for part, side in zip(SLIDER, SIZE, strict=True)))
                out.write_bytes(picture_at_rest(page.picture))
        finally:
            server.terminate()
            server.wait()


def picture_at_rest(take: Callable[[], bytes]) -> bytes:
    """Return a picture once it equals the one 2 s before: while it loads, it changes."""
    last, png = b"", b"?"
    while not png or png != last:
        time.sleep(2)
        last, png = png, take()
    return png


def shrink(picture: Path) -> None:
    """Scale a picture to `WIDTH`, with 256 colours."""
    with Image.open(picture) as whole:
        small = whole.convert("RGB")
    small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    # Of Pillow's methods this one keeps colours of few pixels, such as the ring.
    plain = small.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    plain.save(picture, optimize=True)


def main() -> None:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--to", type=Path, default=Path(__file__).parent, metavar="FOLDER")
    given = parser.parse_args()
    unknown = set(given.names) - PICTURES.keys()
    if unknown:
        parser.error(f"no picture is called {', '.join(sorted(unknown))}")
    for name in given.names or PICTURES:
        if PICTURES[name].shown == "web" and CHROMIUM is None:
            print(f"{name}: left out, Chromium is not installed")
            continue
        make(name, given.to)


if __name__ == "__main__":
    main()
