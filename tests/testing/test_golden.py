"""Golden recordings replay, and planning them again gives the same events."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import brrt

RECORDINGS = Path(__file__).parents[2] / "recordings"
PLAIN = ("circles2d-rrt", "boxes3d-line-of-sight")
FILES = sorted(RECORDINGS.glob("*.mcap"))


@pytest.fixture
def golden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Load the script with a copy of the recordings."""
    monkeypatch.delenv("CI", raising=False)
    copy = tmp_path / "recordings"
    shutil.copytree(RECORDINGS, copy, ignore=shutil.ignore_patterns("__pycache__"))
    spec = importlib.util.spec_from_file_location("golden", copy / "golden.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(golden: ModuleType, monkeypatch: pytest.MonkeyPatch, *args: str) -> int:
    """Call the script with command line arguments."""
    monkeypatch.setattr(sys, "argv", ["golden.py", *args])
    return int(golden.main())


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_replays_to_the_figures_it_holds(path: Path) -> None:
    """Replay gives the stored metrics; a newer brrt may have additional ones."""
    recording = brrt.read(path)
    figures = brrt.metrics(recording).as_dict()
    assert recording.result is not None
    assert {name: figures[name] for name in recording.result} == recording.result
    edges = recording.events()[brrt.Kind.EDGE]
    assert set(brrt.forest(recording.events())) == set(edges["tree"].tolist())


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_plans_to_the_same_events(path: Path) -> None:
    """Running the manifest's scenario gives the same events bit by bit."""
    recording = brrt.read(path)
    fresh = brrt.Run(recording.manifest.scenario)
    found = brrt.first_difference(recording.batches(), fresh.events())
    assert found is None, str(found)


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_transcripts_are_the_stored_ones(path: Path) -> None:
    """The transcript equals the stored one."""
    assert brrt.transcript(brrt.read(path)) == path.with_suffix(".txt").read_text("utf-8")


def test_manifest_makes_them(golden: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file is what its command in the manifest writes."""
    assert run(golden, monkeypatch, "check") == 0


def test_update_renews_and_reports(
    golden: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`check` reports a changed recording, and `update` renews it."""
    manifest = golden.FOLDER / "manifest.toml"
    manifest.write_text(manifest.read_text().replace("--seed 7", "--seed 8"))
    assert run(golden, monkeypatch, "check", "circles2d-rrt") == 1
    assert "circles2d-rrt: event 2 (sample): " in capsys.readouterr().out
    assert run(golden, monkeypatch, "update", "circles2d-rrt") == 1
    assert run(golden, monkeypatch, "check", "circles2d-rrt") == 0


def test_missing_unused_and_ci(golden: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing or an unused file fails; `update` refuses in CI."""
    (golden.FOLDER / "circles2d-rrt.mcap").rename(golden.FOLDER / "stray.mcap")
    assert golden.strays() == [
        "stray.mcap: not in manifest.toml",
        "circles2d-rrt: has no recording; update it",
    ]
    monkeypatch.setenv("CI", "1")
    with pytest.raises(SystemExit):
        run(golden, monkeypatch, "update")


def test_kernels_run_as_plain_python_bit_for_bit() -> None:
    """Without the compiler the same seed gives the same events."""
    done = subprocess.run(
        [sys.executable, str(RECORDINGS / "golden.py"), "check", *PLAIN],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    differing = [line for line in done.stdout.splitlines() if not line.endswith(": the same")]
    assert not differing, done.stdout + done.stderr
    assert all(name in done.stdout for name in PLAIN)
