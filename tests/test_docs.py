"""What the documents tell people to type works."""

import importlib.util
import re
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from brrt.verification.rules import RULES
from brrt.views.viewer import control
from tests.conftest import Result

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    """Return the fenced blocks in a language, but the one that sets everything up."""
    found: list[str] = re.findall(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    return [block for block in found if "venv" not in block]


def test_readme_commands_and_code(
    brrt: Callable[..., Result],
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every brrt command and every Python block of the README runs, in its order."""
    windows = []
    monkeypatch.setenv("DISPLAY", ":nowhere")
    monkeypatch.setattr(control, "show", lambda run, _: windows.append(run))
    (scenario,) = blocks("toml")
    Path("experiment.toml").write_text(scenario)
    commands = [
        shlex.split(line, comments=True)
        for block in blocks("sh")
        for line in block.splitlines()
        if line.startswith(("brrt ", "head "))
    ]
    assert len(commands) >= 5
    for program, *args in commands:
        if program == "head":
            subprocess.run(shlex.join([program, *args]).replace("'>'", ">"), shell=True, check=True)  # noqa: S602
            continue
        Path("run.mcap" if "--out" not in args and args[0] == "plan" else "none").unlink(True)
        Path("run.rrd" if "--out" not in args and args[0] == "plan" else "none").unlink(True)
        done = brrt(*args)
        # The two seeds of the tour are of one world: that the runs part is its point.
        parts = "--check" in args or args[0] == "diff"
        assert done.code == parts, (args, done.err)
        if "--check" in args:
            # What it prints stands below the command.
            assert f"\n\n```\nA {done.out.partition(chr(10) * 2 + 'A ')[2]}```\n" in README
    assert [run.name for run in windows] == ["run.rrd"]
    for code in blocks("python"):
        if "def test_" in code:
            continue  # a test file, which tests/test_pytest_plugin.py runs
        exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - our own text
        assert capfd.readouterr().out


def test_promises_page_names_every_rule() -> None:
    """And no rule that there is not."""
    page = (ROOT / "docs/promises.md").read_text()
    table = [line.rpartition(" | ")[2] for line in page.splitlines() if line.startswith("| ")]
    named = {name for cell in table for name in re.findall("`([^`]+)`", cell)}
    assert named == {rule.name for rule in RULES}


def test_events_page_is_up_to_date() -> None:
    """The page says what the declaration says."""
    spec = importlib.util.spec_from_file_location("make_events", ROOT / "docs" / "make_events.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text() == module.page()


def test_documents_name_no_file_that_is_missing() -> None:
    """Every relative link of the README leads somewhere."""
    links = re.findall(r"\]\(([^)#]+)\)", README)
    for link in links:
        if "://" not in link:
            assert (ROOT / link).exists(), link


def test_pictures_are_small_and_shown() -> None:
    """Each picture that the script makes is there, loads fast, and stands in the gallery."""
    spec = importlib.util.spec_from_file_location("shots", ROOT / "docs" / "screenshot.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    gallery = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", (ROOT / "docs" / "gallery.md").read_text())
    assert gallery == list(module.PICTURES)
    pictures = {path.name: path.stat().st_size for path in (ROOT / "docs").glob("*.png")}
    assert pictures.keys() == {*gallery, "worlds.png"}
    assert max(pictures.values()) < 200_000, pictures
