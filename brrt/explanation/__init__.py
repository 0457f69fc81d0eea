"""Why a run failed, or took long: figures computed from its recording, and what they suggest."""

from dataclasses import dataclass
from os import PathLike
from typing import Any, Protocol

from brrt.errors import BrrtError
from brrt.explanation.advice import advise
from brrt.explanation.commands import Advice
from brrt.explanation.facts import Facts, facts
from brrt.explanation.gather import Gather
from brrt.explanation.report import Row, rows, table
from brrt.replay.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a run was like, and what to try; as text it is what `brrt explain` prints.

    Attributes:
        facts: Figures.
        advice: What follows from them, the most telling first.
    """

    facts: Facts
    advice: list[Advice]

    def rows(self) -> list[Row]:
        """Tell the facts in words: names with what there is to say."""
        return list(rows(self.facts))

    def table(self) -> list[str]:
        """Write the facts for a screen of 80 columns, in lines."""
        return list(table(self.rows()))

    def __str__(self) -> str:
        """Return what `brrt explain` prints."""
        lines = self.table()
        for i, advice in enumerate(self.advice):
            lines += ["", *advice.reason(i + 1), *advice.typed()]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts."""
        return {**self.facts.as_dict(), "advice": [each.as_dict() for each in self.advice]}


class _Recorded(Protocol):
    """A recording, as `brrt.read` returns it."""

    def at(self) -> Snapshot:
        """Return the run at its end."""


def explain(run: Snapshot | _Recorded, file: str = "") -> Explanation:
    """Explain a run as it stood at an instant, in one pass over its events.

    Args:
        run: The run at an instant, or a recording: the run at its end.
        file: The recording, as commands that are advised name it; by default its own name.

    Raises:
        BrrtError: `run` is the path of a recording, or something else; or the manifest's query is
            of no use in its world.
    """
    moment = run if isinstance(run, Snapshot) else _end(run)
    robot = moment.manifest.make_robot().resolved(moment.world)
    gather = Gather(moment.manifest, robot)
    moment.feed(gather)
    found = facts(moment, file or moment.name, robot, gather)
    return Explanation(found, advise(found))


def _end(run: _Recorded) -> Snapshot:
    if isinstance(run, str | PathLike):
        raise BrrtError(
            f"explain takes a recording, not its path: brrt.explain(brrt.read({str(run)!r}))"
        )
    if not hasattr(run, "at"):
        raise BrrtError(f"explain takes a recording or a moment of one, not {run!r:.60}")
    return run.at()


__all__ = ["Advice", "Explanation", "Facts", "explain"]
