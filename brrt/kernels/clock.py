"""The monotonic clock, which kernels read in about 30 ns."""

import sys
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from brrt.kernels.jit import config

_MONOTONIC = {"linux": 1, "darwin": 8}
"""CLOCK_MONOTONIC on Linux, CLOCK_UPTIME_RAW on macOS: the clocks of `time.perf_counter_ns`."""


@intrinsic
def _clock_gettime(typingctx: Any, clock_id: Any) -> Any:  # noqa: ARG001
    """Call the C library's clock_gettime; the result is in nanoseconds."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        int64 = ir.IntType(64)
        timespec = ir.LiteralStructType([int64, int64])
        place = cgutils.alloca_once(builder, timespec)
        function_type = ir.FunctionType(ir.IntType(32), [ir.IntType(32), ir.PointerType(timespec)])
        function = cgutils.get_or_insert_function(builder.module, function_type, "clock_gettime")
        builder.call(function, [builder.trunc(args[0], ir.IntType(32)), place])
        value = builder.load(place)
        seconds = builder.mul(builder.extract_value(value, 0), ir.Constant(int64, 1_000_000_000))
        return builder.add(seconds, builder.extract_value(value, 1))

    return types.int64(types.int64), codegen


if config.DISABLE_JIT or sys.platform not in _MONOTONIC:
    # Without the compiler, or if the C library has no such clock, the events of a call get the
    # time that Python wrote to the buffer before (`EventLog.tick`), each 1 ns after the last.
    COMPILED_CLOCK = False

    @numba.extending.register_jitable
    def now_ns() -> int:
        """Return a time before that of any event."""
        return 0

else:
    COMPILED_CLOCK = True
    _CLOCK_ID = _MONOTONIC[sys.platform]

    @numba.extending.register_jitable
    def now_ns() -> int:
        """Nanoseconds on the clock of `time.perf_counter_ns`."""
        return int(_clock_gettime(_CLOCK_ID))  # type: ignore[call-arg]
