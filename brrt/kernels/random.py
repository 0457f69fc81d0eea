"""Random numbers in kernels: the same bits that numpy's `Generator(PCG64(seed))` draws.

Numba accepts a Generator, but needs 140 us with cold caches to access it, twice as long as an easy
query takes to solve. Here the state of PCG64 (O'Neill 2014, XSL-RR, 128 bits) is an array.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from brrt.kernels.jit import config

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
_LOW = (1 << 64) - 1
_TO_UNIT = 1.0 / (1 << 53)


class Random(NamedTuple):
    """The state of a generator.

    Attributes:
        words: State and increment, the high word of each first, shape (4,).
    """

    words: NDArray[np.uint64]


def copy_state(rng: np.random.Generator) -> Random:
    """Return the state of a generator; `restore_state` writes it back.

    Raises:
        TypeError: The generator is not a PCG64.
    """
    state: Any = rng.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise TypeError(f"planners draw from PCG64, not from {state['bit_generator']}")
    inner = state["state"]
    both = (inner["state"], inner["inc"])
    return Random(np.array([w for n in both for w in (n >> 64, n & _LOW)], np.uint64))


def restore_state(draws: Random, rng: np.random.Generator) -> None:
    """Set a generator to the state after the draws of kernels."""
    high, low = (int(word) for word in draws.words[:2])
    state: Any = rng.bit_generator.state
    state["state"]["state"] = high << 64 | low
    rng.bit_generator.state = state


@intrinsic
def _advance(typingctx: Any, high: Any, low: Any, inc_high: Any, inc_low: Any) -> Any:  # noqa: ARG001
    """Return both words of state * multiplier + increment, modulo 2^128."""
    word = types.uint64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        wide = ir.IntType(128)

        def joined(high: Any, low: Any) -> Any:
            shifted = builder.shl(builder.zext(high, wide), ir.Constant(wide, 64))
            return builder.or_(shifted, builder.zext(low, wide))

        product = builder.mul(joined(args[0], args[1]), ir.Constant(wide, _MULTIPLIER))
        state = builder.add(product, joined(args[2], args[3]))
        high = builder.trunc(builder.lshr(state, ir.Constant(wide, 64)), ir.IntType(64))
        low = builder.trunc(state, ir.IntType(64))
        return context.make_tuple(builder, signature.return_type, (high, low))

    return types.UniTuple(word, 2)(word, word, word, word), codegen


if config.DISABLE_JIT:

    def uniform(draws: Random) -> float:
        """Draw from [0, 1)."""
        words = [int(word) for word in draws.words]
        state = (words[0] << 64 | words[1]) * _MULTIPLIER + (words[2] << 64 | words[3])
        high, low = state >> 64 & _LOW, state & _LOW
        draws.words[0], draws.words[1] = high, low
        turn = high >> 58
        mixed = high ^ low
        rotated = (mixed >> turn | mixed << (64 - turn)) & _LOW
        return (rotated >> 11) * _TO_UNIT

else:
    _next_state: Any = _advance

    @numba.extending.register_jitable
    def uniform(draws: Random) -> float:
        """Draw from [0, 1)."""
        words = draws.words
        high, low = _next_state(words[0], words[1], words[2], words[3])
        words[0], words[1] = high, low
        turn = high >> np.uint64(58)
        mixed = high ^ low
        back = (np.uint64(64) - turn) & np.uint64(63)
        rotated = (mixed >> turn) | (mixed << back)
        return float(rotated >> np.uint64(11)) * _TO_UNIT
