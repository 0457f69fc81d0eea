"""What a recording says about the run that made it, written before the first event."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

from brrt.errors import BrrtError
from brrt.planners.base.problem import Problem
from brrt.robots import Robot, robot_from_json
from brrt.scenario.scenario import Scenario
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True)
class Branch:
    """Where a run went on from a recorded one with other settings.

    Attributes:
        parent: Digest of the recorded run's manifest; see `Manifest.digest`.
        file: Name of its file; empty where it had none.
        iteration: The last iteration that both share.
        events: How many events both share; the first of the run's own has this number.
        scenario: What ruled up to there.
        seed: Seed of the draws from there on; None where the generator simply went on.
    """

    parent: str
    file: str
    iteration: int
    events: int
    scenario: Scenario
    seed: int | None = None

    @property
    def origin(self) -> str:
        """What it went on from, and where: a file's name as it was then."""
        return f"{self.file or 'a run in memory'} at iteration {self.iteration:,}"

    def told(self, after: Scenario) -> str:
        """Say what is otherwise from here on, where another scenario rules."""
        before, now = ({**s.as_dict(), **s.settings()} for s in (self.scenario, after))
        names = now.keys() - {"params", "seed", "start", "goal", "draws"}
        changed = [name for name in sorted(names) if now[name] != before.get(name)]
        parts = [f"{name} {_said(now[name])}, was {_said(before.get(name))}" for name in changed]
        parts += [] if self.seed is None else [f"draws from seed {self.seed}"]
        return "; ".join(parts) or "all as before"

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Read what `dataclasses.asdict` made of one.

        Raises:
            KeyError: A field is missing.
            TypeError: There is one too many.
            ValueError: A number is none, or below 0.
        """
        known = {**values, "scenario": Scenario.parse(values["scenario"])}
        known |= {name: int(values[name]) for name in ("iteration", "events")}
        if min(known["iteration"], known["events"]) < 0:
            raise ValueError("a branch before the beginning")
        return cls(**known)


def _json(text: str) -> Any:
    """Read JSON as it is defined, which knows no NaN and no infinity: no setting is either."""
    return json.loads(text, parse_constant=_refused)


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def _scenario(text: str) -> Scenario:
    """Read a scenario that names what was run: what is missing would be taken for the usual."""
    values = _json(text)
    scenario = Scenario.parse(values)
    for name in ("world", "planner"):
        if name not in values:
            raise BrrtError(f"the manifest is damaged: its scenario has no {name}")
    return scenario


def _said(value: Any) -> str:
    """Write a setting; where it is not given, the run decides."""
    if isinstance(value, bool):
        return str(value).lower()
    return "auto" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a recording says about the run that made it, written before the first event.

    Attributes:
        scenario: The scenario.
        start: First configuration, as resolved.
        goal: Last configuration, as resolved.
        dim: 2 or 3, the world's dimension.
        dof: Numbers in a configuration.
        epoch_ns: Wall clock (ns since 1970) at time 0 of the events.
        made_by: Versions of brrt and of what it stands on, and the platform.
        robot: The robot's definition in JSON, settled in the world; None in recordings that were
            made before there were robots to define.
        branches: Where the settings changed, in order, for a run that goes on from a recorded one;
            the scenario is what rules from the last of them on.
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

    FORMAT, BRANCHED = "1", "2"
    """A run that changed its settings on the way is of a format of its own: who does not know of
    that would hold all of it to the last settings."""

    @property
    def stretches(self) -> tuple[tuple[int, Scenario], ...]:
        """The number of the event that each scenario rules from, and the scenario, in order."""
        firsts = (0, *(branch.events for branch in self.branches))
        scenarios = (*(branch.scenario for branch in self.branches), self.scenario)
        return tuple(zip(firsts, scenarios, strict=True))

    @property
    def origins(self) -> tuple[str, ...]:
        """From what the run went on, where, and what changed there; for each branch, in order."""
        after = (scenario for _, scenario in self.stretches[1:])
        return tuple(
            f"{branch.origin}: {branch.told(scenario)}"
            for branch, scenario in zip(self.branches, after, strict=True)
        )

    def ruling(self, iteration: int) -> Self:
        """Return what it would be without the branches that came after an iteration."""
        kept = tuple(b for b in self.branches if b.iteration <= iteration)
        later = self.branches[len(kept) :]
        return replace(self, branches=kept, scenario=later[0].scenario if later else self.scenario)

    def digest(self) -> str:
        """Return a name for the run: the same where everything is, the clock included."""
        return hashlib.sha256(json.dumps(self.to_strings()).encode()).hexdigest()

    def make_robot(self) -> Robot:
        """Make the robot that the run was made with, even where its file is gone.

        Raises:
            BrrtError: Its definition is damaged.
        """
        return self.scenario.make_robot() if self.robot is None else robot_from_json(self.robot)

    def make_problem(self, world: World) -> Problem:
        """Put the recorded query and robot into the recorded world, even where files are gone.

        Raises:
            BrrtError: The query is of no use in the world, or the robot's definition is damaged.
        """
        query = replace(self.scenario, start=self.start, goal=self.goal)
        return query.make_problem(world, self.make_robot())

    def to_strings(self) -> dict[str, str]:
        """One text a field, as MCAP metadata takes them; everything but plain texts as JSON."""
        texts = {} if self.robot is None else {"robot": self.robot}
        if self.branches:
            texts["branches"] = json.dumps([asdict(branch) for branch in self.branches])
        return texts | {
            "format": self.BRANCHED if self.branches else self.FORMAT,
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
        if texts.get("format") not in (cls.FORMAT, cls.BRANCHED):
            raise BrrtError(
                f"recording format {texts.get('format')!r} is not {cls.FORMAT!r}; update brrt"
            )
        try:
            return cls(
                _scenario(texts["scenario"]),
                tuple(map(float, _json(texts["start"]))),
                tuple(map(float, _json(texts["goal"]))),
                int(texts["dim"]),
                int(texts["dof"]),
                int(texts["epoch_ns"]),
                dict(_json(texts["made_by"])),
                texts.get("robot"),
                tuple(map(Branch.parse, _json(texts.get("branches", "[]")))),
            )
        except KeyError as error:
            raise BrrtError(f"the manifest is damaged: it has no {error}") from None
        except (ValueError, TypeError, RecursionError) as error:
            raise BrrtError(f"the manifest is damaged: {error!r}") from None
