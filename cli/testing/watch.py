"""The hooks that follow a session: what was collected, what ran, what is left over.

A claim that a golden file is unused needs all tests that could use it. Whatever keeps one from
running to its end, be it -k, --lf, a skip, a failure, a worker's crash, leaves it unsettled, and
then nothing is claimed of its folder.

PYTEST_DONT_REWRITE
"""

import os
from collections.abc import Generator, Iterable
from fnmatch import fnmatch
from typing import Any

import pytest

from .ledger import Ledger

LEDGER = pytest.StashKey[Ledger]()

FIXTURES = frozenset({"brrt_golden", "brrt_gate"})

_OUTPUT = "brrt"


class Watch:
    """Keeps the ledger of a session.

    Args:
        config: The session's.
    """

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._ledger = config, config.stash[LEDGER]
        self._unused: list[str] = []

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Note a test."""
        uses = not FIXTURES.isdisjoint(getattr(item, "fixturenames", ()))
        self._ledger.tests[item.nodeid] = (str(item.path), uses)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that was collected, and what could not be."""
        if report.failed:
            self._ledger.broken = True
        elif report.passed and "::" not in report.nodeid:
            self._ledger.files.add(str(self._config.rootpath / report.nodeid))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Fail a test that renewed files, once all of it has run."""
        result = yield
        renewed = self._ledger.renewed.get(item.nodeid)
        if renewed:
            pytest.fail("\n".join(renewed), pytrace=False)
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what became of a test; one that was skipped may have used more elsewhere."""
        node = report.nodeid
        uses = self._ledger.tests.get(node, ("", False))[1]
        if report.failed:
            self._ledger.failed.add(node)
        ended = report.when == "call" or (report.when == "setup" and not report.passed)
        if ended and (not uses or (report.when == "call" and report.passed)):
            self._ledger.settled.add(node)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Add up a worker of pytest-xdist; one that crashed sends nothing, and settles nothing."""
        self._ledger.add(getattr(node, "workeroutput", {}).get(_OUTPUT, {}))

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Find what is unused; a worker hands over its ledger."""
        if hasattr(self._config, "workeroutput"):
            self._config.workeroutput[_OUTPUT] = self._ledger.dump()
            return
        # `--lf` leaves out tests before anybody hears of them.
        if self._ledger.concerned and not self._config.getoption("lf", False):
            self._unused = self._ledger.unused(self._whole)
        if self._unused and self._strict and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Tell what was renewed, and what is unused."""
        renewed = [line for lines in self._ledger.renewed.values() for line in lines]
        if not renewed and not self._unused:
            return
        terminalreporter.section("brrt")
        for line in renewed:
            terminalreporter.line(line.partition("\n")[0])
        colour = {"red": True} if self._strict else {"yellow": True}
        for path in self._unused:
            name = os.path.relpath(path, self._config.invocation_params.dir)
            terminalreporter.line(f"{name}: no test uses it; delete it", **colour)

    @property
    def _strict(self) -> bool:
        chosen = self._config.getoption("brrt_unused") or self._config.getini("brrt_unused")
        return bool(chosen == "fail")

    def _whole(self, folder: str, files: Iterable[str]) -> bool:
        """Whether all test files that could use a folder were asked for, as a whole, and read."""
        if self._ledger.folder:
            here = self._config.rootpath
            roots = [str(here / each) for each in self._config.getini("testpaths")] or [str(here)]
            left_out = any(self._config.getoption(name, None) for name in ("ignore", "ignore_glob"))
            return not left_out and all(map(self._asked_for, roots))
        patterns = self._config.getini("python_files")
        beside = os.path.dirname(folder)
        expected = {
            os.path.join(beside, name)
            for name in os.listdir(beside)
            if any(fnmatch(name, pattern.rpartition("/")[2]) for pattern in patterns)
        }
        return expected <= set(files) and all(map(self._asked_for, expected))

    def _asked_for(self, path: str) -> bool:
        """Whether a path, or a folder above it, was given to pytest as a whole."""
        here = str(self._config.invocation_params.dir)
        given = [os.path.normpath(os.path.join(here, arg)) for arg in self._config.args]
        return any(path == each or path.startswith(each.rstrip(os.sep) + os.sep) for each in given)
