"""Rerun's file format: events as Arrow columns, and the reader. The writer is brrt.views.rerun."""

from brrt.errors import BrrtError, address_space

_LEAST_KB = 3_000_000
"""Address space in units of `ulimit -v`; with less, allocations of Rerun end the process."""

if address_space() / 1024 < _LEAST_KB:
    raise BrrtError(
        f"Rerun needs {_LEAST_KB:,} kB of address space, and `ulimit -v` allows "
        f"{address_space() / 1024:,.0f}; raise it, or use MCAP files (`--out run.mcap`) alone"
    )
