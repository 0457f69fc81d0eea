"""What the documents tell people to type works."""

import importlib.util
import json
import re
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from brrt import load_world, make_robot
from brrt.verification.rules import RULES
from brrt.views.viewer import control
from tests.conftest import Result

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
TIME = re.compile(r"\d[\d.]* (us|ms|s)\b")
"""A duration, which no two runs share."""


def expected_code(page: str, block: re.Match[str]) -> int:
    """Return the exit code of a block's last command, which the paragraph beside it states."""
    before = page[: block.start()].rstrip().rpartition("\n\n")[2]
    after = page[block.end() :].lstrip().partition("\n\n")[0]
    return int(bool(re.search(r"exit code (is )?1\b", f"{before} {after}".replace("\n", " "))))


def plain(text: str) -> str:
    """Return an output without durations and without blanks at the ends of its lines."""
    lines = (line.rstrip() for line in text.splitlines() if not line.startswith("us each"))
    return TIME.sub("TIME", "\n".join(lines)).strip()


def run_commands(brrt: Callable[..., Result], block: str) -> tuple[list[int], str]:
    """Run the commands of brrt in a block; return their exit codes and what the last one prints."""
    codes, out = [], ""
    for line in block.splitlines():
        command = line.partition("  #")[0]
        if command.startswith("head "):
            subprocess.run(command, shell=True, check=True)  # noqa: S602 - our own text
        elif command.startswith("brrt "):
            done = brrt(*shlex.split(command)[1:])
            codes.append(done.code)
            out = done.out
            assert done.code < 2, (command, done.err)
    return codes, out


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_commands_and_code_of_a_page(
    path: Path,
    brrt: Callable[..., Result],
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every brrt command and every piece of code runs, in order, and prints what the page shows."""
    monkeypatch.setenv("DISPLAY", ":nowhere")
    monkeypatch.setattr(control, "show", lambda _, __: None)
    page, out = path.read_text(), ""
    if "from ompl import" in page:
        pytest.importorskip("ompl")
    for block in FENCE.finditer(page):
        language, text = block.groups()
        if language == "toml":
            Path("experiment.toml").write_text(text)
        elif language == "json":
            load_world_or_robot(text)
        elif language == "python" and "def test_" not in text:  # those: tests/test_pytest_plugin
            exec(compile(text, path.name, "exec"), {})  # noqa: S102 - our own text
            assert capfd.readouterr().out
        elif language == "sh" and "venv" not in text:
            codes, out = run_commands(brrt, text)
            assert codes[:-1] == [0] * len(codes[:-1])
            assert not codes or codes[-1] == expected_code(page, block), text
        elif not language:
            at, shown = 0, plain(out)
            for part in re.split(r"^ *\.\.\.\n", text, flags=re.MULTILINE):
                at = shown.find(plain(part), at)
                assert at >= 0, (part, shown)


def load_world_or_robot(text: str) -> None:
    """Load a file that a page shows."""
    path = Path("shown.json")
    path.write_text(text)
    if json.loads(text)["schema"] == "brrt.world":
        load_world(path)
    else:
        make_robot(str(path))


def test_readme_is_short() -> None:
    """It is what a newcomer reads first."""
    assert len(PAGES[0].read_bytes()) <= 7000


def test_promises_page_names_every_rule() -> None:
    """And no rule that there is not."""
    page = (ROOT / "docs/promises.md").read_text()
    table = [line.rpartition(" | ")[2] for line in page.splitlines() if line.startswith("| ")]
    named = {name for cell in table for name in re.findall("`([^`]+)`", cell)}
    assert named == {rule.name for rule in RULES}


def test_events_page_is_up_to_date() -> None:
    """The page and the C++ header say what the declaration says."""
    spec = importlib.util.spec_from_file_location("make_events", ROOT / "docs" / "make_events.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for path, make in module.FILES.items():
        assert path.read_text() == make(), path


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    """Every relative link is that of a file."""
    for link in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        if "://" not in link:
            assert (path.parent / link).exists(), link


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
    assert pictures.keys() == {*gallery, "worlds.png", "ompl_demo.png"}
    assert max(pictures.values()) < 200_000, pictures
