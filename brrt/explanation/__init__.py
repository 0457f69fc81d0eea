"""Why a run failed, or took long: figures computed from its recording, and what they suggest."""

from dataclasses import dataclass
from os import PathLike
from typing import Any

from brrt.errors import BrrtError
from brrt.explanation.advice import advise
from brrt.explanation.commands import Advice
from brrt.explanation.facts import Facts, facts
from brrt.explanation.gather import Gather
from brrt.explanation.report import Row, rows, table
from brrt.recording import Recording
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
    moment = run if isinstance(run, Snapshot) else Snapshot(run)
    robot = moment.recording.robot()
    gather = Gather(moment.recording.manifest, robot)
    moment.feed(gather)
    found = facts(moment, file or moment.recording.name, robot, gather)
    return Explanation(found, advise(found))


__all__ = ["Advice", "Explanation", "Facts", "explain"]
