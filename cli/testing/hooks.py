"""Pytest hooks that record which golden files a session uses.

A golden file is reported as unused only if all tests that could use it ran to their end. A test
that did not, because of -k, --lf, a skip, a failure or a worker's crash, is not complete, and no
file of its folder is reported.

PYTEST_DONT_REWRITE
"""

import os
from collections.abc import Generator, Iterable
from fnmatch import fnmatch
from typing import Any

import pytest

from .usage import GoldenUsage

USAGE = pytest.StashKey[GoldenUsage]()

FIXTURES = frozenset({"brrt_golden", "brrt_gate"})

_OUTPUT = "brrt"


class SessionHooks:
    """The hooks of a session."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._usage = config, config.stash[USAGE]
        self._unused: list[str] = []

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Record a test."""
        uses = not FIXTURES.isdisjoint(getattr(item, "fixturenames", ()))
        self._usage.tests[item.nodeid] = (str(item.path), uses)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Record a collected file, or that collecting failed."""
        if report.failed:
            self._usage.broken = True
        elif report.passed and "::" not in report.nodeid:
            self._usage.files.add(str(self._config.rootpath / report.nodeid))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Fail a test that renewed files, after all of it has run."""
        result = yield
        renewed = self._usage.renewed.get(item.nodeid)
        if renewed:
            pytest.fail("\n".join(renewed), pytrace=False)
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record whether a test failed or is complete; a skipped test may use more elsewhere."""
        node = report.nodeid
        uses = self._usage.tests.get(node, ("", False))[1]
        if report.failed:
            self._usage.failed.add(node)
        ended = report.when == "call" or (report.when == "setup" and not report.passed)
        if ended and (not uses or (report.when == "call" and report.passed)):
            self._usage.completed.add(node)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Add the usage of a worker of pytest-xdist; one that crashed sends nothing."""
        self._usage.add(getattr(node, "workeroutput", {}).get(_OUTPUT, {}))

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Find unused files; a worker sends its usage instead."""
        if hasattr(self._config, "workeroutput"):
            self._config.workeroutput[_OUTPUT] = self._usage.dump()
            return
        # `--lf` removes tests before they are collected.
        if self._usage.any_test and not self._config.getoption("lf", False):
            self._unused = self._usage.unused(self._is_complete)
        if self._unused and self._strict and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Print what was renewed and what is unused."""
        renewed = [line for lines in self._usage.renewed.values() for line in lines]
        if not renewed and not self._unused:
            return
        from brrt.text import visible

        terminalreporter.section("brrt")
        for line in renewed:
            terminalreporter.line(line.partition("\n")[0])
        colour = {"red": True} if self._strict else {"yellow": True}
        for path in self._unused:
            name = visible(os.path.relpath(path, self._config.invocation_params.dir))
            terminalreporter.line(f"{name}: no test uses it; delete it", **colour)

    @property
    def _strict(self) -> bool:
        chosen = self._config.getoption("brrt_unused") or self._config.getini("brrt_unused")
        return bool(chosen == "fail")

    def _is_complete(self, folder: str, files: Iterable[str]) -> bool:
        """Whether all test files that could use a folder were requested and collected."""
        if self._usage.folder:
            here = self._config.rootpath
            roots = [str(here / each) for each in self._config.getini("testpaths")] or [str(here)]
            ignoring = any(self._config.getoption(name, None) for name in ("ignore", "ignore_glob"))
            return not ignoring and all(map(self._is_requested, roots))
        patterns = self._config.getini("python_files")
        beside = os.path.dirname(folder)
        expected = {
            os.path.join(beside, name)
            for name in os.listdir(beside)
            if any(fnmatch(name, pattern.rpartition("/")[2]) for pattern in patterns)
        }
        return expected <= set(files) and all(map(self._is_requested, expected))

    def _is_requested(self, path: str) -> bool:
        """Whether a path, or a folder above it, is an argument of pytest."""
        here = str(self._config.invocation_params.dir)
        given = [os.path.normpath(os.path.join(here, arg)) for arg in self._config.args]
        return any(path == each or path.startswith(each.rstrip(os.sep) + os.sep) for each in given)
