"""Golden recordings: hold what the planners do today against what is kept here.

python recordings/golden.py check           compare, exit 1 at a difference
python recordings/golden.py update [NAME]   plan anew, print what changed, exit 1 if any did
"""

import argparse
import os
import shlex
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from brrt import BrrtError, first_difference, read, transcript

FOLDER = Path(__file__).parent


def entries() -> dict[str, str]:
    """Return the command of each golden recording, by name."""
    manifest = tomllib.loads((FOLDER / "manifest.toml").read_text())
    return {name: entry["command"] for name, entry in manifest.items()}


def strays() -> list[str]:
    """Name files that no entry makes, and entries that have no file."""
    files = {path.stem for path in FOLDER.glob("*.mcap")}
    names = set(entries())
    return [f"{name}.mcap: not in manifest.toml" for name in sorted(files - names)] + [
        f"{name}: has no recording; update it" for name in sorted(names - files)
    ]


def make(name: str, path: Path) -> None:
    """Run an entry's command, written to `path`; a run without a path is a run all the same."""
    arguments = [*shlex.split(entries()[name]), "--clock", "logical", "--out", str(path), "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "brrt_cli", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode not in (0, 1) or not path.exists():
        raise BrrtError(f"{name}: {done.stderr.strip()}")


def compare(name: str, fresh: Path) -> str | None:
    """Say where a fresh recording, or its account, parts from the golden one, or return None."""
    kept = FOLDER / f"{name}.mcap"
    if not kept.exists():
        return "is new"
    found = first_difference(read(kept).batches(), read(fresh).batches())
    if found is not None:
        return f"{found} (golden against fresh)"
    account = kept.with_suffix(".txt")
    told = account.read_text("utf-8") if account.exists() else ""
    return None if told == transcript(read(fresh)) else f"is not what {account.name} tells"


def main() -> int:
    """Compare or renew; return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=["check", "update"])
    parser.add_argument("names", nargs="*", help="all by default")
    options = parser.parse_args()
    if options.action == "update" and os.environ.get("CI"):
        parser.error("golden recordings are not renewed in CI; do it by hand and commit")
    for name in options.names:
        if name not in entries():
            parser.error(f"no entry {name!r} in manifest.toml; there is {', '.join(entries())}")
    changed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in options.names or entries():
            fresh = Path(folder) / f"{name}.mcap"
            make(name, fresh)
            difference = compare(name, fresh)
            print(f"{name}: {difference or 'the same'}")
            changed += difference is not None
            if difference is not None and options.action == "update":
                (FOLDER / fresh.name).write_bytes(fresh.read_bytes())
                (FOLDER / f"{name}.txt").write_text(transcript(read(fresh)), "utf-8")
    wrong = strays() if options.action == "check" or not options.names else []
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if changed or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
