"""Names and texts that try to steer a terminal, a viewer or a figure."""

import unicodedata

import pytest

from brrt import BrrtError
from brrt.text import markdown, readable, visible

SEQUENCE = "\x1b]0;title\x07"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (SEQUENCE, "\\x1b]0;title\\x07"),
        ("\x9b31m", "\\x9b31m"),
        ("\udc9b31m", "\\x9b31m"),
        ("a\rb\tc\nd", "a\\x0db\tc\nd"),
        ("abc\u202efed", "abc\\u202efed"),
        ("zero\u200bwidth\ufeff", "zero\\u200bwidth\\ufeff"),
        ("tag\U000e0041", "tag\\U000e0041"),
        ("größe · 東京 → 😀", "größe · 東京 → 😀"),
    ],
)
def test_visible(text: str, shown: str) -> None:
    """Controls become escapes; letters of all scripts stay."""
    assert visible(text) == shown


def test_one_line() -> None:
    """A newline in a name cannot forge a line of output."""
    assert visible("a\nall rules hold", one_line=True) == "a\\nall rules hold"


def test_every_control_and_every_bidi_character_is_made_visible() -> None:
    """Unicode's own lists: category Cc, and what has a class of bidirectional control."""
    bidi = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI", "BN"}
    for code in range(0x110000):
        char = chr(code)
        if unicodedata.category(char) == "Cc" or unicodedata.bidirectional(char) in bidi:
            assert char in "\t\n" or visible(char) != char, hex(code)


def test_markdown() -> None:
    """Links, images, cells, HTML and newlines are shown as they are."""
    shown = markdown("[l](http://e) ![i](x) | <b> `c` *d* _e_\n# f")
    assert "\n" not in shown
    assert shown == r"\[l\](http\://e) \!\[i\](x) \| \<b\> \`c\` \*d\* \_e\_\\n\# f"


def test_readable() -> None:
    """Bytes of file names that are no text."""
    assert readable("run\udcff.mcap") == "run\\xff.mcap"


def test_errors() -> None:
    """A message quotes names of files and of planners."""
    assert str(BrrtError(f"unknown planner {SEQUENCE}")) == "unknown planner \\x1b]0;title\\x07"
