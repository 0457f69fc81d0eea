"""Fuzz the loaders of world files: any failure other than a one-line error counts.

    python benchmarks/fuzz_loaders.py FILE [--seconds 60] [--seed 0] [--corpus DIR] [--keep DIR]

FILE is one of those in `tests/support/world_files.py`, such as `map.yaml`; the others are in the
same folder. With atheris (`pip install atheris`), the coverage of brrt, yaml, json and Pillow
guides the mutations; otherwise files are corrupted at random. Inputs that fail are kept, as is the
slowest. The exit code is 1 if any failed.
"""

import argparse
import os
import resource
import sys
import time
import traceback
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1]))

try:
    import atheris
except ImportError:
    atheris = None

SEEN = (
    "json.decoder",
    "yaml",
    "PIL.Image",
    "brrt.worlds.loaders.yaml_fields",
    "brrt.worlds.loaders.convex_decomposition",
)
"""Modules that loaders import on demand, so that atheris instruments them."""

with (
    nullcontext()
    if atheris is None
    else atheris.instrument_imports(include=["brrt.worlds", "brrt.files", "json", "yaml", "PIL"])
):
    from brrt import BrrtError
    from brrt.worlds import load_world

    for module in SEEN:
        import_module(module)
    from tests.support.world_files import GOOD, corrupted, write

LONGEST = 1 << 16


class Fuzzer:
    """Loads inputs one after the other, and records failures, time and memory."""

    def __init__(self, name: str, folder: Path, keep: Path, seconds: float) -> None:
        self.path = folder / f"corrupted.{name}"
        self.settings = {"obstacles": "circle_obstacles.txt"} if "queries" in name else {}
        self.query = "0" if name.startswith(("grid.scen", "circle_queries")) else ""
        self.keep, self.ends = keep, time.perf_counter() + seconds
        self.tried = self.loaded = self.slow_bytes = 0
        self.slowest = 0.0
        self.failures: dict[str, bytes] = {}
        self.first_peak = 0

    def __call__(self, data: bytes) -> None:
        """Load one input; end the process when the time is up."""
        self.path.write_bytes(data)
        start = time.perf_counter()
        try:
            load_world(self.path, self.settings, self.query)
            self.loaded += 1
        except BrrtError as error:
            if not str(error).isprintable() or len(str(error)) > 600:
                self._fail(f"message: {str(error)[:200]!r}", data)
        except Exception:  # noqa: BLE001 - any other exception is a failure
            lines = traceback.format_exc().strip().splitlines()
            self._fail(f"{lines[-1][:200]} {lines[-3].strip()}", data)
        taken = time.perf_counter() - start
        self.tried += 1
        if taken > self.slowest:
            self.slowest, self.slow_bytes = taken, len(data)
            (self.keep / f"slowest-{self.path.name}").write_bytes(data)
        if self.tried == 1000:
            self.first_peak = _peak()
        if time.perf_counter() > self.ends:
            self.report()
            sys.stdout.flush()
            os._exit(bool(self.failures))  # atheris does not return otherwise

    def _fail(self, what: str, data: bytes) -> None:
        if what not in self.failures:
            (self.keep / f"failed-{len(self.failures)}-{self.path.name}").write_bytes(data)
            self.failures[what] = data

    def report(self) -> None:
        """Print one line, and one for each failure."""
        print(
            f"{self.path.name}: {self.tried:,} inputs, {self.loaded:,} loaded, "
            f"{len(self.failures)} kinds of failure, peak {_peak()} MB ({self.first_peak} MB after "
            f"1,000), slowest {self.slowest:.3f} s ({self.slow_bytes:,} bytes)"
        )
        for what in self.failures:
            print(" ", what)


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def main() -> None:
    """Fuzz until the time is up."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", choices=GOOD)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--corpus", type=Path, help="more files to begin with")
    parser.add_argument("--keep", type=Path, default=Path("fuzzed"))
    args = parser.parse_args()
    args.keep.mkdir(exist_ok=True)
    with TemporaryDirectory() as name:
        folder, corpus = Path(name), Path(name, "corpus")
        write(folder)
        corpus.mkdir()
        seeds = [folder / args.file, *(args.corpus.iterdir() if args.corpus else ())]
        for i, seed in enumerate(seeds):
            (corpus / str(i)).write_bytes(seed.read_bytes())
        fuzzer = Fuzzer(args.file, folder, args.keep, args.seconds)
        if atheris is None:
            rng = Random(args.seed)  # noqa: S311
            files = [path.read_bytes() for path in corpus.iterdir()]
            while True:
                fuzzer(corrupted(rng.choice(files), rng)[:LONGEST])

        def mutate(data: bytes, most: int, seed: int) -> bytes:
            rng = Random(seed)  # noqa: S311
            return corrupted(data, rng)[:most] if rng.random() < 0.5 else atheris.Mutate(data, most)

        options = [
            f"-seed={args.seed + 1}",
            f"-max_len={LONGEST}",
            "-rss_limit_mb=0",
            "-verbosity=0",
        ]
        atheris.Setup([sys.argv[0], *options, str(corpus)], fuzzer, custom_mutator=mutate)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
