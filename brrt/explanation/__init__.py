"""Why a run failed or took long: facts computed from its recording, and advice that follows."""

from dataclasses import dataclass
from os import PathLike
from typing import Any

from brrt.errors import BrrtError
from brrt.explanation.advice import advise
from brrt.explanation.commands import Advice
from brrt.explanation.facts import Facts, facts
from brrt.explanation.report import Row, rows, table
from brrt.recording import Recording
from brrt.replay.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class Explanation:
    """The facts of a run, and advice, the most promising first; see `brrt explain`."""

    facts: Facts
    advice: list[Advice]

    def rows(self) -> list[Row]:
        """Return the facts in words: names and texts."""
        return list(rows(self.facts))

    def table(self) -> list[str]:
        """Return the facts as lines of 80 columns."""
        return list(table(self.rows()))

    def __str__(self) -> str:
        """Return what `brrt explain` prints."""
        lines = self.table()
        for i, advice in enumerate(self.advice, 1):
            lines += ["", *advice.reason(i), *advice.command_lines()]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dicts."""
        return {**self.facts.as_dict(), "advice": [each.as_dict() for each in self.advice]}


def explain(run: Recording | Snapshot, file: str = "") -> Explanation:
    """Explain a run, in one pass over its events.

    Args:
        run: The run, or a snapshot of it.
        file: The recording's file as the commands of the advice name it; its name by default.

    Raises:
        BrrtError: `run` is neither, or the manifest does not fit its world.
    """
    if isinstance(run, str | PathLike):
        raise BrrtError(
            f"explain takes a recording, not its path: brrt.explain(brrt.read({str(run)!r}))"
        )
    if not isinstance(run, Recording | Snapshot):
        raise BrrtError(f"explain takes a recording or a snapshot of one, not {run!r:.60}")
    snapshot = run if isinstance(run, Snapshot) else Snapshot(run)
    found = facts(snapshot, file or snapshot.recording.name)
    return Explanation(found, advise(found))


__all__ = ["Advice", "Explanation", "Facts", "explain"]
