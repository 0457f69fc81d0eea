"""Events as ROS 2 messages: layouts that derive from definitions."""

import pytest

from brrt import BrrtError, Kind
from brrt.formats.mcap.messages import Layout, definition


def test_layout_derives_from_the_text() -> None:
    """Numpy's layout has every field where CDR puts it."""
    layout = Layout.parse(definition(Kind.EDGE, 3))
    body = layout.record.itemsize - 31 - 4
    assert body == 8 + 1 + 3 + 4 + 4 + 4 + 8 + 24
    assert Layout.parse(definition(Kind.PATH, 3)).sequence == "waypoints"


@pytest.mark.parametrize(
    "text", ["string name", "float64[0] q", "uint8[] x", "float64[x] q", "uint8"]
)
def test_layout_refuses_what_is_not_flat(text: str) -> None:
    """A schema without a fixed layout is an error."""
    with pytest.raises(BrrtError, match="unsupported message field"):
        Layout.parse(text)
