"""A run as data frames of pandas."""

from typing import Any

from brrt.exports.extras import need
from brrt.exports.tables import tables
from brrt.recording import Recording
from brrt.replay.snapshot import snapshot


def to_pandas(recording: Recording, **instant: Any) -> dict[str, Any]:
    """Return the tables of a run as data frames by name; see `brrt.exports.tables.tables`.

    Args:
        recording: The run.
        instant: `time`, `event` or `iteration`, as `brrt.snapshot` takes them.

    Raises:
        BrrtError: pandas is missing, or the instant is wrong.
    """
    pandas = need("pandas")
    found = tables(snapshot(recording, **instant))
    return {name: pandas.DataFrame(dict(columns)) for name, columns in found.items()}
