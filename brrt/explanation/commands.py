"""Advice: what to try, as a command and as what that command plans."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import Any

from brrt.explanation.diagnosis import ended_by_budget
from brrt.explanation.facts import Facts
from brrt.explanation.report import WIDTH
from brrt.scenario.command import plan_words, setting_words
from brrt.scenario.scenario import Scenario
from brrt.shell import file_word, join

_PLENTY = 1_000_000
"""Iterations beyond which a budget is increased fourfold at most."""

_LITTLE = 20_000
"""Iterations that take so little time that smaller budgets are not advised."""

_UNNAMED = "RUN"
"""The file of a run in memory, in commands."""


@dataclass(frozen=True, slots=True)
class Advice:
    """Something to try.

    Attributes:
        why: The facts that it follows from.
        words: The command, without its output.
        suffix: Suffix of the file that the command writes; empty if it only prints.
        scenario: What the command plans from the start; None if it does not.
        branch: Keyword arguments of `BranchedRun`, if the command continues the recording; None
            if it does not.
        out: The file that the command writes; empty if it only prints.
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
        return join(self._all())

    def numbered(self, number: int, file: str) -> "Advice":
        """Return it with an output of its own, named by the recording and the number."""
        return replace(self, out=file_word(f"{Path(file).stem or 'run'}-{number}{self.suffix}"))

    def as_dict(self) -> dict[str, Any]:
        """Return reason and command."""
        return {"why": self.why, "command": self.command}

    def reason(self, number: int) -> list[str]:
        """Return the reason as lines of 80 columns."""
        return wrap(f"{number}. {self.why}", WIDTH - 1, subsequent_indent="   ")

    def command_lines(self) -> list[str]:
        """Return the command as lines of 80 columns; all but the last end with a backslash."""
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
    """Yield words quoted for a shell, options together with their values."""
    part: list[str] = []
    for word in words:
        if word.startswith("--") and part:
            yield join(part)
            part = []
        part.append(word)
    yield join(part)


def file_of(f: Facts) -> str:
    """Return the recording's file, as it is written in commands."""
    return file_word(f.file or _UNNAMED)


def show(why: str, *words: str, suffix: str = "") -> Advice:
    """Advise a command that plans nothing; `words` follow after `brrt`."""
    return Advice(why, ("brrt", *words), suffix)


def resume(
    f: Facts,
    why: str,
    *,
    iteration: int | None = None,
    params: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Advice:
    """Advise to continue the recording after an iteration, or after planning, with other settings.

    `params` are settings of the planner that change, `settings` fields of the scenario.
    """
    words = ["brrt", "plan", "--from", file_of(f)]
    words += [] if iteration is None else ["--at-iteration", str(iteration)]
    words += setting_words(settings, params or {})
    branch: dict[str, Any] = {"params": dict(params or {}), "settings": settings}
    branch |= {} if iteration is None else {"iteration": iteration}
    return Advice(why, tuple(words), ".mcap", branch=branch)


def replan(
    f: Facts,
    why: str,
    times: float | None = None,
    *,
    planner: str | None = None,
    params: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Advice:
    """Advise to plan from the start with changes; for a branch, from where it branched.

    A budget that ended the run is multiplied by `times`. For another planner, `params` are all
    that is set. `settings` are fields of the scenario that change; None removes a limit.
    """
    if times is not None and ended_by_budget(f):
        settings |= _budget(f, round(times), 1)
    fixed = set(f.contract.planner.fixed_params)
    if f.manifest.branches and planner is None and not fixed & set(params or {}):
        given = {name: value for name, value in settings.items() if value is not None}
        here = f.manifest.branches[-1].iteration
        return resume(f, why, iteration=here, params=params, **given)
    before = f.scenario.params if planner is None else {}
    scenario = replace(
        f.scenario,
        planner=planner or f.scenario.planner,
        params={**before, **(params or {})},
        **settings,
    )
    return Advice(why, tuple(plan_words(scenario)), ".mcap", scenario)


def extend(
    f: Facts, why: str, times: int, least: int = _LITTLE, params: Mapping[str, Any] | None = None
) -> Advice:
    """Advise to continue the recording with a multiple of the budget that ended it.

    At least `least` iterations are advised.
    """
    return resume(f, why, params=params, **_budget(f, times, least))


def _budget(f: Facts, times: int, least: int) -> dict[str, Any]:
    """Return a multiple of the budget that ended the run."""
    if f.figures["status"] == "time limit" and f.scenario.time is not None:
        return {"time": rounded(times * f.scenario.time)}
    done = max(f.figures["iterations"], 1)
    most = min(max(times * done, least), max(4 * done, _PLENTY))
    return {"iterations": round(most, 1 - len(str(most)))}


def rounded(value: float, digits: int = 1) -> float:
    """Round down to so many significant digits."""
    size = float(f"1e{f'{value:e}'.partition('e')[2]}") / 10 ** (digits - 1)
    return float(f"{int(value / size * (1 + 1e-12)) * size:.6g}")
