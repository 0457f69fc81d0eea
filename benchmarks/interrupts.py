"""Interrupt `brrt plan` at moments spread over its start-up and compilation.

    python benchmarks/interrupts.py [--moments 50]

Half of the moments come before a run with compiled kernels begins, half while kernels are compiled
into an empty cache. Each run must end with exit code 130 and without a traceback, and leave no
temporary file. The exit code is 1 if one does not. Moments before Python has read the first line
of brrt are not counted: the interpreter itself answers them.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

_START = "import os; from brrt_cli.start import main; os.write(2, b'.'); main()"
_FIRST_S = 0.01
"""Seconds after the first file of brrt is read."""

_LOADING_S, _COMPILING_S = 2.0, 20.0


def main() -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=50)
    half = parser.parse_args().moments // 2
    outcomes: Counter[str] = Counter()
    for longest, cached in ((_LOADING_S, True), (_COMPILING_S, False)):
        for i in range(half):
            after = _FIRST_S + (longest - _FIRST_S) * i / half
            outcome = interrupted(after, cached=cached)
            outcomes[outcome] += 1
            print(f"{after:.3f} s, {'cached' if cached else 'compiling'}: {outcome}", flush=True)
    print(dict(outcomes))
    sys.exit(int(set(outcomes) != {"ended"}))


def interrupted(after: float, *, cached: bool) -> str:
    """Send Ctrl-C so many seconds after the start; return "ended" or what else happened."""
    with tempfile.TemporaryDirectory() as folder:
        env = dict(os.environ)
        if not cached:
            env["BRRT_CACHE_DIR"] = str(Path(folder, "cache"))
        command = [sys.executable, "-c", _START, "plan", "--iterations", "100000000"]
        command += ["--param", "goal_bias=0", "--param", "step=0.001", "--json"]
        process = subprocess.Popen(
            command, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        if process.stderr is not None:
            process.stderr.read(1)
        time.sleep(after)
        process.send_signal(signal.SIGINT)
        try:
            _, printed = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            return "did not end"
        left = [path.name for path in Path(folder).rglob(".brrt-*")]
    if process.returncode != signal.SIGINT + 128:
        return f"exit code {process.returncode}: {printed[-2000:]}"
    odd = [line for line in printed.splitlines() if not line.startswith("brrt: ")]
    return "ended" if not odd and not left else f"left {left}, printed {odd[-20:]}"


if __name__ == "__main__":
    main()
