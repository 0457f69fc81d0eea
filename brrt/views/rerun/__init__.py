"""Recordings for the Rerun viewer."""

import brrt.formats.rrd  # noqa: F401 - refuses to go on where Rerun cannot work
