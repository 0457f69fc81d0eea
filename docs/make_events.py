"""Write events.md and the C++ header from brrt/events.py; `--check` only compares.

python docs/make_events.py [--check]
"""

import sys
from pathlib import Path

from brrt.events import COUNTS, FIELDS, Kind, Named, Phase, Reason, Source, Stage, Status
from brrt.formats.mcap.messages import definition

PAGE = Path(__file__).with_name("events.md")
HEADER = Path(__file__).parents[1] / "brrt" / "include" / "brrt" / "events.hpp"
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


_HEADER = """// The kinds of events. Made from brrt/events.py by docs/make_events.py: do not edit.
#pragma once

#include <cstddef>
#include <cstdint>

namespace brrt {
"""

_TABLE = """
namespace detail {

/// A kind of event: its name, the key of its count in the metrics (or null), and its ROS 2
/// message definition, in which `@` stands for the numbers in a configuration.
struct KindInfo {
    const char *name, *count, *definition;
};

inline constexpr KindInfo kKinds[] = {
"""

_NO_DOF = 10**9
"""A number of coordinates that no definition has by chance."""


def header() -> str:
    """Return the whole C++ header."""
    parts = [_HEADER, *map(_enumeration, (Kind, Phase, Status, Source, Reason, Stage)), _TABLE]
    for kind in Kind:
        count = COUNTS[kind].key if kind in COUNTS else None
        lines = definition(kind, _NO_DOF).replace(str(_NO_DOF), "@").splitlines()
        text = "\n".join(f'     "{line}\\n"' for line in lines)
        key = f'"{count}"' if count else "nullptr"
        parts.append(f'    {{"{kind.key}", {key},\n{text}}},\n')
    labels = ", ".join(f'"{status.label}"' for status in Status)
    parts.append(
        "};\n\ninline constexpr std::size_t kKindCount = sizeof(kKinds) / sizeof(KindInfo);\n"
    )
    parts.append(f"\ninline constexpr const char *kStatusLabels[] = {{\n    {labels}}};\n")
    parts.append("\n}  // namespace detail\n}  // namespace brrt\n")
    return "".join(parts)


def _enumeration(choices: type[Named]) -> str:
    members = "".join(f"    {each.key} = {each.value},\n" for each in choices)
    about = (choices.__doc__ or "").splitlines()[0]
    return f"\n/// {about}\nenum class {choices.__name__} : std::uint8_t {{\n{members}}};\n"


FILES = {PAGE: page, HEADER: header}
"""What is made from the declaration."""

if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        old = [path.name for path, make in FILES.items() if path.read_text() != make()]
        sys.exit(f"out of date, make anew: {', '.join(old)}" if old else 0)
    for path, make in FILES.items():
        path.write_text(make())
