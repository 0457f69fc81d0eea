"""What there is to say of a node of a tree: plain data."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple


class When(NamedTuple):
    """An event: its number, its time in seconds, and the planner's count."""

    event: int
    time_s: float
    iteration: int

    @classmethod
    def of(cls, row: Any) -> "When":
        """Say when a row of a table happened."""
        return cls(int(row["seq"]), int(row["t"]) / 1e9, int(row["iteration"]))


@dataclass(frozen=True, slots=True)
class Draw:
    """The last sample of the iteration in which a node was born, drawn before it.

    Attributes:
        when: Its event.
        tree: The tree that was to grow towards it.
        source: Where it came from.
        q: Configuration.
    """

    when: When
    tree: int
    source: str
    q: list[float]


@dataclass(frozen=True, slots=True)
class Turn:
    """A change of a node's cost.

    Attributes:
        when: The rewire's event.
        node: Which node was rewired: this one, or an ancestor that it follows.
        old_parent: That node's parent before.
        parent: And after.
        before: Cost-to-come of the node whose history this is, before.
        after: And after.
    """

    when: When
    node: int
    old_parent: int
    parent: int
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Rejected:
    """An extension that left from the node and failed.

    Attributes:
        when: Its event.
        reason: Why it failed.
        q: Where it wanted to go.
        hit: What is in the way, as the checks see it; None where nothing is.
    """

    when: When
    reason: str
    q: list[float]
    hit: str | None


@dataclass(frozen=True, slots=True)
class NodeHistory:
    """All that a log says about a node up to an instant.

    Attributes:
        node: Its number.
        tree: Number of its tree.
        q: Its configuration.
        born: The event that made it.
        born_parent: Its parent then; -1 for a root.
        born_cost: Its cost-to-come then.
        sample: What was drawn before it was born; None for roots.
        rewires: Each time it got another parent.
        follows: Each time its cost changed because an ancestor got another parent.
        parent: Its parent at the instant.
        cost: Its cost-to-come at the instant.
        lineage: Nodes from the root to it.
        children: Nodes whose parent it is.
        descendants: How many nodes stand below it.
        paths: For each path that stands and goes through it, by stage, which waypoint it is.
        rejects: Extensions from it that failed.
    """

    node: int
    tree: int
    q: list[float]
    born: When
    born_parent: int
    born_cost: float
    sample: Draw | None
    rewires: list[Turn]
    follows: list[Turn]
    parent: int
    cost: float
    lineage: list[int]
    children: list[int]
    descendants: int
    paths: dict[str, int]
    rejects: list[Rejected]

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts."""
        plain: dict[str, Any] = as_plain(self)
        return plain

    def reasons(self) -> dict[str, int]:
        """Count the failed extensions by reason, most frequent first."""
        return dict(Counter(each.reason for each in self.rejects).most_common())

    def hits(self) -> dict[str, int]:
        """Count them by what was in the way, most frequent first."""
        return dict(Counter(each.hit for each in self.rejects if each.hit).most_common())


def as_plain(value: Any) -> Any:
    """Return dataclasses and named tuples as dicts, whatever they hold."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return value._asdict()
    if isinstance(value, dict):
        return {name: as_plain(each) for name, each in value.items()}
    if isinstance(value, list):
        return [as_plain(each) for each in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: as_plain(getattr(value, name)) for name in value.__dataclass_fields__}
    return value
