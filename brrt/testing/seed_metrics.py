"""The metrics of one scenario for many seeds, and the JSON file that stores them."""

import inspect
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from brrt.errors import BrrtError
from brrt.files import make_folder_of, parse_json, read_text, replacing
from brrt.recording import Recording
from brrt.replay.metrics import Metrics, metrics
from brrt.runs.run import Run
from brrt.scenario.manifest import made_by
from brrt.scenario.scenario import Scenario

SCHEMA, VERSION = "brrt.figures", 1

PROBLEM = ("world", "robot", "start", "goal", "execute", "max_move")
"""Fields of a scenario that must be equal for metrics to be comparable."""

_MOST_BYTES = 50_000_000

Outcome = Scenario | Run | Recording | Metrics | Mapping[str, Any]
"""What a function of the seed returns: something to run, a recording, or metrics by name."""

Source = Scenario | Callable[[int], Outcome]
"""A scenario, which is run with each seed, or a function of the seed."""


@dataclass(frozen=True, slots=True)
class SeedMetrics:
    """The metrics of a run for each seed.

    Attributes:
        runs: By seed: `solved`, and the metrics that are numbers.
        scenario: The scenario as a mapping, without its seed; None if a function made the runs.
        made_by: Versions and platform.
    """

    runs: Mapping[int, Mapping[str, Any]]
    scenario: Mapping[str, Any] | None
    made_by: Mapping[str, str]

    @classmethod
    def of(cls, source: Source, seeds: int | Iterable[int]) -> Self:
        """Run each seed, one after the other; `seeds` says how many, from 0 on, or which.

        Raises:
            BrrtError: The scenario cannot be run, or the function returned something else.
        """
        numbers = range(seeds) if isinstance(seeds, int | np.integer) else list(seeds)
        scenario = None
        if isinstance(source, Scenario):
            check_repeatable(source)
            scenario = json.loads(json.dumps(source.as_dict()))
            del scenario["seed"], scenario["clock"]
        elif not _takes_seed(source):
            raise BrrtError(f"give a scenario or a function of the seed, not {source!r}")
        return cls({seed: _run(source, seed) for seed in numbers}, scenario, made_by())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises:
            BrrtError: The file cannot be read or is something else.
        """
        text = read_text(path, "a file of metrics", _MOST_BYTES)
        try:
            found = parse_json(text, "a file of metrics")
            if found["schema"] != SCHEMA or found["version"] != VERSION:
                raise BrrtError(f"not {SCHEMA} of version {VERSION}")  # noqa: TRY301
            runs = {int(seed): _comparable(seed, run) for seed, run in found["runs"].items()}
            return cls(runs, found["scenario"], found["made_by"])
        except BrrtError as error:
            raise BrrtError(f"{path}: {error}") from None
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise BrrtError(f"{path}: not a file of metrics: {error!r}") from None

    def save(self, path: Path) -> None:
        """Write one line for each seed, so that versions of the file can be compared line by line.

        Raises:
            BrrtError: The file cannot be written.
        """
        head = {"schema": SCHEMA, "version": VERSION}
        head |= {"made_by": self.made_by, "scenario": self.scenario}
        lines = [f" {json.dumps(k)}: {json.dumps(v)}," for k, v in head.items()]
        runs = ",\n".join(f'  "{seed}": {json.dumps(run)}' for seed, run in self.runs.items())
        text = "\n".join(["{", *lines, ' "runs": {', runs, " }", "}", ""])
        make_folder_of(path)
        with replacing(path) as unfinished:
            unfinished.write_text(text, "utf-8")

    def contains(self, other: Self) -> bool:
        """Whether all metrics of `other` are here, equal to the last bit."""
        equal = self.of_seeds(other.runs).runs == other.runs
        return equal and self.scenario == other.scenario

    def of_seeds(self, seeds: Iterable[int]) -> Self:
        """Return the metrics of some seeds, as far as they are here."""
        return replace(self, runs={seed: self.runs[seed] for seed in seeds if seed in self.runs})


def check_repeatable(scenario: Scenario) -> None:
    """Raise unless a scenario gives the same run each time: its budget must not be a time."""
    if scenario.time is not None:
        raise BrrtError(
            "a scenario with a time limit ends differently in each run; give iterations instead"
        )


def _takes_seed(source: Any) -> bool:
    try:
        inspect.signature(source).bind(0)
    except TypeError:
        return False
    except ValueError:  # a compiled function has no signature
        return callable(source)
    return True


def _run(source: Source, seed: int) -> Mapping[str, Any]:
    found = replace(source, seed=seed) if isinstance(source, Scenario) else source(seed)
    if isinstance(found, Scenario):
        found = Run(found)
    if isinstance(found, Run):
        found = found.execute()
    if isinstance(found, Recording):
        found = metrics(found)
    if isinstance(found, Metrics):
        found = found.as_dict()
    if not isinstance(found, Mapping):
        raise BrrtError(
            f"seed {seed}: give a Scenario, a Run, a Recording or metrics by name, not {found!r}"
        )
    return _comparable(f"seed {seed}", found)


def _comparable(where: str, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return `solved` and the numbers that do not depend on the machine, which are finite."""
    kept: dict[str, Any] = {"solved": found.get("solved", True) is True}
    if "path_cost" in found and "cost" not in found:
        smoothed = found.get("smoothed_cost")
        found = {"cost": found["path_cost"] if smoothed is None else smoothed, **found}
    for name, value in found.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or name in ("seed", "solved") or name.endswith("_s"):
            continue
        kept[name] = value
        if not 0 <= value < math.inf:
            raise BrrtError(f"{where}: {name} must be a number from 0 on, or None, not {value!r}")
    return kept
