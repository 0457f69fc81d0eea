"""Fixtures shared by all tests."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from brrt import (
    Events,
    Manifest,
    Memory,
    Metrics,
    Recording,
    RecordingError,
    Run,
    Scenario,
    World,
    verify,
)  # fmt: skip
from brrt.verification.result import Finding

pytest_plugins = ["pytester"]

# On a busy machine the first example of a strategy may take seconds; that is no finding.
settings.register_profile("brrt", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# In CI a run must not fail by the draw of its examples; elsewhere each run looks at new ones.
settings.register_profile("ci", parent=settings.get_profile("brrt"), derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "brrt"))


@dataclass(frozen=True)
class Result:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The object on stdout."""
        found = json.loads(self.out)
        assert isinstance(found, dict)
        return found


@pytest.fixture
def brrt(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[..., Result]:
    """Run the installed command in process, in an empty folder: `brrt("plan", "--seed", "1")`."""
    (script,) = entry_points(group="console_scripts", name="brrt")
    main = script.load()
    monkeypatch.chdir(tmp_path)

    def call(*args: object) -> Result:
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(arg) for arg in args])
        out, err = capfd.readouterr()
        return Result(int(ended.value.code or 0), out, err)

    return call


@pytest.fixture
def shell(tmp_path: Path) -> Callable[..., Result]:
    """Run the command as a process of its own, in an empty folder."""

    def call(*args: object, timeout: float = 120) -> Result:
        done = subprocess.run(
            [sys.executable, "-m", "brrt_cli", *map(str, args)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            timeout=timeout,
            check=False,
        )
        return Result(done.returncode, done.stdout, done.stderr)

    return call


@cache
def _viewer_error() -> str | None:
    """Return why Rerun's viewer cannot run without a window, if it cannot."""
    from brrt.views.viewer.control import headless

    try:
        with headless((200, 200)):
            return None
    except RecordingError as error:
        return str(error)


@pytest.fixture
def viewer() -> None:
    """Skip a test where Rerun's viewer cannot run without a window."""
    reason = _viewer_error()
    if reason is not None:
        pytest.skip(reason)


@cache
def _recorded(scenario: str, batch: int) -> tuple[Run, Events]:
    run, memory = Run(Scenario.parse(json.loads(scenario)), batch=batch), Memory()
    run.execute([memory])
    return run, memory.events()


def result_of(manifest: Manifest, *batches: Events) -> dict[str, Any]:
    """Fold events into the result that a sink is closed with."""
    found = Metrics(manifest)
    for batch in batches:
        found.write(batch)
    return found.as_dict()


def findings_of(manifest: Manifest, world: World, log: Events) -> list[Finding]:
    """Verify a whole log without a stored result."""
    return verify(Recording(manifest, world, lambda: [log], {})).findings


def recorded(scenario: Scenario, *, batch: int = 16384) -> tuple[Run, Events]:
    """Run a scenario, once for all tests; return it with its whole log."""
    return _recorded(json.dumps(scenario.as_dict()), batch)
