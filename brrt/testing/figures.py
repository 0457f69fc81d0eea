"""Figures of one scenario over many seeds, and the file that keeps them."""

import inspect
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from brrt.errors import BrrtError
from brrt.files import read_text, replacing
from brrt.replay.metrics import Metrics
from brrt.runs.run import Run, made_by
from brrt.scenario.scenario import Scenario

SCHEMA, VERSION = "brrt.figures", 1

PROBLEM = ("world", "robot", "start", "goal", "execute", "max_move")
"""What two scenarios share whose figures can be compared."""

_MOST_BYTES = 50_000_000

Outcome = Scenario | Run | Metrics | Mapping[str, Any]
"""What becomes of a seed: something to run, or a run's figures under the names of `Metrics`."""

Source = Scenario | Callable[[int], Outcome]
"""A scenario, which is given each seed, or a function of the seed."""


@dataclass(frozen=True, slots=True)
class Figures:
    """The figures of a run for each seed.

    Attributes:
        runs: By seed: `solved`, and the numbers that the run has.
        scenario: Names and values of the scenario, without its seed; None where a function made
            the runs.
        made_by: Versions and platform.
    """

    runs: Mapping[int, Mapping[str, Any]]
    scenario: Mapping[str, Any] | None
    made_by: Mapping[str, str]

    @classmethod
    def of(cls, source: Source, seeds: int | Iterable[int]) -> Self:
        """Run each seed, one after the other.

        Args:
            source: What to run.
            seeds: How many, from 0 on, or which.

        Raises:
            BrrtError: The scenario is of no use, or what the function returned is not.
        """
        numbers = range(seeds) if isinstance(seeds, int) else list(seeds)
        told = None
        if isinstance(source, Scenario):
            if source.time is not None:
                raise BrrtError("a budget of time ends each run elsewhere; give iterations instead")
            told = json.loads(json.dumps(source.as_dict()))
            del told["seed"], told["clock"]
        elif not _takes_seed(source):
            raise BrrtError(f"give a scenario or a function of the seed, not {source!r}")
        return cls({seed: _run(source, seed) for seed in numbers}, told, made_by())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises:
            BrrtError: The file cannot be read, or is something else.
        """
        try:
            found = json.loads(read_text(path, "figures", _MOST_BYTES))
            if found["schema"] != SCHEMA or found["version"] != VERSION:
                raise BrrtError(f"{path}: not {SCHEMA} of version {VERSION}")
            runs = {
                int(seed): _checked(f"{path}: {seed}", run) for seed, run in found["runs"].items()
            }
            return cls(runs, found["scenario"], found["made_by"])
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise BrrtError(f"{path}: not figures that brrt wrote: {error!r}") from None

    def save(self, path: Path) -> None:
        """Write them, a line a seed, so that two versions are compared line by line.

        Raises:
            BrrtError: The file cannot be written.
        """
        head = {"schema": SCHEMA, "version": VERSION}
        head |= {"made_by": self.made_by, "scenario": self.scenario}
        lines = [f" {json.dumps(k)}: {json.dumps(v)}," for k, v in head.items()]
        runs = ",\n".join(f'  "{seed}": {json.dumps(run)}' for seed, run in self.runs.items())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BrrtError(f"cannot write {path}: {error.strerror or error}") from None
        with replacing(path) as unfinished:
            unfinished.write_text(
                "\n".join(["{", *lines, ' "runs": {', runs, " }", "}", ""]), "utf-8"
            )

    def holds(self, other: Self) -> bool:
        """Whether all of the other's figures are here, the same to the last bit."""
        same = self.of_seeds(other.runs).runs == other.runs
        return same and self.scenario == other.scenario

    def of_seeds(self, seeds: Iterable[int]) -> Self:
        """Return those of some seeds; of seeds that are not there, none."""
        return replace(self, runs={seed: self.runs[seed] for seed in seeds if seed in self.runs})


def _takes_seed(source: Any) -> bool:
    try:
        inspect.signature(source).bind(0)
    except TypeError:
        return False
    except ValueError:  # compiled, and so without a signature
        return callable(source)
    return True


def _run(source: Source, seed: int) -> Mapping[str, Any]:
    found = replace(source, seed=seed) if isinstance(source, Scenario) else source(seed)
    if isinstance(found, Scenario):
        found = Run(found)
    if isinstance(found, Run):
        found = found.execute()
    if isinstance(found, Metrics):
        found = found.as_dict()
    if not isinstance(found, Mapping):
        raise BrrtError(
            f"seed {seed}: give a Scenario, a Run or its figures by name, not {found!r}"
        )
    return _checked(f"seed {seed}", found)


def _checked(where: str, figures: Mapping[str, Any]) -> dict[str, Any]:
    """Keep what can be compared: numbers that do not depend on the machine.

    Raises:
        BrrtError: One is not a number of at least 0.
    """
    kept: dict[str, Any] = {"solved": figures.get("solved", True) is True}
    if "path_cost" in figures and "cost" not in figures:
        smoothed = figures.get("smoothed_cost")
        figures = {"cost": figures["path_cost"] if smoothed is None else smoothed, **figures}
    for name, value in figures.items():
        if name in ("seed", "solved") or name.endswith("_s"):
            continue
        if isinstance(value, int | float) and not isinstance(value, bool):
            kept[name] = value
    for name, value in kept.items():
        if not 0 <= value < math.inf:
            raise BrrtError(f"{where}: {name} must be a number from 0 on, or None, not {value!r}")
    return kept
