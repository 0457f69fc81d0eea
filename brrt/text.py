r"""Text from files and names that cannot steer a terminal, a viewer or a figure.

A name may hold an escape sequence that rewrites the screen, a control that turns the direction of
writing, or a character of no width. They are replaced by escapes, such as \x1b.
"""

import re

_LONE_SURROGATE = re.compile("[\ud800-\udfff]")

_UNSEEN = re.compile(
    # Controls but tab and newline. \udc80 to \udc9f are bytes that 8-bit terminals obey.
    "[\0-\x08\x0b-\x1f\x7f-\x9f\udc80-\udc9f"
    # Default_Ignorable_Code_Point of Unicode, with the bidirectional controls; line separators.
    "\xad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180b-\u180f\u200b-\u200f\u2028-\u202e\u2060-\u206f"
    "\u3164\ufe00-\ufe0f\ufeff\uffa0\ufff0-\ufffb\U0001bca0-\U0001bca3\U0001d173-\U0001d17a"
    "\U000e0000-\U000e0fff]"
)

_MARKUP = re.compile(r"([\\`*_\[\]<>#!|&~$:])")


def readable(text: object) -> str:
    r"""Return a text that UTF-8 can write: a byte of a file's name that is no text becomes \xff.

    Names of files are bytes. Python keeps those that are not UTF-8 as lone surrogates, which
    neither files nor terminals take.
    """
    return _LONE_SURROGATE.sub(_escaped, str(text))


def visible(text: object, *, one_line: bool = False) -> str:
    r"""Return a text in which controls and characters of no width are escapes, such as \x1b.

    Args:
        text: The text; tabs stay, and newlines too.
        one_line: Whether newlines become \n.
    """
    shown = _UNSEEN.sub(_escaped, str(text))
    return shown.replace("\n", "\\n") if one_line else shown


def markdown(text: object) -> str:
    """Return Markdown, of one line, that shows a text as it is: no link, image, cell or HTML."""
    return _MARKUP.sub(r"\\\1", visible(readable(text), one_line=True))


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    if code in range(0xDC80, 0xDD00):
        code -= 0xDC00
    if code < 1 << 8:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 1 << 16 else f"\\U{code:08x}"
