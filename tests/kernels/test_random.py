"""Random numbers inside kernels against numpy's own, bit by bit."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.kernels.jit import config, kernel
from brrt.kernels.random import Random, copy_state, restore_state, uniform
from brrt.kernels.space import distance, sample_informed, sample_uniform
from brrt.kernels.spaces.point import PointSpace, point_space
from brrt.robots import Point
from brrt.worlds import World
from tests.planners.test_rrt import FEW, bounds_of_binomial

Floats = NDArray[np.float64]


@kernel
def fill(draws: Random, out: Floats) -> None:
    """Draw as many numbers as there is room for."""
    for i in range(len(out)):
        out[i] = uniform(draws)


@kernel
def fill_informed(space: PointSpace, draws: Random, ends: Floats, best: float, out: Floats) -> None:
    """Draw configurations over which a path may be better."""
    for row in range(len(out)):
        sample_informed(space, draws, ends, 0, 1, best, out, row)


@kernel
def fill_by_rejection(
    space: PointSpace, draws: Random, ends: Floats, best: float, out: Floats
) -> None:
    """The same from all of the bounds, with rejection."""
    row = 0
    while row < len(out):
        sample_uniform(space, draws, out, row)
        there = distance(space, ends, 0, out, row)
        if there + distance(space, out, row, ends, 1) < best:
            row += 1


def drawn(rng: np.random.Generator, n: int) -> Floats:
    """Numbers that kernels draw from a generator, which then continues after them."""
    out, draws = np.empty(n), copy_state(rng)
    fill(draws, out)
    restore_state(draws, rng)
    return out


def pcg(seed: int) -> np.random.Generator:
    """The generator of a run."""
    return np.random.Generator(np.random.PCG64(seed))


@FEW
@given(st.integers(0, 2**128), st.lists(st.integers(0, 300), min_size=1, max_size=5))
def test_the_same_bits_as_numpy(seed: int, counts: list[int]) -> None:
    """Kernels and Python draw in turns from one stream."""
    ours, theirs = pcg(seed), pcg(seed)
    for number, n in enumerate(counts):
        mine = drawn(ours, n) if number % 2 == 0 else ours.random(n)
        assert mine.tobytes() == theirs.random(n).tobytes()
    assert ours.bit_generator.state == theirs.bit_generator.state


@pytest.mark.parametrize("word", [0, 1, 2**63, 2**64 - 1])
@pytest.mark.parametrize("other", [0, 1, 2**63, 2**64 - 1])
def test_states_at_the_edges(word: int, other: int) -> None:
    """Carries between the words, and rotations by nothing, are numpy's."""
    ours, theirs = pcg(0), pcg(0)
    for rng in (ours, theirs):
        state: Any = rng.bit_generator.state
        state["state"] = {"state": word << 64 | other, "inc": other << 64 | word | 1}
        rng.bit_generator.state = state
    assert drawn(ours, 200).tobytes() == theirs.random(200).tobytes()
    assert ours.bit_generator.state == theirs.bit_generator.state


def test_many_draws() -> None:
    """Every rotation occurs, and no draw differs; they lie in [0, 1)."""
    mine = drawn(pcg(1), 10_000 if config.DISABLE_JIT else 1_000_000)
    assert mine.tobytes() == pcg(1).random(len(mine)).tobytes()
    assert ((mine >= 0) & (mine < 1)).all()


def test_give_back_keeps_what_is_not_the_state() -> None:
    """Half a word that numpy has put aside is still there."""
    ours, theirs = pcg(3), pcg(3)
    for rng in (ours, theirs):
        rng.integers(0, 10, dtype=np.uint32)
    drawn(ours, 5)
    theirs.random(5)
    assert ours.bit_generator.state == theirs.bit_generator.state
    assert (
        ours.integers(0, 2**32, 5, dtype=np.uint32).tolist()
        == theirs.integers(0, 2**32, 5, dtype=np.uint32).tolist()
    )


def test_borrowing_changes_nothing_until_it_is_given_back() -> None:
    """A generator that was lent is as it was."""
    rng, same = pcg(5), pcg(5)
    fill(copy_state(rng), np.empty(10))
    assert rng.random() == same.random()


@pytest.mark.parametrize("other", [np.random.MT19937, np.random.Philox, np.random.PCG64DXSM])
def test_other_generators_are_refused(other: type[np.random.BitGenerator]) -> None:
    """A state that looks alike would give other numbers than it should."""
    with pytest.raises(TypeError, match="draw from PCG64, not from"):
        copy_state(np.random.Generator(other(0)))


ELLIPSES = [
    # Start, goal, cost of the best path as a multiple of their distance.
    ((0.3, 0.4), (0.6, 0.8), 1.2),
    ((0.1, 0.5), (0.9, 0.5), 1.5),
    ((0.5, 0.9), (0.5, 0.1), 1.01),
    ((0.9, 0.5), (0.1, 0.5), 1.05),
    ((0.1, 0.1), (0.9, 0.9), 3.0),
    ((0.3, 0.4, 0.5), (0.6, 0.8, 0.7), 1.2),
    ((0.1, 0.1, 0.1), (0.9, 0.9, 0.9), 1.5),
    ((0.9, 0.5, 0.5), (0.1, 0.5, 0.5), 1.1),
    ((0.5, 0.5, 0.2), (0.5, 0.5, 0.8), 2.0),
]


def unit_space(dim: int) -> PointSpace:
    """A point robot in an empty unit square or cube."""
    return point_space(Point(), World("empty", np.zeros(dim), np.ones(dim)))


def informed(ends: Floats, best: float, n: int, seed: int = 0) -> Floats:
    """Configurations over which a path may be better, n of them."""
    out = np.empty((n, ends.shape[1]))
    fill_informed(unit_space(ends.shape[1]), copy_state(pcg(seed)), ends, best, out)
    return out


def ways(ends: Floats, q: Floats) -> Floats:
    """Lengths of the shortest paths over each configuration."""
    return np.asarray(sum(np.sqrt(((q - end) ** 2).sum(axis=1)) for end in ends))


@pytest.mark.parametrize(("start", "goal", "stretch"), ELLIPSES)
def test_informed_samples_lie_in_the_ellipse(
    start: tuple[float, ...], goal: tuple[float, ...], stretch: float
) -> None:
    """Inside the bounds, and on no longer a way than the best."""
    ends = np.array([start, goal])
    best = stretch * float(ways(ends, ends[:1])[0])
    q = informed(ends, best, 5000)
    assert ((q >= 0) & (q <= 1)).all()
    assert (ways(ends, q) <= best * (1 + 1e-12)).all()


def aspects(ends: Floats, q: Floats) -> list[Floats]:
    """Statistics of the configurations: along each axis, around and along the ellipse."""
    centre = ends.mean(axis=0)
    return [
        *q.T,
        ways(ends, q),
        ways(ends[:1], q),
        ways(centre[None], q),
        (q - centre) @ (ends[1] - ends[0]),
    ]


@pytest.mark.parametrize(("start", "goal", "stretch"), ELLIPSES)
def test_informed_samples_are_spread_evenly(
    start: tuple[float, ...], goal: tuple[float, ...], stretch: float
) -> None:
    """Each part gets the share that sampling by rejection gives it (false alarm 1e-9 a part).

    Parts are slices along each axis and rings around start and goal, each of a tenth of the
    configurations as sampling by rejection finds them.
    """
    ends, n, many = np.array([start, goal]), 20_000, 400_000
    best = stretch * float(ways(ends, ends[:1])[0])
    wanted = np.empty((many, len(start)))
    fill_by_rejection(unit_space(len(start)), copy_state(pcg(1)), ends, best, wanted)
    q = informed(ends, best, n)
    # What rejection finds is uncertain as well: by less than this part of its shares.
    margin = 6 * math.sqrt(0.1 * 0.9 / many)
    least, most = bounds_of_binomial(n, 0.1 - margin)[0], bounds_of_binomial(n, 0.1 + margin)[1]
    for theirs, ours in zip(aspects(ends, wanted), aspects(ends, q), strict=True):
        edges = np.quantile(theirs, np.linspace(0, 1, 11)[1:-1])
        shares = np.bincount(np.searchsorted(edges, ours), minlength=10)
        assert least <= shares.min() <= shares.max() <= most


def test_a_best_path_that_is_straight_leaves_the_line() -> None:
    """Where nothing can be better the ellipse is the line itself, and there is no end in it."""
    ends = np.array([[0.2, 0.3], [0.7, 0.9]])
    best = float(ways(ends, ends[:1])[0])
    for tight in (best, np.nextafter(best, 0)):
        q = informed(ends, float(tight), 500)
        np.testing.assert_allclose(ways(ends, q), best, rtol=1e-12)


def test_an_ellipse_most_of_which_is_out_of_bounds() -> None:
    """Samples stay inside, and are even there: the circle is ten times as wide."""
    ends = np.array([[0.5, 0.5], [0.5, 0.5]])
    q = informed(ends, 10.0, 4000)
    assert ((q >= 0) & (q <= 1)).all()
    low, high = bounds_of_binomial(len(q), 0.1)
    for axis in range(2):
        shares = np.bincount((q[:, axis] * 10).astype(int), minlength=10)
        assert low <= shares.min() <= shares.max() <= high
