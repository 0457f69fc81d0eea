"""What a recording states about the run that made it, written before the first event."""

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib.metadata import version
from typing import Any, Self

from brrt.errors import BrrtError
from brrt.robots import ROBOTS, Robot, mark_robot_file, names_robot_file, robot_from_json
from brrt.scenario.claims import Claims
from brrt.scenario.contract import Contract
from brrt.scenario.scenario import Scenario

MOST_BRANCHES = 1000
"""Of a run: reading, judging and printing a recording takes time for each of them."""


@dataclass(frozen=True, slots=True)
class Branch:
    """Where a run continued a recorded one with other settings.

    Attributes:
        parent: Digest of the recorded run's manifest; see `Manifest.digest`.
        file: Name of its file; empty for a run in memory.
        iteration: The last iteration that both share.
        events: How many events both share; the first of the run's own has this number.
        scenario: The settings up to there.
        seed: Seed of the draws from there on; None to continue the generator.
        contract: The contract up to there; None if none is stated.
    """

    parent: str
    file: str
    iteration: int
    events: int
    scenario: Scenario
    seed: int | None = None
    contract: Contract | None = None

    @property
    def origin(self) -> str:
        """What the run continued, and where: a file by its name at that time."""
        return f"{self.file or 'a run in memory'} at iteration {self.iteration:,}"

    def as_dict(self) -> dict[str, Any]:
        """Return what `parse` takes; the contract is left out."""
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "contract"}
        return {**found, "scenario": self.scenario.as_dict()}

    @classmethod
    def parse(cls, values: Mapping[str, Any], contract: Contract | None = None) -> Self:
        """Read what `as_dict` returned.

        Raises:
            KeyError: A field is missing.
            TypeError: A field is unknown.
            ValueError: A number is malformed, or below 0.
        """
        known = {**values, "scenario": _scenario(values["scenario"])}
        known |= {name: int(values[name]) for name in ("iteration", "events")}
        if min(known["iteration"], known["events"]) < 0:
            raise ValueError("a branch before the beginning")
        return cls(**known, contract=contract)


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a recording states about the run that made it, written before the first event.

    Attributes:
        scenario: The scenario; of a run with branches, from the last of them on.
        start: First configuration, as resolved.
        goal: Last configuration, as resolved.
        dim: 2 or 3, the world's dimension.
        dof: Numbers in a configuration.
        epoch_ns: Wall clock (ns since 1970) at time 0 of the events.
        made_by: Versions of brrt and of its dependencies, and the platform.
        robot: The robot's definition in JSON, resolved in the world; None in recordings made
            before robots were recorded, whose scenario names a robot without a file.
        branches: Where the settings changed, in order, for a run that continues a recorded one.
        contract: What the planner promises, by the settings of `scenario`; None if not stated.
        claims: How the log was made.
        graph: Whether events of `events.GRAPH_KINDS` may follow; a sink sets it with the first.
    """

    scenario: Scenario
    start: tuple[float, ...]
    goal: tuple[float, ...]
    dim: int
    dof: int
    epoch_ns: int
    made_by: Mapping[str, str]
    robot: str | None = None
    branches: tuple[Branch, ...] = ()
    contract: Contract | None = None
    claims: Claims = field(default_factory=Claims)
    graph: bool = False

    FORMAT, BRANCHED, GRAPH = "1", "2", "3"
    """Runs with branches have a format of their own: a reader that does not know them would apply
    the last settings to the whole run. So have graphs: it would take the file as damaged."""

    def __post_init__(self) -> None:
        """Check that the robot is stated: no file that a recording names is ever opened.

        Raises:
            BrrtError: It is not, and the scenario names a file, or there are too many branches.
        """
        _check_count(self.branches)
        if self.robot is None and names_robot_file(self.scenario.robot):
            raise BrrtError(
                f"the manifest has no robot, and its scenario names the file "
                f"{self.scenario.robot!r:.80}, which is not opened: the program that writes the "
                "recording must store the robot's definition in it"
            )

    @property
    def stretches(self) -> tuple[tuple[int, Scenario], ...]:
        """For each scenario, in order, the number of the first event that it rules."""
        firsts = (0, *(branch.events for branch in self.branches))
        scenarios = (*(branch.scenario for branch in self.branches), self.scenario)
        return tuple(zip(firsts, scenarios, strict=True))

    @property
    def contracts(self) -> tuple[Contract | None, ...]:
        """The contract stated for each of the `stretches`; None where none is."""
        return (*(branch.contract for branch in self.branches), self.contract)

    def ruling(self, iteration: int) -> Self:
        """Return the manifest without the branches after an iteration."""
        kept = tuple(b for b in self.branches if b.iteration <= iteration)
        last = self.branches[len(kept)] if len(kept) < len(self.branches) else self
        return replace(self, branches=kept, scenario=last.scenario, contract=last.contract)

    def digest(self) -> str:
        """Return an identifier of the run: equal where everything is, the clock included."""
        return hashlib.sha256(json.dumps(self.to_strings()).encode()).hexdigest()

    @property
    def knows_robot(self) -> bool:
        """Whether the robot's shape is known, without which nothing can be said of collisions."""
        return not self.make_robot().opaque

    def make_robot(self) -> Robot:
        """Make the recorded robot; its file need not exist.

        Raises:
            BrrtError: Its definition is damaged.
        """
        return self.scenario.make_robot() if self.robot is None else robot_from_json(self.robot)

    @property
    def format(self) -> str:
        """The least format that holds the run."""
        if self.graph:
            return self.GRAPH
        return self.BRANCHED if self.branches else self.FORMAT

    def to_strings(self) -> dict[str, str]:
        """One text a field, as MCAP metadata takes them; everything but plain texts as JSON."""
        texts = {} if self.robot is None else {"robot": self.robot}
        if self.contract is not None:
            texts["contract"] = json.dumps(self.contract.as_dict())
        if self.claims.stated():
            texts["claims"] = json.dumps(self.claims.stated())
        if self.branches:
            texts["branches"] = json.dumps([branch.as_dict() for branch in self.branches])
            # Apart from the branches: older versions of brrt refuse unknown fields in these.
            earlier = [None if c is None else c.as_dict() for c in self.contracts[:-1]]
            texts["branch_contracts"] = json.dumps(earlier)
        return texts | {
            "format": self.format,
            "scenario": json.dumps(self.scenario.as_dict()),
            "start": json.dumps(self.start),
            "goal": json.dumps(self.goal),
            "dim": str(self.dim),
            "dof": str(self.dof),
            "epoch_ns": str(self.epoch_ns),
            "made_by": json.dumps(dict(self.made_by)),
        }

    @classmethod
    def from_strings(cls, texts: Mapping[str, str]) -> Self:
        """Read what `to_strings` wrote.

        Raises:
            BrrtError: A field is missing or damaged, or the format is newer than this brrt.
        """
        if texts.get("format") not in (cls.FORMAT, cls.BRANCHED, cls.GRAPH):
            raise BrrtError(
                f"recording format {texts.get('format')!r} is not {cls.FORMAT!r}; update brrt"
            )
        try:
            return cls(
                _scenario(_json(texts["scenario"])),
                tuple(map(float, _json(texts["start"]))),
                tuple(map(float, _json(texts["goal"]))),
                int(texts["dim"]),
                int(texts["dof"]),
                int(texts["epoch_ns"]),
                dict(_json(texts["made_by"])),
                texts.get("robot"),
                _branches(texts),
                _contract(_json(texts.get("contract", "null"))),
                _claims(_json(texts.get("claims", "null"))),
                texts["format"] == cls.GRAPH,
            )
        except KeyError as error:
            raise BrrtError(f"the manifest is damaged: it has no {error}") from None
        except (ValueError, TypeError, RecursionError) as error:
            raise BrrtError(f"the manifest is damaged: {error!r}") from None


def _json(text: str) -> Any:
    """Read JSON by its definition, without NaN and Infinity: no setting has these values."""
    return json.loads(text, parse_constant=_refused)


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def _scenario(values: Any) -> Scenario:
    """Read a scenario; world and planner must be in it, since the defaults may be wrong.

    No file is looked up: a robot that is unknown here was one.
    """
    robot = values.get("robot") if isinstance(values, Mapping) else None
    if isinstance(robot, str) and robot.partition(":")[0] not in ROBOTS:
        values = {**values, "robot": mark_robot_file(robot)}
    scenario = Scenario.parse(values)
    for name in ("world", "planner"):
        if name not in values:
            raise BrrtError(f"the manifest is damaged: its scenario has no {name}")
    return scenario


def _branches(texts: Mapping[str, str]) -> tuple[Branch, ...]:
    branches = _json(texts.get("branches", "[]"))
    _check_count(branches)
    contracts = _json(texts.get("branch_contracts", "null")) or [None] * len(branches)
    pairs = zip(branches, contracts, strict=True)
    return tuple(Branch.parse(branch, _contract(contract)) for branch, contract in pairs)


def _check_count(branches: Sequence[Any]) -> None:
    if len(branches) > MOST_BRANCHES:
        raise BrrtError(
            f"the run has {len(branches):,} branches, and may have at most {MOST_BRANCHES:,}; "
            "plan one run with the settings of the last branch"
        )


def _contract(values: Any) -> Contract | None:
    """Read what `Contract.as_dict` returned.

    Raises:
        BrrtError: It is damaged, or has fields that this version does not know.
    """
    if values is None:
        return None
    try:
        return Contract.from_dict(values)
    except BrrtError as error:
        raise BrrtError(f"the manifest is damaged: its contract: {error}") from None


def _claims(values: Any) -> Claims:
    """Read what `Claims.stated` returned.

    Raises:
        BrrtError: They are damaged, or have fields that this version does not know.
    """
    try:
        return Claims.of(values)
    except BrrtError as error:
        raise BrrtError(f"the manifest is damaged: its claims: {error}") from None


@cache
def made_by() -> dict[str, str]:
    """Versions of brrt and of everything that affects its numbers, and the platform."""
    names = {name: version(name) for name in ("brrt", "numpy", "numba", "llvmlite")}
    return {
        **names,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }
