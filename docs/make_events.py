"""Write events.md from the declaration in brrt/events.py; `--check` only compares.

python docs/make_events.py [--check]
"""

import sys
from pathlib import Path

from brrt.events import FIELDS, Kind

PAGE = Path(__file__).with_name("events.md")
HEAD = """# Events

Every event has `seq` (0, 1, 2 ...: the order of the run), `t` (ns on the monotonic clock since
the run began) and `iteration` (the planner's count). In an MCAP file these are the message's
sequence, its log time less the manifest's `epoch_ns`, and a field; in Python they are columns of
each table. `q` is a whole configuration, float64, one number for each degree of freedom.

This page is made from `brrt/events.py` by `python docs/make_events.py`.
"""


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for kind in Kind:
        parts += [f"\n## {kind.label}\n", "| field | type | meaning |", "| --- | --- | --- |"]
        for field in FIELDS[kind]:
            choices = (
                ""
                if field.choices is None
                else ": " + ", ".join(f"{c.value} {c.label}" for c in field.choices)
            )
            parts.append(f"| {field.name} | {field.type} | {field.doc}{choices} |")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(0 if PAGE.read_text() == page() else "events.md is out of date; make it anew")
    PAGE.write_text(page())
