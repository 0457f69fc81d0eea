"""The objects that the fixtures return.

PYTEST_DONT_REWRITE
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import pytest

from brrt import BrrtError, Comparison, Recording, compare, read
from brrt.runs.reproduce import TOLERANCE
from brrt.shell import file_argument
from brrt.testing import golden
from brrt.testing.gate import ALPHA, SEEDS, Verdict, check_question, gate
from brrt.testing.seed_metrics import SeedMetrics, Source
from brrt.text import visible

from .hooks import USAGE

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=,-]*")

_UPDATE = "pytest --brrt-update"
_INTENDED = f"If this change is intended: {_UPDATE}, and commit it."


class _GoldenFiles:
    """The golden files of a test."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._config, self._node = request.config, request.node.nodeid
        self._usage = request.config.stash[USAGE]
        self._folder = self._usage.folder_of(str(request.path))
        self.update = bool(self._config.getoption("brrt_update"))

    def path(self, name: str, ending: str) -> Path:
        """Return the path of a golden file, and record its use."""
        if not isinstance(name, str):
            raise BrrtError(f"give the name of the golden file first, not {name!r:.60}")
        stem = name.removesuffix(ending)
        if not _NAME.fullmatch(stem):
            raise BrrtError(f"name {name!r}: a file's name has letters, digits and -_.+=, only")
        return self.record_use(Path(self._folder, stem + ending))

    def record_use(self, path: Path) -> Path:
        """Record that a file is used."""
        self._usage.used.add(os.path.abspath(path))  # noqa: PTH100 - resolve() follows links
        return path

    def record_renewal(self, message: str) -> None:
        """Record that a file was made or renewed; the test fails at its end."""
        self._usage.renewed.setdefault(self._node, []).append(visible(message))

    def shown(self, path: Path) -> str:
        """Return a file's name as the user can paste it."""
        return os.path.relpath(path, self._config.invocation_params.dir)

    def failed(self, path: Path) -> Path:
        """Return where a run that differs from a golden file is kept; folders are the same."""
        folder = self._config.rootpath / ".brrt-failed"
        if chosen := self._config.getoption("brrt_failed"):
            folder = self._config.invocation_params.dir / chosen
        elif hasattr(self._config, "cache"):
            folder = Path(self._config.cache.mkdir("brrt-failed"))
        inside = Path(os.path.relpath(path, self._config.rootpath))
        return folder / (path.name if ".." in inside.parts else inside)


def _headline(found: Comparison) -> str:
    """Say in a few words what differs; pytest's summary has no room for more."""
    first = found.first
    return "different settings" if first is None else f"a different run from event {first.seq} on"


def _fail(kept: Path, message: str) -> NoReturn:
    """Fail the test, and write the message beside what is kept of the run."""
    __tracebackhide__ = True
    kept.with_suffix(".txt").write_text(message + "\n", "utf-8", "backslashreplace")
    pytest.fail(visible(message), pytrace=False)


@contextmanager
def _errors_as_failures() -> Iterator[None]:
    """Turn bad input into a failure of one line."""
    try:
        yield
    except BrrtError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


class Golden:
    """Compares runs with golden ones, event by event; see `Golden.__call__`."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._files = _GoldenFiles(request)

    def __call__(
        self, name: str, run: golden.Source | None = None, *, tolerance: float = 0.0
    ) -> Recording:
        """Compare a run with the golden one of a name; return the run.

        Args:
            name: Name of the golden file, without its suffix.
            run: A scenario or the name of a scenario file; a `Run`, which may have a planner of
                your own; a `Recording` or the name of a recording, by any program. By default, the
                golden run's own scenario is planned again.
            tolerance: Allowed difference of numbers, relative to the greater one, and to 1 if both
                are less; by default they must be equal to the last bit. Times are not compared.
        """
        __tracebackhide__ = True
        with _errors_as_failures():
            path = self._files.path(name, ".mcap")
            if run is None and not path.exists():
                shown = self._files.shown(path)
                raise BrrtError(
                    f"no golden run {shown}; give brrt_golden the run as well, or make one: "
                    f"brrt plan --clock logical --out {file_argument(shown)}"
                )
            if isinstance(run, str | Path):
                self._files.record_use(Path(run))
            recording = golden.record(golden.reproduced(path) if run is None else run)
            return self._check(path, recording, tolerance)

    def _check(self, path: Path, recording: Recording, tolerance: float) -> Recording:
        __tracebackhide__ = True
        files = self._files
        if files.update:
            self._renew(path, recording, tolerance)
            return recording
        if not path.exists():
            raise BrrtError(
                f"no golden run {files.shown(path)}; make it: {_UPDATE}, check it, commit it"
            )
        kept = files.failed(path)
        found = self._compare(path, recording, tolerance, files.shown(kept))
        if not found.equal:
            # Compare the files, so that the report is the one that `brrt diff` prints for them.
            golden.save(recording, kept)
            found = self._compare(path, read(kept), tolerance, files.shown(kept))
            rounding = self._rounding_only(path, recording, tolerance)
            _fail(kept, "\n".join([_headline(found), *found.lines(), "", *rounding, _INTENDED]))
        return recording

    def _rounding_only(self, path: Path, recording: Recording, tolerance: float) -> Iterator[str]:
        """Say if another machine's rounding is the only difference."""
        if tolerance < TOLERANCE and self._compare(path, recording, TOLERANCE, "the run").equal:
            yield f"Only the rounding differs: tolerance={TOLERANCE:g} accepts that."

    def _renew(self, path: Path, recording: Recording, tolerance: float) -> None:
        shown = self._files.shown(path)
        lines = [f"{shown}: made; check it (brrt view {file_argument(shown)}) and commit it"]
        if path.exists():
            try:
                found = self._compare(path, recording, tolerance, "the new run")
            except BrrtError as error:
                lines = [f"{shown}: renewed, since it could not be read ({error})"]
            else:
                if found.equal:
                    return
                lines = [f"{shown}: renewed; check what changed and commit it", *found.lines()]
        golden.save(recording, path)
        self._files.record_renewal("\n".join(lines))

    def _compare(self, path: Path, recording: Recording, tolerance: float, name: str) -> Comparison:
        names = (self._files.shown(path), name)
        return compare(read(path), recording, names=names, tolerance=tolerance)


class Gate:
    """Compares metrics over many seeds with stored ones; see `Gate.__call__`."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._files = _GoldenFiles(request)

    def __call__(
        self,
        run: Source,
        *,
        against: str | Source | None = None,
        seeds: int | Iterable[int] = SEEDS,
        alpha: float = ALPHA,
        **margins: float,
    ) -> Verdict:
        """Fail if the data prove that a run has become worse by more than the margins.

        Args:
            run: A scenario, or a function of the seed that returns a run or its metrics.
            against: Name of a golden file of metrics, or what to run for comparison.
            seeds: How many, from 0 on, or which.
            alpha: Probability of a false alarm over all metrics together.
            margins: For each metric the relative increase that is allowed, as in `brrt.gate`.
        """
        __tracebackhide__ = True
        numbers = list(range(seeds)) if isinstance(seeds, int) else list(seeds)

        def judge(
            new: Source | SeedMetrics, old: Source | SeedMetrics | Path, name: str
        ) -> Verdict:
            return gate(new, old, seeds=numbers, alpha=alpha, name=name, **margins)

        with _errors_as_failures():
            check_question(numbers, alpha, margins)
            if against is None:
                raise BrrtError(
                    "give `against`: the name of a golden file (against='forest', made by "
                    f"{_UPDATE}), or what to run for comparison"
                )
            if isinstance(against, str):
                path = self._files.path(against, ".json")
                return self._check(path, SeedMetrics.of(run, numbers), judge)
            verdict = judge(run, against, "gate")
        if not verdict.passed:
            pytest.fail(visible("\n".join(verdict.lines())), pytrace=False)
        return verdict

    def _check(self, path: Path, new: SeedMetrics, judge: Callable[..., Verdict]) -> Verdict:
        """Judge metrics against stored ones, or renew these if that was requested."""
        __tracebackhide__ = True
        shown = self._files.shown(path)
        if self._files.update:
            verdict = judge(new, new, shown)
            self._renew(path, new, judge)
            return verdict
        if not path.exists():
            raise BrrtError(f"no golden metrics {shown}; make them: {_UPDATE}, and commit them")
        verdict = judge(new, path, shown)
        if not verdict.passed:
            kept = self._files.failed(path)
            new.save(kept)
            _fail(kept, "\n".join([*verdict.lines(), _INTENDED]))
        return verdict

    def _renew(self, path: Path, new: SeedMetrics, judge: Callable[..., Verdict]) -> None:
        shown = self._files.shown(path)
        lines = [f"{shown}: made; commit it"]
        if path.exists():
            try:
                if SeedMetrics.load(path).contains(new):
                    return
                lines = judge(new, path, f"{shown}: renewed; against the old ones").lines()
            except BrrtError as error:
                lines = [f"{shown}: renewed, since it could not be compared ({error})"]
        new.save(path)
        self._files.record_renewal("\n".join(lines))
