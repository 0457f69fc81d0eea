"""Take pictures of Rerun recordings without a screen.

    python docs/screenshot.py RUN.rrd OUT.png [ITERATION ...]

With several iterations the pictures are OUT_0.png, OUT_1.png ... It needs a Vulkan driver; Mesa's
lavapipe will do (Debian: mesa-vulkan-drivers libvulkan1 libegl1 libgl1-mesa-dri
libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2).
"""

import argparse
import importlib.util
import time
from pathlib import Path

from rerun.experimental import ViewerClient

LOADING_S = 2.0
"""The viewer says nothing when it has drawn all that it has loaded."""


def viewer_program() -> str:
    """Return the viewer's own file: the script `rerun` beside Python leaves a child behind."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise SystemExit("rerun-sdk is not installed")
    return str(Path(spec.origin).with_name("rerun"))


def shoot(run: Path, pictures: dict[Path, int | None], port: int) -> None:
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
            picture.write_bytes(viewer.take_screenshot())
    finally:
        viewer.quit()


def main() -> None:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("iterations", type=int, nargs="*")
    parser.add_argument("--port", type=int, default=19876)
    given = parser.parse_args()
    names = [given.out]
    if len(given.iterations) > 1:
        count = range(len(given.iterations))
        names = [given.out.with_stem(f"{given.out.stem}_{i}") for i in count]
    pictures = dict(zip(names, given.iterations or [None], strict=True))
    shoot(given.run, pictures, given.port)


if __name__ == "__main__":
    main()
