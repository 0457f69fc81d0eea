"""The palette: what must be told apart can be told apart."""

from itertools import pairwise

import numpy as np
import pytest

from brrt.events import Stage
from brrt.views import colours
from brrt.views.colours import Colour

WHITE: Colour = (255, 255, 255)


def luminance(colour: Colour) -> float:
    """Relative luminance as WCAG 2.1 defines it."""
    parts = np.array(colour) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: Colour, b: Colour) -> float:
    """Contrast ratio as WCAG 2.1 defines it, from 1 to 21."""
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("obstacle", [colours.OBSTACLE, colours.OBSTACLE_3D])
def test_obstacles_stand_out_from_free_space(obstacle: Colour) -> None:
    """They are lighter in viewers, in 2D and in 3D."""
    assert contrast(obstacle, colours.FREE) >= 3
    assert luminance(obstacle) > luminance(colours.FREE)


@pytest.mark.parametrize("obstacle", [colours.PAPER_OBSTACLE, colours.OBSTACLE_3D])
def test_obstacles_stand_out_from_paper(obstacle: Colour) -> None:
    """They are darker in figures, in 2D and in 3D."""
    assert contrast(obstacle, WHITE) >= 3


def test_paths_stand_out() -> None:
    """From free space, obstacles, and trees."""
    for stage in Stage:
        path = colours.path_style(stage)[1]
        assert contrast(path, colours.FREE) >= 7
        assert contrast(path, colours.OBSTACLE) >= 3


def test_lines_are_seen_on_the_ground() -> None:
    """Trees, rejections and samples are lines and dots on free space."""
    lines = [colours.tree_style(tree)[1] for tree in (0, 1)]
    for colour in [*lines, *colours.REJECTS.values(), *colours.SAMPLES.values()]:
        assert contrast(colour, colours.FREE) >= 2


def test_heat_rises() -> None:
    """Higher values are lighter, so that they are read in grey as well."""
    steps = [tuple(map(int, row)) for row in colours.heat(np.linspace(0, 1, 9))]
    assert all(luminance(a) < luminance(b) for a, b in pairwise(steps))  # type: ignore[arg-type]
