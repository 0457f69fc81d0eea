"""Take pictures of Rerun recordings without a screen.

    python docs/screenshot.py RUN.rrd OUT.png [ITERATION ...]
    python docs/screenshot.py --readme

With several iterations the pictures are OUT_0.png, OUT_1.png ... The second line makes the
README's pictures anew, runs included. It needs a Vulkan driver; Mesa's lavapipe will do (Debian:
mesa-vulkan-drivers libvulkan1 libegl1 libgl1-mesa-dri libxkbcommon-x11-0 libxcursor1 libxi6
libxrandr2).
"""

import argparse
import importlib.util
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rerun.experimental import ViewerClient

LOADING_S = 2.0
"""The viewer says nothing when it has drawn all that it has loaded."""


WIDTH = 1024
"""Of the README's pictures, in pixels: a few hundred kB would be too much to load."""

README: dict[str, tuple[str, int | None]] = {
    "rrt2d.png": (
        "--world squares2d:n=120,seed=4,min_side=3,max_side=10 --seed 7 --param step=2.5",
        100_000,
    ),
    "bi_rrt_star.png": (
        "--planner bi-rrt-star --world squares2d:n=60,seed=3 --seed 1 --iterations 5000",
        600,
    ),
}
"""How each run is made, and the iteration to show."""


def viewer_program() -> str:
    """Return the viewer's own file: the script `rerun` beside Python leaves a child behind."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise SystemExit("rerun-sdk is not installed")
    return str(Path(spec.origin).with_name("rerun"))


def shoot(run: Path, pictures: dict[Path, int | None], port: int, width: int | None = None) -> None:
    """Write a picture of a recording at each iteration; None leaves the time as it opens."""
    viewer = ViewerClient.spawn(
        headless=True, port=port, hide_welcome_screen=True, executable_path=viewer_program()
    )
    try:
        viewer.open(str(run.resolve()))
        time.sleep(LOADING_S)
        for picture, iteration in pictures.items():
            if iteration is not None:
                viewer.set_time("iteration", sequence=iteration, play_state="paused")
                time.sleep(LOADING_S)
            picture.write_bytes(viewer.take_screenshot(max_size=width))
    finally:
        viewer.quit()


def shoot_readme(port: int) -> None:
    """Make the README's pictures."""
    docs = Path(__file__).parent
    brrt = str(Path(sys.executable).with_name("brrt"))
    with tempfile.TemporaryDirectory() as folder:
        for name, (options, iteration) in README.items():
            run = Path(folder, name).with_suffix(".rrd")
            command = [brrt, "plan", *options.split(), "--rrd", str(run)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            shoot(run, {docs / name: iteration}, port, WIDTH)


def main() -> None:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("iterations", type=int, nargs="*")
    parser.add_argument("--port", type=int, default=19876)
    parser.add_argument("--readme", action="store_true", help="make the README's pictures")
    given = parser.parse_args()
    if given.readme:
        shoot_readme(given.port)
        return
    if given.out is None:
        parser.error("give a recording and a picture, or --readme")
    names = [given.out]
    if len(given.iterations) > 1:
        count = range(len(given.iterations))
        names = [given.out.with_stem(f"{given.out.stem}_{i}") for i in count]
    pictures = dict(zip(names, given.iterations or [None], strict=True))
    shoot(given.run, pictures, given.port)


if __name__ == "__main__":
    main()
