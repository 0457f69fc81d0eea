"""What the fixtures hand to a test.

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
from brrt.testing import golden
from brrt.testing.figures import Figures, Source
from brrt.testing.gate import ALPHA, SEEDS, Verdict, check_question, gate

from .watch import LEDGER

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=,-]*")

_UPDATE = "pytest --brrt-update"


class _Files:
    """The golden files of a test.

    Args:
        request: The test's.
    """

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._config, self._node = request.config, request.node.nodeid
        self._ledger = request.config.stash[LEDGER]
        self._folder = self._ledger.folder_of(str(request.path))
        self.update = bool(self._config.getoption("brrt_update"))

    def path(self, name: str, ending: str) -> Path:
        """Return a golden file's path, and note that it is used."""
        if not isinstance(name, str):
            raise BrrtError(f"give the name of the golden file first, and not {name!r:.60}")
        stem = name.removesuffix(ending)
        if not _NAME.fullmatch(stem):
            raise BrrtError(f"name {name!r}: give letters, digits and -_.+=, for a file's name")
        return self.note(Path(self._folder, stem + ending))

    def note(self, path: Path) -> Path:
        """Note that a file is used."""
        self._ledger.used.add(os.path.abspath(path))  # noqa: PTH100 - links stay as they are
        return path

    def renewed(self, told: str) -> None:
        """Note what was renewed; the test fails at its end."""
        self._ledger.renewed.setdefault(self._node, []).append(told)

    def told(self, path: Path) -> str:
        """Name a file as the user can paste it."""
        return os.path.relpath(path, self._config.invocation_params.dir)

    def failed(self, path: Path) -> Path:
        """Return where a run is kept that is not what the golden one was; the tree is the same."""
        chosen = self._config.getoption("brrt_failed")
        folder: Path
        if chosen:
            folder = self._config.invocation_params.dir / chosen
        elif hasattr(self._config, "cache"):
            folder = Path(self._config.cache.mkdir("brrt-failed"))
        else:
            folder = self._config.rootpath / ".brrt-failed"
        inside = Path(os.path.relpath(path, self._config.rootpath))
        return folder / (path.name if ".." in inside.parts else inside)


def _headline(found: Comparison) -> str:
    """Say in a few words what differs; pytest's summary has room for no more."""
    first = found.first
    return "other settings" if first is None else f"another run from event {first.seq} on"


def _fail(kept: Path, told: str) -> NoReturn:
    """Fail the test; the message is kept as well, beside what was kept of the run."""
    __tracebackhide__ = True
    kept.with_suffix(".txt").write_text(told + "\n", "utf-8")
    pytest.fail(told, pytrace=False)


@contextmanager
def _failing() -> Iterator[None]:
    """Fail the test by one line where the input is bad."""
    try:
        yield
    except BrrtError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


class Golden:
    """Holds runs against golden ones, event by event; see `Golden.__call__`."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._files = _Files(request)

    def __call__(
        self, name: str, run: golden.Source | None = None, *, tolerance: float = 0.0
    ) -> Recording:
        """Hold a run against the golden one of a name; return the run.

        Args:
            name: Of the file, without its ending.
            run: A scenario, or the name of a scenario file; a `Run`, with a planner of your own if
                you like; a `Recording`, or the name of a recording, by whatever program. Without
                it the golden run's own scenario is planned anew.
            tolerance: How far apart numbers may be, relative to the greater, and to 1 where both
                are less; by default every bit counts. Times never count.
        """
        __tracebackhide__ = True
        with _failing():
            path = self._files.path(name, ".mcap")
            if run is None and not path.exists():
                raise BrrtError(
                    f"no golden run {self._files.told(path)}; give brrt_golden the run as well, "
                    f"or put one there: brrt plan --clock logical --out {self._files.told(path)}"
                )
            if isinstance(run, str | Path):
                self._files.note(Path(run))
            fresh = golden.fresh(golden.again(path) if run is None else run)
            return self._hold(path, fresh, tolerance)

    def _hold(self, path: Path, fresh: Recording, tolerance: float) -> Recording:
        __tracebackhide__ = True
        files = self._files
        if files.update:
            self._renew(path, fresh, tolerance)
            return fresh
        if not path.exists():
            raise BrrtError(
                f"no golden run {files.told(path)}; make it: {_UPDATE}, look at it, commit it"
            )
        kept = files.failed(path)
        found = self._compare(path, fresh, tolerance, files.told(kept))
        if not found.equal:
            # Told of the files, so that it is what `brrt diff` prints of them.
            golden.save(fresh, kept)
            found = self._compare(path, read(kept), tolerance, files.told(kept))
            lines = [
                _headline(found),
                *found.lines(),
                "",
                *self._rounded(path, fresh, tolerance),
                f"If that is meant: {_UPDATE}, and commit it.",
            ]
            _fail(kept, "\n".join(lines))
        return fresh

    def _rounded(self, path: Path, fresh: Recording, tolerance: float) -> Iterator[str]:
        """Say so where another machine's rounding is all that there is."""
        if tolerance < TOLERANCE and self._compare(path, fresh, TOLERANCE, "the run").equal:
            yield f"Only the rounding differs: tolerance={TOLERANCE:g} lets that pass."

    def _renew(self, path: Path, fresh: Recording, tolerance: float) -> None:
        told = self._files.told(path)
        lines = [f"{told}: made; look at it (brrt view {told}) and commit it"]
        if path.exists():
            try:
                found = self._compare(path, fresh, tolerance, "the run of today")
            except BrrtError as error:
                lines = [f"{told}: renewed, since it could not be read ({error})"]
            else:
                if found.equal:
                    return
                lines = [f"{told}: renewed; look at what changed and commit it", *found.lines()]
        golden.save(fresh, path)
        self._files.renewed("\n".join(lines))

    def _compare(self, path: Path, fresh: Recording, tolerance: float, name: str) -> Comparison:
        kept = read(path)
        return compare(kept, fresh, names=(self._files.told(path), name), tolerance=tolerance)


class Gate:
    """Holds figures over many seeds against stored ones; see `Gate.__call__`."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._files = _Files(request)

    def __call__(
        self,
        run: Source,
        *,
        against: str | Source | None = None,
        seeds: int | Iterable[int] = SEEDS,
        alpha: float = ALPHA,
        **margins: float,
    ) -> Verdict:
        """Fail where the data prove that a run has become worse by more than the margins.

        Args:
            run: A scenario, or a function that makes a run, or its figures, of a seed.
            against: Name of a golden file of figures, or what to run for comparison.
            seeds: How many, from 0 on, or which.
            alpha: Chance of a false alarm over all figures together.
            margins: For each figure the relative increase that is allowed, as in
                `brrt.testing.gate.gate`.
        """
        __tracebackhide__ = True
        numbers = list(range(seeds)) if isinstance(seeds, int) else list(seeds)

        def judged(new: Source | Figures, old: Source | Figures | Path, name: str) -> Verdict:
            return gate(new, old, seeds=numbers, alpha=alpha, name=name, **margins)

        with _failing():
            check_question(numbers, alpha, margins)
            if against is None:
                raise BrrtError(
                    "say what to hold it against: the name of a golden file (against='forest', "
                    f"made by {_UPDATE}), or what to run"
                )
            if isinstance(against, str):
                path = self._files.path(against, ".json")
                return self._against(path, Figures.of(run, numbers), judged)
            verdict = judged(run, against, "gate")
        if not verdict.passed:
            pytest.fail("\n".join(verdict.lines()), pytrace=False)
        return verdict

    def _against(self, path: Path, new: Figures, judged: Callable[..., Verdict]) -> Verdict:
        """Judge figures against stored ones, after these were renewed if that is what is wanted."""
        __tracebackhide__ = True
        told = self._files.told(path)
        if self._files.update:
            same = judged(new, new, told)
            self._renew(path, new, judged)
            return same
        if not path.exists():
            raise BrrtError(f"no golden figures {told}; make them: {_UPDATE}, and commit them")
        verdict = judged(new, path, told)
        if not verdict.passed:
            kept = self._files.failed(path)
            new.save(kept)
            _fail(
                kept, "\n".join([*verdict.lines(), f"If that is meant: {_UPDATE}, and commit it."])
            )
        return verdict

    def _renew(self, path: Path, new: Figures, judged: Callable[..., Verdict]) -> None:
        told = self._files.told(path)
        lines = [f"{told}: made; commit it"]
        if path.exists():
            try:
                if Figures.load(path).holds(new):
                    return
                lines = judged(new, path, f"{told}: renewed; by the old ones").lines()
            except BrrtError as error:
                lines = [f"{told}: renewed, since it could not be compared with ({error})"]
        new.save(path)
        self._files.renewed("\n".join(lines))
