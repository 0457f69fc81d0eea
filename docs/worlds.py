"""Draw one world of each generator, for the README.

    python docs/worlds.py [OUT.png]

It needs matplotlib: pip install -e '.[plot]'.
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from PIL import Image

from brrt import GENERATORS, make_world
from brrt.views.matplotlib.draw_world import plot_world

COLUMNS, SIDE_IN = 8, 1.7

SHOWN = {"circles2d": "n=40", "squares2d": "n=60", "spheres3d": "n=30", "boxes3d": "n=30"}
"""Parameters for generators whose defaults are less typical."""


def main() -> None:
    """Draw all of them into one picture."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".png")
    rows = -(-len(GENERATORS) // COLUMNS)
    sheet = plt.figure(figsize=(COLUMNS * SIDE_IN, rows * SIDE_IN * 1.1), layout="constrained")
    for i, name in enumerate(GENERATORS):
        world = make_world(f"{name}:{SHOWN.get(name, '')}")
        projection = "3d" if world.dim == 3 else None
        axes: Any = sheet.add_subplot(rows, COLUMNS, i + 1, projection=projection)
        plot_world(world, axes)
        axes.set_title(name, fontsize=8)
        if world.dim == 2:
            axes.set(xticks=[], yticks=[])
        else:
            axes.set_axis_off()
            axes.set_box_aspect(world.upper - world.lower, zoom=1.25)
    sheet.savefig(out, dpi=110)
    with Image.open(out) as whole:
        flat = whole.convert("RGB")  # half the size with fewer colours
    octree, none = Image.Quantize.FASTOCTREE, Image.Dither.NONE
    flat.quantize(256, method=octree, dither=none).save(out, optimize=True)


if __name__ == "__main__":
    main()
