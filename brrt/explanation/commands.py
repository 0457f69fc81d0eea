"""A piece of advice: what to try, as a command to paste and as what it plans."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import Any

from brrt.explanation.diagnosis import limited
from brrt.explanation.facts import Facts
from brrt.explanation.report import WIDTH
from brrt.scenario.command import plan_words, setting_words
from brrt.scenario.scenario import Scenario

_PLENTY = 1_000_000
"""Iterations beyond which a run is advised no more than four times as many."""

_LITTLE = 20_000
"""Iterations that take so little time that fewer are not worth advising."""

_UNNAMED = "RUN"
"""Stands in commands for a recording that is in no file."""


@dataclass(frozen=True, slots=True)
class Advice:
    """Something to try.

    Attributes:
        why: The figures that it follows from.
        words: The command that tries it, but for where it writes.
        suffix: Of the file that it writes; empty where it only prints.
        scenario: What it plans from the start; None where it does not.
        branch: What `BranchedRun` takes, where it goes on from the recording; None where it
            does not.
        out: The file that it writes; empty where it only prints.
    """

    why: str
    words: tuple[str, ...]
    suffix: str = ""
    scenario: Scenario | None = None
    branch: Mapping[str, Any] | None = None
    out: str = ""

    @property
    def command(self) -> str:
        """The command, in one line."""
        return shlex.join(self._all())

    def numbered(self, number: int, file: str) -> "Advice":
        """Return the same with a file to write: each advice on each recording has its own."""
        return replace(self, out=f"{Path(file).stem or 'run'}-{number}{self.suffix}")

    def as_dict(self) -> dict[str, Any]:
        """Return what a person reads."""
        return {"why": self.why, "command": self.command}

    def reason(self, number: int) -> list[str]:
        """Write why, for a screen of 80 columns."""
        return wrap(f"{number}. {self.why}", WIDTH - 1, subsequent_indent="   ")

    def typed(self) -> list[str]:
        """Write the command for a screen of 80 columns; lines that go on end with a backslash."""
        lines = ["  "]
        for part in _parts(self._all()):
            if len(lines[-1]) + len(part) > WIDTH - 3 and lines[-1].strip():
                lines[-1] += " \\"
                lines.append("    ")
            lines[-1] += " " + part
        return lines

    def _all(self) -> list[str]:
        return [*self.words, *(["--out", self.out] if self.suffix else [])]


def _parts(words: Sequence[str]) -> Iterator[str]:
    """Yield words as a shell takes them, options together with their values."""
    part: list[str] = []
    for word in words:
        if word.startswith("--") and part:
            yield shlex.join(part)
            part = []
        part.append(word)
    yield shlex.join(part)


def look(why: str, *words: str, suffix: str = "") -> Advice:
    """Advise to look at something.

    Args:
        why: What the advice follows from.
        words: What is typed behind `brrt`.
        suffix: Of the file that this writes.
    """
    return Advice(why, ("brrt", *words), suffix)


def go_on(
    f: Facts,
    why: str,
    *,
    iteration: int | None = None,
    params: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Advice:
    """Advise to go on from the recording with other settings.

    Args:
        f: What is known.
        why: What the advice follows from.
        iteration: Where it goes on; by default where planning ended.
        params: Settings of the planner that are changed.
        settings: Fields of the scenario that are.
    """
    words = ["brrt", "plan", "--from", recording(f)]
    words += [] if iteration is None else ["--at-iteration", str(iteration)]
    words += setting_words(settings, params or {})
    branch: dict[str, Any] = {"params": dict(params or {}), "settings": settings}
    branch |= {} if iteration is None else {"iteration": iteration}
    return Advice(why, tuple(words), ".mcap", branch=branch)


def change(
    f: Facts,
    why: str,
    *,
    planner: str | None = None,
    params: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Advice:
    """Advise to run the same with changes; of a run that is a branch, from where it branched off.

    Args:
        f: What is known.
        why: What the advice follows from.
        planner: Another planner; `params` are then all that is set.
        params: Settings of the planner that are changed.
        settings: Other fields of the scenario; None takes a limit away.
    """
    fixed = set(f.contract.planner.fixed_params)
    if f.manifest.branches and planner is None and not fixed & set(params or {}):
        given = {name: value for name, value in settings.items() if value is not None}
        here = f.manifest.branches[-1].iteration
        return go_on(f, why, iteration=here, params=params, **given)
    before = f.scenario.params if planner is None else {}
    scenario = replace(
        f.scenario,
        planner=planner or f.scenario.planner,
        params={**before, **(params or {})},
        **settings,
    )
    return Advice(why, tuple(plan_words(scenario)), ".mcap", scenario)


def recording(f: Facts) -> str:
    """Return what stands for the recording in a command."""
    return f.file or _UNNAMED


def further(
    f: Facts, why: str, times: int, least: int = _LITTLE, params: Mapping[str, Any] | None = None
) -> Advice:
    """Advise a budget that is so many times as large, of the kind that ended the run.

    Args:
        f: What is known.
        why: What the advice follows from.
        times: How many times.
        least: Iterations that are worth a try in any case.
        params: Settings of the planner that are changed.
    """
    return go_on(f, why, params=params, **_budget(f, times, least))


def anew(
    f: Facts,
    why: str,
    times: float = 4,
    *,
    planner: str | None = None,
    params: Mapping[str, Any] | None = None,
) -> Advice:
    """Advise to run the same with changes, and with a larger budget where it was used up.

    Args:
        f: What is known.
        why: What the advice follows from.
        times: How many times as large.
        planner: Another planner; `params` are then all that is set.
        params: Settings of the planner that are changed.
    """
    more = _budget(f, round(times), 1) if limited(f) else {}
    return change(f, why, planner=planner, params=params, **more)


def _budget(f: Facts, times: int, least: int) -> dict[str, Any]:
    """Return a budget that is so many times as large, of the kind that ended the run."""
    if f.figures["status"] == "time limit" and f.scenario.time is not None:
        return {"time": rounded(times * f.scenario.time)}
    done = max(f.figures["iterations"], 1)
    most = min(max(times * done, least), max(4 * done, _PLENTY))
    return {"iterations": round(most, 1 - len(str(most)))}


def rounded(value: float, digits: int = 1) -> float:
    """Round down to a number of digits, as a rule to one."""
    size = float(f"1e{f'{value:e}'.partition('e')[2]}") / 10 ** (digits - 1)
    return float(f"{int(value / size * (1 + 1e-12)) * size:.6g}")
