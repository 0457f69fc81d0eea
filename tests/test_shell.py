"""Words of printed commands, as a shell reads them."""

import subprocess
from pathlib import Path

import pytest

from brrt.shell import file_argument, join

NAMES = (
    "run.mcap", "-x.mcap", "--force", "a b.mcap", "it's.mcap", "$HOME.mcap", "日本.mcap",
    "new\nline", "tab\t", "odd\udcff.mcap", "odd\udcffe'\\", "\x1b[31m",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_bash_reads_what_was_meant(name: str, tmp_path: Path) -> None:
    """A name stays one word on one line, and never an option."""
    typed = file_argument(name)
    typed.encode()
    assert "\n" not in typed
    assert not typed.startswith("-")
    (tmp_path / name).write_text("found")
    done = subprocess.run(
        ["/bin/bash", "-c", f"cat {typed}"], capture_output=True, cwd=tmp_path, check=True
    )
    assert done.stdout == b"found"


def test_lone_surrogates() -> None:
    """No file has such a name, but the manifest of a foreign recording may."""
    assert join(["brrt", "plan", "--world", "w\ud800"]) == "brrt plan --world $'w\\x5cud800'"
