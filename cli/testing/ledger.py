"""Which golden files were used, and whether enough was run to say that one is not.

PYTEST_DONT_REWRITE
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

ENDINGS = (".mcap", ".json")


@dataclass(slots=True)
class Ledger:
    """What a session did with golden files; workers' ledgers are added up.

    Attributes:
        folder: That of all golden files; empty where each test file has its own beside it.
        tests: By node id: the file, and whether the test names one of the fixtures.
        files: Test files that were collected without an error.
        settled: Tests that did all that they would do.
        failed: Tests with a failure in any part.
        used: Golden files that were compared with, made or read.
        renewed: By node id, what was made or renewed.
        broken: Whether something could not be collected.
    """

    folder: str
    tests: dict[str, tuple[str, bool]] = field(default_factory=dict)
    files: set[str] = field(default_factory=set)
    settled: set[str] = field(default_factory=set)
    failed: set[str] = field(default_factory=set)
    used: set[str] = field(default_factory=set)
    renewed: dict[str, list[str]] = field(default_factory=dict)
    broken: bool = False

    def folder_of(self, file: str) -> str:
        """Return where a test file's golden ones are."""
        return self.folder or os.path.join(os.path.dirname(file), "golden")

    @property
    def concerned(self) -> bool:
        """Whether any test may use golden files."""
        return any(uses for _, uses in self.tests.values())

    def dump(self) -> dict[str, Any]:
        """Return all of it in plain lists, as a worker sends it; nothing where nobody uses it."""
        if not self.concerned:
            return {}
        texts = {k: sorted(v) if isinstance(v, set) else v for k, v in asdict(self).items()}
        return {**texts, "tests": {k: list(v) for k, v in self.tests.items()}}

    def add(self, dumped: Mapping[str, Any]) -> Self:
        """Add what a worker sent."""
        for name in ("files", "settled", "failed", "used"):
            getattr(self, name).update(dumped.get(name, ()))
        for node, (file, uses) in dumped.get("tests", {}).items():
            self.tests[node] = (file, uses)
        self.renewed.update(dumped.get("renewed", {}))
        self.broken = self.broken or dumped.get("broken", False)
        return self

    def unused(self, whole: Callable[[str, Iterable[str]], bool]) -> list[str]:
        """Name golden files that no test used, in folders all of whose tests ran.

        Args:
            whole: Whether every test file that could use a folder was asked for and collected,
                given the folder and the test files that were.
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
            if all(map(self._did_all, nodes)) and whole(folder, self.files):
                found += [path for path in _golden_files(folder) if path not in self.used]
        return found

    def _did_all(self, node: str) -> bool:
        """Whether a test used whatever it would use; one that names no fixture has only to run."""
        return node in self.settled and not (self.tests[node][1] and node in self.failed)


def _golden_files(folder: str) -> list[str]:
    names = sorted(os.listdir(folder))
    golden = [n for n in names if n.endswith(ENDINGS) and not n.startswith(".")]
    return [os.path.join(folder, name) for name in golden]
