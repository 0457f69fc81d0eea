"""Options, settings and fixtures of the plugin.

PYTEST_DONT_REWRITE
"""

import os
from typing import TYPE_CHECKING

import pytest

from .hooks import USAGE, SessionHooks
from .usage import GoldenUsage

if TYPE_CHECKING:
    from .fixtures import Gate, Golden


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare options and settings."""
    group = parser.getgroup("brrt", "golden runs and gates of motion planners")
    group.addoption(
        "--brrt-update",
        action="store_true",
        help="Make and renew golden files. A test whose files change fails: check what changed, "
        "and commit it.",
    )
    group.addoption(
        "--brrt-failed",
        metavar="DIR",
        help="Folder for failed runs and metrics, with their messages (default: in pytest's "
        "cache).",
    )
    group.addoption(
        "--brrt-unused",
        choices=("report", "fail"),
        help="What to do about golden files that no test uses (default: the setting brrt_unused).",
    )
    parser.addini(
        "brrt_golden_dir",
        "One folder for all golden files, relative to the root directory "
        "(default: golden/ beside each test file).",
        default="",
    )
    parser.addini(
        "brrt_unused",
        "report or fail: what to do about golden files that no test uses.",
        default="report",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Check options and settings, and register the hooks."""
    if config.getoption("brrt_update") and os.environ.get("CI"):
        raise pytest.UsageError(
            "--brrt-update: golden files are not renewed in CI; renew them by hand and commit them"
        )
    setting = config.getini("brrt_unused")
    if setting not in ("report", "fail"):
        raise pytest.UsageError(f"brrt_unused must be report or fail, not {setting!r}")
    folder = config.getini("brrt_golden_dir")
    config.stash[USAGE] = GoldenUsage(str(config.rootpath / folder) if folder else "")
    config.pluginmanager.register(SessionHooks(config), "brrt_hooks")


@pytest.fixture
def brrt_golden(request: pytest.FixtureRequest) -> "Golden":
    """Compare a run with a stored one.

    brrt_golden("forest-rrt", brrt.Scenario(world="forest2d", seed=7))

    The failure's message is what `brrt diff` prints. pytest --brrt-update makes and renews files.
    """
    from .fixtures import Golden

    return Golden(request)


@pytest.fixture
def brrt_gate(request: pytest.FixtureRequest) -> "Gate":
    """Compare the metrics of many seeds with stored ones.

    brrt_gate(scenario, against="forest-rrt", seeds=20, cost=0.02, iterations=0.10)

    fails if the data prove that costs grew by more than 2 %, or iterations by more than 10 %.
    """
    from .fixtures import Gate

    return Gate(request)
