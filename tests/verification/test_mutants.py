"""The bugs that benchmarks/mutants.py puts into the package still fit its code."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TABLES = [
    tomllib.loads(path.read_text("utf-8"))
    for path in sorted((ROOT / "benchmarks" / "mutants").glob("*.toml"))
]
MUTANTS = [mutant for table in TABLES for mutant in table.get("mutant", ())]
RUNS = next(table["runs"] for table in TABLES if "runs" in table)


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda each: each["name"])
def test_the_text_to_replace_occurs_once(mutant: dict[str, str]) -> None:
    """In the file that it names; its runs exist."""
    text = (ROOT / "brrt" / mutant["file"]).read_text("utf-8")
    assert text.count(mutant["old"]) == 1
    assert set(mutant["runs"]) <= set(RUNS)


def test_the_documents_state_how_many_there_are() -> None:
    """And names are unique."""
    assert len({mutant["name"] for mutant in MUTANTS}) == len(MUTANTS)
    for name in ("docs/promises.md", "CHANGELOG.md"):
        text = " ".join((ROOT / name).read_text("utf-8").split())
        (stated,) = re.findall(r"mutants\.py` puts ([\d,]+) bugs", text)
        assert stated == str(len(MUTANTS))
