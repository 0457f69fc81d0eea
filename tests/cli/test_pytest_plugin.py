"""Golden runs and gates in somebody else's test suite."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import yaml

import brrt
from brrt.testing import golden
from brrt.testing.seed_metrics import SeedMetrics

SCENARIO = 'brrt.Scenario(world="circles2d:n=40,seed=3", seed={})'
ONE = f"""
import brrt

def test_forest(brrt_golden):
    brrt_golden("forest", {SCENARIO.format(7)})
"""
ROOT = Path(__file__).parents[2]
Pytest = Callable[..., pytest.RunResult]


@pytest.fixture(scope="module", autouse=True)
def _numba() -> None:
    """Let numba load all of itself; what is first imported in a session in process is unloaded."""
    brrt.Run(brrt.Scenario(world="circles2d:n=40,seed=3")).execute()


@pytest.fixture
def run(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Pytest:
    """Run pytest in process, in an empty folder, as strictly as it goes."""
    monkeypatch.delenv("CI", raising=False)
    pytester.makefile(".toml", pytest="[pytest]\nstrict = true\nfilterwarnings = ['error']\n")

    def call(*args: str | Path) -> pytest.RunResult:
        # What tests of brrt need is slow to start in each worker, and no part of this.
        others = [
            each
            for name in ("randomly", "cov", "hypothesispytest")
            for each in ("-p", f"no:{name}")
        ]
        return pytester.runpytest_inprocess(*others, *map(str, args))

    return call


def update(run: Pytest) -> None:
    """Make what is missing; every test that uses it fails."""
    assert run("--brrt-update").ret == 1


def text(result: pytest.RunResult) -> str:
    """All that was printed, without warnings of any kind."""
    told = result.stdout.str() + result.stderr.str()
    assert "Warning" not in told
    return told


def summary(result: pytest.RunResult) -> Sequence[str]:
    """The lines of brrt's section at the end."""
    lines = result.outlines
    begins = [i for i, line in enumerate(lines) if line.strip("= ") == "brrt"]
    if not begins:
        return []
    rest = lines[begins[0] + 1 :]
    end = next(i for i, line in enumerate(rest) if line.startswith("="))
    return [line for line in rest[:end] if line]


def test_made_held_changed_and_renewed(pytester: pytest.Pytester, run: Pytest) -> None:
    """Missing: the remedy. Made: fails, then passes. Changed: the diff. Renewed: fails."""
    file = pytester.makepyfile(test_a=ONE)
    kept = pytester.path / "golden" / "forest.mcap"
    missing = run()
    assert missing.ret == 1
    assert "no golden run golden/forest.mcap; make it: pytest --brrt-update" in text(missing)
    assert not kept.exists()
    update(run)
    first = kept.read_bytes()
    assert run().ret == 0
    assert run("--brrt-update").ret == 0
    file.write_text(ONE.replace("seed=7", "seed=8"))
    changed = run("--brrt-failed", "failed")
    assert changed.ret == 1
    fresh = pytester.path / "failed" / "golden" / "forest.mcap"
    expected = brrt.compare(kept, fresh, names=("golden/forest.mcap", "failed/golden/forest.mcap"))
    assert "\n".join(expected.lines()) in text(changed)
    assert "The first difference is event 2" in text(changed)
    told = fresh.with_suffix(".txt").read_text()
    assert told.rstrip("\n") in text(changed)
    assert kept.read_bytes() == first
    renewed = run("--brrt-update")
    assert renewed.ret == 1
    assert summary(renewed) == ["golden/forest.mcap: renewed; check what changed and commit it"]
    assert kept.read_bytes() != first
    assert run().ret == 0
    assert sorted(path.name for path in kept.parent.iterdir()) == ["forest.mcap"]


def test_every_file_of_a_test_is_renewed(pytester: pytest.Pytester, run: Pytest) -> None:
    """A test with several golden runs needs one renewal, also of files that cannot be read."""
    pytester.makepyfile(
        test_a=f"""
import brrt

def test_two(brrt_golden):
    brrt_golden("a", {SCENARIO.format(7)})
    brrt_golden("b", {SCENARIO.format(8)})
"""
    )
    update(run)
    assert run().ret == 0
    (pytester.path / "golden" / "a.mcap").write_bytes(b"damaged")
    assert "golden/a.mcap: not a recording" in text(run())
    renewed = run("--brrt-update")
    assert len(summary(renewed)) == 1
    assert "could not be read" in text(renewed)
    assert run().ret == 0


def test_whatever_a_user_has(pytester: pytest.Pytester, run: Pytest) -> None:
    """Scenario files, runs of planners from outside, recordings, and the golden run's own plan."""
    pytester.makefile(".toml", plan='world = "circles2d:n=40,seed=3"\nseed = 7\n')
    pytester.makepyfile(
        test_a=f"""
import brrt
from tests.support.toys import TOYS

THEIRS = brrt.Scenario(world="circles2d:n=12,seed=3", planner="theirs", seed=3, iterations=60)
OURS = {SCENARIO.format(7)}

def test_file(brrt_golden):
    brrt_golden("ours", "plan.toml")

def test_run(brrt_golden):
    assert brrt.metrics(brrt_golden("ours", brrt.Run(OURS))).solved

def test_alone(brrt_golden):
    brrt_golden("ours")

def test_planner_from_outside(brrt_golden):
    recording = brrt_golden("theirs", brrt.Run(THEIRS, planner=TOYS["pair"]))
    assert recording.manifest.scenario.clock == "logical"

def test_file_of_another_program(brrt_golden, tmp_path):
    run = brrt.Run(THEIRS, planner=TOYS["pair"])
    run.execute([brrt.McapSink(tmp_path / "cpp.mcap", run.manifest, run.problem.world)])
    brrt_golden("theirs", tmp_path / "cpp.mcap")
    brrt_golden("theirs", brrt.read(tmp_path / "cpp.mcap"))
"""
    )
    update(run)
    assert run().ret == 0
    first = {path.name: path.read_bytes() for path in (pytester.path / "golden").iterdir()}
    assert run("--brrt-update").ret == 0
    for path in (pytester.path / "golden").iterdir():
        assert first.pop(path.name) == path.read_bytes()
        path.unlink()
    assert not first
    update(run)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ('brrt_golden("../up", brrt.Scenario())', "name '../up': a file's name has"),
        ('brrt_golden("x")', "no golden run golden/x.mcap; give brrt_golden the run as well"),
        ("brrt_golden(brrt.Scenario())", "give the name of the golden file first, not Scen"),
        ("brrt_gate(brrt.Scenario(), cost=0.1)", "give `against`: the name of a"),
        ('brrt_gate(lambda: 0, against="x", cost=0.1)', "give a scenario or a function of the"),
        ('brrt_golden("x", 7)', "give a Scenario, a Run, a Recording or a file"),
        ('brrt_golden("x", brrt.Scenario(time=1.0))', "a scenario with a time limit ends"),
        ('brrt_golden("x", "none.mcap")', "none.mcap: No such file or directory"),
        (
            'brrt_gate(brrt.Scenario(), against="x", seeds=3, cost=0.1)',
            "3 seeds are too few",
        ),
        ('brrt_gate(brrt.Scenario(), against="x", cots=0.1)', "unknown metric 'cots'; did you"),
    ],
)
def test_bad_input_is_one_line(
    pytester: pytest.Pytester, run: Pytest, call: str, message: str
) -> None:
    """No traceback of ours; nothing is written."""
    pytester.makepyfile(test_a=f"import brrt\ndef test(brrt_golden, brrt_gate):\n    {call}\n")
    result = run("--brrt-update" if "cots" in call else "--brrt-unused=report")
    assert result.ret == 1
    told = text(result)
    assert message in told
    assert "Traceback" not in told
    assert "brrt/testing" not in told


GATE = f"""
import brrt
from dataclasses import replace

OLD = {SCENARIO.format(0)}

def test_gate(brrt_gate):
    verdict = brrt_gate(OLD, against="figures", seeds=12, cost=0.02, iterations=0.10)
    assert verdict.identical
"""


def test_gate_made_held_changed_and_renewed(pytester: pytest.Pytester, run: Pytest) -> None:
    """The same figures pass at once; worse ones fail with the table; renewed ones fail once."""
    file = pytester.makepyfile(test_a=GATE)
    kept = pytester.path / "golden" / "figures.json"
    assert "make them: pytest --brrt-update" in text(run())
    update(run)
    assert run().ret == 0
    assert run("--brrt-update").ret == 0
    assert list(json.loads(kept.read_text())["runs"]) == list(map(str, range(12)))
    worse = GATE.replace("gate(OLD", "gate(replace(OLD, params={'step': 1.0})")
    file.write_text(worse.replace("    assert verdict.identical\n", ""))
    failed = run("--brrt-failed=failed")
    assert failed.ret == 1
    assert "golden/figures.json: FAILED, 12 seeds" in text(failed)
    assert any(
        line.startswith("  brrt plan ") and "--param step=1 --out seed" in line
        for line in failed.outlines
    )
    assert any(line.startswith("  iterations") and "FAIL" in line for line in failed.outlines)
    assert (pytester.path / "failed" / "golden" / "figures.txt").read_text().rstrip() in text(
        failed
    )
    fresh = SeedMetrics.load(pytester.path / "failed" / "golden" / "figures.json")
    renewed = run("--brrt-update")
    assert SeedMetrics.load(kept) == fresh
    assert summary(renewed) == [
        "golden/figures.json: renewed; against the old ones: FAILED, 12 seeds"
    ]
    assert run().ret == 0


def test_gate_against_another_planner(pytester: pytest.Pytester, run: Pytest) -> None:
    """Nothing is stored, and the remedy does not name what is stored."""
    pytester.makepyfile(
        test_a="""
from brrt import Scenario

def figures(seed):
    return {"solved": True, "cost": 10.0 + seed, "clearance_lost": 1 + seed % 3}

def worse(seed):
    return {**figures(seed), "cost": 12.0 + 2 * seed}

def test_same(brrt_gate):
    assert brrt_gate(figures, against=figures, seeds=range(5, 20), clearance_lost=0).identical

def test_worse(brrt_gate):
    brrt_gate(worse, against=figures, cost=0.05)
"""
    )
    result = run()
    result.assert_outcomes(passed=1, failed=1)
    assert "--brrt-update" not in text(result)
    assert not (pytester.path / "golden").exists()


def test_tolerance(pytester: pytest.Pytester, run: Pytest) -> None:
    """A digit that differs by less than the tolerance is equal, and only then."""
    file = pytester.makepyfile(test_a=ONE)
    update(run)
    kept = pytester.path / "golden" / "forest.mcap"
    recording = brrt.read(kept)
    events = recording.events()
    for name, table in (("cost", events[brrt.Kind.EDGE]), ("q", events[brrt.Kind.SAMPLE])):
        table[name] *= 1 + 1e-12
    for row in events[brrt.Kind.PATH]:
        row["waypoints"] *= 1 - 1e-12
    doctored = brrt.Recording(
        recording.manifest, recording.world, lambda: iter([events]), recording.result
    )
    golden.save(doctored, kept)
    differs = run()
    assert differs.ret == 1
    assert "Only the rounding differs: tolerance=1e-09 accepts that." in text(differs)
    for tolerance, code in ((1e-10, 0), (1e-13, 1)):
        file.write_text(ONE.replace("seed=7)", f"seed=7), tolerance={tolerance}"))
        assert run().ret == code
    events[brrt.Kind.EDGE]["parent"][-1] += 1
    golden.save(doctored, kept)
    file.write_text(ONE.replace("seed=7)", "seed=7), tolerance=1.0"))
    differs = run()
    assert "parent" in text(differs)
    assert "Only the rounding" not in text(differs)


STAND_IN = """
import pytest
from brrt_cli.testing.hooks import USAGE

@pytest.fixture
def brrt_golden(request):
    folder, used = request.path.parent / "golden", request.config.stash[USAGE].used
    return lambda name: used.add(str(folder / name))
"""
"""A fixture that plans nothing: sessions with workers of their own are over in a second."""

USERS = """
import pytest

def test_one(brrt_golden):
    brrt_golden("one.mcap")

def test_two(brrt_golden):
    brrt_golden("two.mcap")

def test_other():
    pass
"""
UNUSED = ["golden/three.mcap: no test uses it; delete it"]


@pytest.fixture
def suite(pytester: pytest.Pytester) -> Path:
    """Two test files, users of a folder in which a file is left over; return the folder above."""
    pytester.makeconftest(STAND_IN)
    pytester.makepyfile(test_a=USERS, test_b="def test():\n    pass\n")
    folder = pytester.mkdir("golden")
    for name in ("one.mcap", "two.mcap", "three.mcap", ".two-17.mcap", "notes.txt"):
        (folder / name).touch()
    return pytester.path


@pytest.mark.parametrize(
    "args",
    [
        [],
        ["."],
        ["test_a.py", "test_b.py"],
        ["-n", "2", "--dist", "load"],
        ["-k", "one or two or other or test_b"],
        ["--ff"],
        ["-p", "no:cacheprovider"],
    ],
    ids=" ".join,
)
def test_unused_is_told_where_all_ran(run: Pytest, suite: Path, args: list[str]) -> None:
    """However they ran, in one process or in several."""
    result = run(*args)
    assert result.ret == 0
    assert summary(result) == UNUSED
    if "-n" not in args:
        assert run(*args, "--brrt-unused=fail").ret == 1


@pytest.mark.parametrize(
    "args",
    [
        ["-k", "one"],
        ["-k", "not other"],
        ["--deselect", "test_a.py::test_two"],
        ["test_a.py"],
        ["test_a.py::test_one", "test_b.py"],
        ["--ignore", "test_b.py"],
        ["--collect-only"],
        ["-n", "1", "-k", "one"],
        ["--setup-only"],
    ],
    ids=" ".join,
)
def test_nothing_is_claimed_of_a_part(run: Pytest, suite: Path, args: list[str]) -> None:
    """What did not run could have used it."""
    result = run(*args, "--brrt-unused=fail")
    assert result.ret == 0
    assert summary(result) == []


@pytest.mark.parametrize(
    ("change", "args"),
    [
        (("(brrt_golden):\n", "(brrt_golden):\n    1 / 0\n"), []),
        (("def test_other():\n", "def test_other():\n    1 / 0\n"), ["--lf"]),
        (('    brrt_golden("two', '    pytest.skip("no")\n    brrt_golden("two'), []),
        (("def test_two", '@pytest.mark.skip("no")\ndef test_two'), []),
        (("def test_two", "@pytest.mark.xfail(run=False)\ndef test_two"), []),
        (('    brrt_golden("two', '    import os; os._exit(3)\n    brrt_golden("two'), ["-n", "1"]),
        (("def test_other", "def test_zero():\n    1 / 0\ndef test_other"), ["-x"]),
        (("import pytest", "import nothing"), ["--continue-on-collection-errors"]),
    ],
)
def test_nothing_is_claimed_where_a_user_did_not_end(
    run: Pytest, suite: Path, change: tuple[str, str], args: list[str]
) -> None:
    """A test that failed, was skipped or crashed may have used it further on."""
    changed = USERS.replace(*change)
    assert changed != USERS
    (suite / "test_a.py").write_text(changed)
    if "--lf" in args:
        run()
    assert summary(run(*args, "--brrt-unused=fail")) == []


def test_others_may_fail_or_be_skipped(run: Pytest, suite: Path) -> None:
    """What becomes of tests that name no fixture has no bearing on it, as long as they ran."""
    changed = USERS.replace("    pass", "    pytest.skip('no')").replace(
        "def test_other", "def test_zero():\n    1 / 0\n\ndef test_other"
    )
    (suite / "test_a.py").write_text(changed)
    result = run("--brrt-unused=fail")
    result.assert_outcomes(passed=3, failed=1, skipped=1)
    assert summary(result) == UNUSED


def test_one_folder_for_all(pytester: pytest.Pytester, run: Pytest) -> None:
    """By a setting; then unused is what no test at all uses."""
    pytester.makefile(
        ".toml",
        pytest="[pytest]\nstrict = true\nfilterwarnings = ['error']\nbrrt_unused = 'fail'\n"
        "brrt_golden_dir = 'kept/runs'\ntestpaths = ['tests']\n",
    )
    for name in ("a", "b"):
        test = pytester.path / "tests" / name / f"test_{name}.py"
        test.parent.mkdir(parents=True)
        test.write_text(ONE.replace('"forest"', f'"{name}"'))
    update(run)
    folder = pytester.path / "kept" / "runs"
    assert sorted(path.name for path in folder.iterdir()) == ["a.mcap", "b.mcap"]
    assert run().ret == 0
    (folder / "c.json").write_text("{}")
    for args in ([], ["tests"], ["."]):
        result = run(*args)
        assert result.ret == 1
        assert summary(result) == ["kept/runs/c.json: no test uses it; delete it"]
    for args in (["tests/a"], ["--ignore=tests/a"], ["-k", "test_forest and a"]):
        assert summary(run(*args)) == []


def test_workers_make_the_same_file(pytester: pytest.Pytester, run: Pytest) -> None:
    """Many tests that share a file, on two workers: it is whole, and the only one."""
    body = f'    brrt_golden("shared", {SCENARIO.format(7)})\n'
    tests = "".join(f"def test_{i}(brrt_golden):\n{body}" for i in range(6))
    pytester.makepyfile(test_a=f"import brrt\n{tests}")
    assert run("--brrt-update", "-n", "2").ret == 1
    assert [path.name for path in (pytester.path / "golden").iterdir()] == ["shared.mcap"]
    assert run().ret == 0


def test_update_is_refused_in_ci_and_settings_are_checked(
    pytester: pytest.Pytester, run: Pytest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wrong use ends pytest before any test."""
    pytester.makepyfile(test_a=ONE)
    monkeypatch.setenv("CI", "true")
    refused = run("--brrt-update")
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    assert "golden files are not renewed in CI" in text(refused)
    wrong = run("-o", "brrt_unused=maybe")
    assert wrong.ret == pytest.ExitCode.USAGE_ERROR
    assert "brrt_unused must be report or fail, not 'maybe'" in text(wrong)


@pytest.mark.parametrize("name", ["brrt", "brrt_cli"])
def test_no_warning_where_it_was_imported_ahead_of_pytest(name: str) -> None:
    """Of all that a wheel with a plugin installs, pytest wants to rewrite the assertions.

    Where it is too late for that, as in a notebook, it warns, but not of packages with this mark.
    """
    assert "PYTEST_DONT_REWRITE" in (importlib.import_module(name).__doc__ or "")


QUIET = """
import sys

def test_nothing_is_loaded():
    heavy = {"brrt", "numpy", "numba", "rerun", "mcap", "yaml", "rich", "typer"}
    assert not heavy & set(sys.modules)
    assert "brrt_cli.testing.plugin" in sys.modules
"""


def test_costs_nothing_and_disturbs_no_other_plugin(pytester: pytest.Pytester, run: Pytest) -> None:
    """Whoever does not use it loads two small files, gets no warning and no line of output."""
    pytester.makepyfile(test_a=QUIET)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "pytest", "-W", "error", "-p", "no:randomly", "-q"],
        cwd=pytester.path,
        capture_output=True,
        text=True,
        check=False,
        env={k: v for k, v in os.environ.items() if not k.startswith("PYTEST")},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[0].split() == [".", "[100%]"]
    assert len(done.stdout.splitlines()) == 2
    assert not done.stderr


def test_the_example_of_the_docs(pytester: pytest.Pytester, run: Pytest) -> None:
    """It makes the two files that the text names, and passes."""
    page = (ROOT / "docs" / "testing.md").read_text()
    found = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (code,) = (block for block in found if "def test_" in block)
    pytester.makepyfile(test_readme=code)
    update(run)
    names = sorted(path.name for path in (pytester.path / "golden").iterdir())
    assert names == ["forest.json", "forest.mcap"]
    assert run("--brrt-unused=fail").ret == 0


def test_the_recipe_for_ci(
    pytester: pytest.Pytester, run: Pytest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is YAML of the form that a workflow has, and its commands do what the page says."""
    page = (ROOT / "docs" / "ci.md").read_text()
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    workflow = yaml.safe_load(block)
    (job,) = workflow["jobs"].values()
    steps = {
        step.get("name", step.get("uses", "").partition("@")[0]): step for step in job["steps"]
    }
    assert all("@v" in step["uses"] for step in job["steps"] if "uses" in step)
    assert steps["actions/cache"]["with"]["path"] == job["env"]["BRRT_CACHE_DIR"].rpartition("/")[2]
    assert steps["actions/upload-artifact"]["with"]["path"] == "failed"
    bash = shutil.which("bash")
    assert bash is not None
    for step in job["steps"]:
        subprocess.run([bash, "-n", "-c", step.get("run", "")], check=True)
    file = pytester.makepyfile(test_a=ONE)
    update(run)
    file.write_text(ONE.replace("seed=7", "seed=8"))
    assert run(*steps["Test"]["run"].split()[1:]).ret == 1
    # As a runner does it, with the command of this environment on the path.
    command = pytester.mkdir("bin") / "brrt"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m brrt_cli "$@"\n')
    command.chmod(0o755)
    monkeypatch.setenv("PATH", f"{command.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(pytester.path / "summary.md"))
    subprocess.run([bash, "-e", "-c", steps["Report what changed"]["run"]], check=True)
    failed = pytester.path / "failed"
    told = (pytester.path / "summary.md").read_text()
    assert told == (failed / "report.md").read_text()
    headline = "a different run from event 2 on"
    assert told.startswith(f"### golden/forest\n```\n{headline}\nA  golden/forest.mcap\n")
    assert "The first difference is event 2" in told
    assert brrt.read(failed / "golden" / "forest.rrd").manifest.scenario.seed == 8
    assert "failed/report.md" in steps["Comment"]["run"]
