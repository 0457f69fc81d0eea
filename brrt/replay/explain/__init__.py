"""Why a run failed, or took long: figures computed from its recording, and what they suggest."""

from dataclasses import dataclass
from typing import Any

from brrt.replay.explain.advice import Advice, advise
from brrt.replay.explain.facts import Facts, facts
from brrt.replay.explain.gather import Gather
from brrt.replay.explain.tell import Row, rows
from brrt.replay.moment import Moment


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a run was like, and what to try.

    Attributes:
        facts: Figures.
        advice: What follows from them, the most telling first.
    """

    facts: Facts
    advice: list[Advice]

    def rows(self) -> list[Row]:
        """Tell the facts in words: names with what there is to say."""
        return list(rows(self.facts))

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts."""
        return {**self.facts.as_dict(), "advice": [each.as_dict() for each in self.advice]}


def explain(moment: Moment) -> Explanation:
    """Explain a run as it stood at an instant, in one pass over its events.

    Raises:
        BrrtError: The manifest's query is of no use in its world.
    """
    robot = moment.manifest.make_robot().settled(moment.world)
    gather = Gather(moment.manifest, robot)
    moment.feed(gather)
    found = facts(moment.manifest, moment.world, robot, gather)
    return Explanation(found, advise(found))


__all__ = ["Advice", "Explanation", "Facts", "explain"]
