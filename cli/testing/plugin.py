"""Options, settings and fixtures.

PYTEST_DONT_REWRITE
"""

import os
from typing import TYPE_CHECKING

import pytest

from .ledger import Ledger
from .watch import LEDGER, Watch

if TYPE_CHECKING:
    from .fixtures import Gate, Golden


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare options and settings."""
    group = parser.getgroup("brrt", "golden runs and gates of motion planners")
    group.addoption(
        "--brrt-update",
        action="store_true",
        help="Make and renew golden files. A test whose file this changes fails: look at what "
        "changed, and commit it.",
    )
    group.addoption(
        "--brrt-failed",
        metavar="DIR",
        help="Keep runs and figures that failed here, with what was told of them "
        "(default: in pytest's cache).",
    )
    group.addoption(
        "--brrt-unused",
        choices=("report", "fail"),
        help="What becomes of golden files that no test uses (default: the setting brrt_unused).",
    )
    parser.addini(
        "brrt_golden_dir",
        "One folder for all golden files, relative to the root directory "
        "(default: golden/ beside each test file).",
        default="",
    )
    parser.addini(
        "brrt_unused",
        "report or fail: what becomes of golden files that no test uses.",
        default="report",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Begin to watch the session; refuse what must not be done."""
    if config.getoption("brrt_update") and os.environ.get("CI"):
        raise pytest.UsageError(
            "--brrt-update: golden files are not renewed in CI; do it by hand and commit"
        )
    setting = config.getini("brrt_unused")
    if setting not in ("report", "fail"):
        raise pytest.UsageError(f"brrt_unused must be report or fail, not {setting!r}")
    folder = config.getini("brrt_golden_dir")
    config.stash[LEDGER] = Ledger(str(config.rootpath / folder) if folder else "")
    config.pluginmanager.register(Watch(config), "brrt_watch")


@pytest.fixture
def brrt_golden(request: pytest.FixtureRequest) -> "Golden":
    """Hold a run against a stored one.

    brrt_golden("forest-rrt", brrt.Scenario(world="forest2d", seed=7))

    The failure's message is what `brrt diff` prints. pytest --brrt-update makes and renews files.
    """
    from .fixtures import Golden

    return Golden(request)


@pytest.fixture
def brrt_gate(request: pytest.FixtureRequest) -> "Gate":
    """Hold the figures of many seeds against stored ones.

    brrt_gate(scenario, against="forest-rrt", seeds=20, cost=0.02, iterations=0.10)

    fails where the data prove that costs grew by more than 2 %, or iterations by more than 10 %.
    """
    from .fixtures import Gate

    return Gate(request)
