"""Which golden files a session used, and which of them no test uses any more.

PYTEST_DONT_REWRITE
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

ENDINGS = (".mcap", ".json")


@dataclass(slots=True)
class GoldenUsage:
    """What a session did with golden files; the usage of xdist's workers is added up.

    Attributes:
        folder: Folder of all golden files; empty if each test file has its own beside it.
        tests: By node id: the test file, and whether the test uses one of the fixtures.
        files: Test files that were collected without an error.
        completed: Tests that did everything they would do.
        failed: Tests that failed in any phase.
        used: Golden files that were compared, made or read.
        renewed: By node id, what was made or renewed.
        broken: Whether something could not be collected.
    """

    folder: str
    tests: dict[str, tuple[str, bool]] = field(default_factory=dict)
    files: set[str] = field(default_factory=set)
    completed: set[str] = field(default_factory=set)
    failed: set[str] = field(default_factory=set)
    used: set[str] = field(default_factory=set)
    renewed: dict[str, list[str]] = field(default_factory=dict)
    broken: bool = False

    def folder_of(self, file: str) -> str:
        """Return the folder of a test file's golden files."""
        return self.folder or os.path.join(os.path.dirname(file), "golden")

    @property
    def any_test(self) -> bool:
        """Whether any test uses the fixtures."""
        return any(uses for _, uses in self.tests.values())

    def dump(self) -> dict[str, Any]:
        """Return it as plain lists, for a worker to send; empty if no test uses the fixtures."""
        if not self.any_test:
            return {}
        texts = {k: sorted(v) if isinstance(v, set) else v for k, v in asdict(self).items()}
        return {**texts, "tests": {k: list(v) for k, v in self.tests.items()}}

    def add(self, dumped: Mapping[str, Any]) -> Self:
        """Add what a worker sent."""
        for name in ("files", "completed", "failed", "used"):
            getattr(self, name).update(dumped.get(name, ()))
        for node, (file, uses) in dumped.get("tests", {}).items():
            self.tests[node] = (file, uses)
        self.renewed.update(dumped.get("renewed", {}))
        self.broken = self.broken or dumped.get("broken", False)
        return self

    def unused(self, is_complete: Callable[[str, Iterable[str]], bool]) -> list[str]:
        """Return golden files that no test used, in folders for which all tests ran.

        Args:
            is_complete: Whether every test file that could use a folder was requested and
                collected, given the folder and the test files that were collected.
        """
        if self.broken:
            return []
        by_folder: dict[str, list[str]] = {}
        for node, (file, _) in self.tests.items():
            by_folder.setdefault(self.folder_of(file), []).append(node)
        found = []
        for folder, nodes in sorted(by_folder.items()):
            if not any(self.tests[node][1] for node in nodes) or not os.path.isdir(folder):
                continue
            if all(map(self._used_all, nodes)) and is_complete(folder, self.files):
                found += [path for path in _golden_files(folder) if path not in self.used]
        return found

    def _used_all(self, node: str) -> bool:
        """Whether a test used all it would use; a test without the fixtures only has to run."""
        return node in self.completed and not (self.tests[node][1] and node in self.failed)


def _golden_files(folder: str) -> list[str]:
    names = sorted(os.listdir(folder))
    golden = [n for n in names if n.endswith(ENDINGS) and not n.startswith(".")]
    return [os.path.join(folder, name) for name in golden]
