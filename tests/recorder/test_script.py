"""`brrt record`: scripts run as Python runs them, and what their planners do is recorded."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from brrt import BrrtError, Kind, explain, forest, metrics, read, snapshot, verify
from brrt.recorder.adapters import ADAPTERS, Adapter, Solves
from brrt.recorder.adapters.classes import DECORATOR, announced, compile_script, when_defined
from brrt.recorder.adapters.imports import when_imported
from tests.conftest import Result

EXAMPLE = Path(__file__).parents[2] / "examples" / "rrt_classes.py"

Command = Callable[..., Result]

PRINTS_ITS_TREE = """
import json, random, sys
from planners import OBSTACLES, RRT, RRTStar

class Replacing(RRTStar):
    '''Puts another node into the list where it rewires; children keep the former one.'''
    def rewire(self, new, around):
        for node in around:
            edge = self.steer(new, node)
            edge.cost = new.cost + self.length(new, node)
            if edge.cost < node.cost and self.is_free(edge):
                self.node_list[self.node_list.index(node)] = edge

class Indexed(RRT):
    '''Nodes have the row of their parent.'''
    def steer(self, from_node, to_node, most=float('inf')):
        new = super().steer(from_node, to_node, most)
        new.parent = self.node_list.index(from_node)
        return new
    def way_back(self, node):
        path = [[node.x, node.y]]
        while node.parent is not None:
            node = self.node_list[node.parent]
            path.append([node.x, node.y])
        return [[self.end.x, self.end.y], *path]

random.seed(4)
kind = {'RRT': RRT, 'RRTStar': RRTStar, 'Replacing': Replacing, 'Indexed': Indexed}[sys.argv[1]]
planner = kind([0, 0], [9, 10], OBSTACLES, [-1, 11], robot_radius=0.2, max_iter=200)
path = planner.planning()
rows = {id(node): row for row, node in enumerate(planner.node_list)}
places = [(node.x, node.y) for node in planner.node_list]
def row(node):
    if node is None or isinstance(node, int):
        return -1 if node is None else node
    return rows[id(node)] if id(node) in rows else places.index((node.x, node.y))
json.dump([places, [row(node.parent) for node in planner.node_list], path], sys.stdout)
"""

REPORTS = """
import sys
print(sys.argv, sys.path[0], __name__, __file__, __package__, __spec__ and __spec__.name)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, brrt: Command) -> Iterator[Path]:
    """A folder with our example as a module; what a script changes in this process is undone."""
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    monkeypatch.setitem(sys.modules, "__main__", sys.modules["__main__"])
    before = set(sys.modules)
    shutil.copy(EXAMPLE, tmp_path / "planners.py")
    yield tmp_path
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def as_python(folder: Path, *args: str) -> Result:
    """Run the same without brrt."""
    done = subprocess.run([sys.executable, *args], capture_output=True, cwd=folder, check=False)
    return Result(done.returncode, done.stdout.decode(), done.stderr.decode())


@pytest.mark.parametrize("kind", ["RRT", "RRTStar", "Replacing", "Indexed"])
def test_the_recording_is_what_the_planner_did(kind: str, folder: Path, brrt: Command) -> None:
    """The last tree is its list of nodes, the path is its path, and it does the same unrecorded."""
    (folder / "tree.py").write_text(PRINTS_ITS_TREE)
    done = brrt("record", "tree.py", kind)
    assert done.code == 0, done.err
    assert done.out == as_python(folder, "tree.py", kind).out
    places, parents, path = json.loads(done.out)
    recording = read("tree-1.mcap")
    tree = forest(recording.events())[0]
    assert tree.q.tolist() == places
    assert tree.parent.tolist() == parents
    found = metrics(recording).as_dict()
    assert found["path"] == path[::-1]
    log = recording.events()
    assert found["iterations"] == len(log[Kind.SAMPLE])
    assert len(log[Kind.REJECT])
    assert (found["rewires"] > 0) == (kind in ("RRTStar", "Replacing"))
    assert recording.manifest.scenario.planner == kind
    assert recording.manifest.scenario.params["max_iter"] == 200
    assert recording.world.balls[:, 2].tolist() == pytest.approx([1.2, 1.6, 1.6, 1.0, 0.7, 0.7])
    line = f"brrt: tree-1.mcap: {len(recording.events()):,} events, solved, path cost"
    assert done.err.startswith(line)
    judged = verify(recording)
    assert {each.rule for each in judged.results if each.broken} <= {
        "edges free", "rewires free", "paths free",
    }  # fmt: skip
    assert str(explain(recording))
    assert snapshot(recording, iteration=20).forest


def test_verify_finds_the_corners_that_its_check_cuts(folder: Path, brrt: Command) -> None:
    """The example checks points on the way; the geometry of brrt checks the way."""
    assert brrt("record", "planners.py", "--star").code == 0
    found = brrt("verify", "planners-1.mcap")
    assert found.code == 1
    assert "edges free" in found.out
    assert re.search(r"hits ball \d+ at\s+\(", found.out)


def test_each_solve_is_a_recording(folder: Path, brrt: Command) -> None:
    """In a folder that is made; another run does not overwrite them unless it may."""
    run = ("record", "--out", "deep/runs", "planners.py", "--solves", "2")
    done = brrt(*run)
    names = ["deep/runs/planners-1.mcap", "deep/runs/planners-2.mcap"]
    assert [line.split()[1].rstrip(":") for line in done.err.splitlines()] == names
    again = brrt(*run)
    assert again.code == 2
    assert "planners-1.mcap: exists already" in again.err
    assert brrt("record", "--force", *run[1:]).code == 0
    assert brrt("diff", *names).code == 1


@pytest.mark.parametrize("args", [["script.py", "-m", "--out", "x"], ["-m", "pkg", "--force"]])
def test_a_script_sees_what_python_shows_it(args: list[str], folder: Path, brrt: Command) -> None:
    """Its arguments, its name, its folder, and its streams without escapes."""
    text = f"{REPORTS}\nprint('\\x1b[1mbold\\r')\nsys.exit('words\\x1b[0m')"
    (folder / "pkg").mkdir()
    (folder / "pkg" / "__init__.py").write_text("")
    for name in ("script.py", "pkg/__main__.py"):
        (folder / name).write_text(text)
    done, expected = brrt("record", *args), as_python(folder, *args)
    assert (done.code, done.out, done.err) == (1, expected.out, expected.err)


def test_an_exception_shows_the_script_s_own_traceback(folder: Path, brrt: Command) -> None:
    """Also where brrt's hooks are between its functions; what was recorded is kept."""
    (folder / "fails.py").write_text(
        "from planners import *\n"
        "class Fails(RRT):\n"
        "    def get_nearest_node_index(self, nodes, drawn):\n"
        "        if len(nodes) > 5:\n"
        "            raise ValueError('mine')\n"
        "        return super().get_nearest_node_index(nodes, drawn)\n"
        "try:\n"
        "    Fails([0, 0], [9, 10], [], [-1, 11]).planning()\n"
        "except ValueError as error:\n"
        "    raise RuntimeError('outer') from error\n"
    )
    done, expected = brrt("record", "fails.py"), as_python(folder, "fails.py")
    lines = done.err.splitlines()
    assert done.code == expected.code == 1
    assert lines[:-1] == expected.err.splitlines()
    assert lines[-1].startswith("brrt: fails-1.mcap: ")
    assert lines[-1].endswith("events, interrupted")
    assert verify(read("fails-1.mcap")).holds


def test_a_syntax_error_is_the_script_s(folder: Path, brrt: Command) -> None:
    """As Python shows it."""
    (folder / "wrong.py").write_text("def f(:\n")
    done, expected = brrt("record", "wrong.py"), as_python(folder, "wrong.py")
    assert (done.code, done.err) == (1, expected.err)


def test_ctrl_c_closes_the_recording(folder: Path, brrt: Command) -> None:
    """The script gets it as Python gives it."""
    (folder / "stops.py").write_text(
        "import planners\n"
        "class Stops(planners.RRT):\n"
        "    def way_back(self, node):\n"
        "        raise KeyboardInterrupt\n"
        "Stops([0, 0], [9, 10], [], [-1, 11]).planning()\n"
    )
    done = brrt("record", "stops.py")
    assert done.code == 130
    assert "KeyboardInterrupt" in done.err
    assert done.err.splitlines()[-1].endswith("events, interrupted")


@pytest.mark.parametrize(
    ("args", "why"),
    [
        (["none.py"], "none.py: no solve was recorded; brrt record --list names"),
        (["gone.py"], "gone.py: no such file; name a Python script"),
        (["-m", "gone.py"], "-m gone.py: No module named 'gone'"),
        (["-m", "json.decoder.x"], "-m json.decoder.x: "),
        (["-m", "sys"], "-m sys: there is no such module"),
        (["--adaptor", "x", "none.py"], "unknown option --adaptor; options of the script follow"),
        (["--adapter", "rrt", "none.py"], "unknown adapter 'rrt'; did you mean 'rrt-classes'?"),
        (["--out", "none.py", "none.py"], "--out none.py: "),
        ([], "name a script"),
    ],
)
def test_what_cannot_be_recorded(args: list[str], why: str, folder: Path, brrt: Command) -> None:
    """One line, and exit code 2."""
    (folder / "none.py").write_text("")
    done = brrt("record", *args)
    assert done.code == 2
    assert why in done.err
    assert len(done.err.splitlines()) == 1


def test_a_script_that_records_by_itself(folder: Path, brrt: Command) -> None:
    """It needs no adapter."""
    (folder / "own.py").write_text(
        "import brrt\n"
        "with brrt.record('mine.mcap', start=[0, 0], goal=[1, 1]) as rec:\n"
        "    rec.edge([0, 0])\n"
    )
    assert brrt("record", "own.py").code == 0
    assert brrt("verify", "mine.mcap").code == 0


def test_a_script_that_fails_keeps_its_exit_code(folder: Path, brrt: Command) -> None:
    """Also where nothing was recorded."""
    (folder / "seven.py").write_text("raise SystemExit(7)")
    done = brrt("record", "seven.py")
    assert (done.code, done.err) == (7, "")


def test_the_adapters_are_listed(brrt: Command) -> None:
    """With what they recognize."""
    done = brrt("record", "--list")
    assert done.code == 0
    assert all(name in done.out for name in ADAPTERS.own)
    assert all(issubclass(kind, Adapter) for kind in ADAPTERS.own.values())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("self.node_list = [self.start]", "Odd.planning is not recorded: node_list lost nodes"),
        ("del self.start.parent", "Odd.planning is not recorded: AttributeError"),
        ("self.obstacle_list = [(0, 0, 1)]", "the world of Odd.planning is not recorded: start"),
        ("self.obstacle_list = {1: 2}", "the world of Odd.planning is not recorded: "),
    ],
)
def test_an_error_of_the_recording_never_reaches_the_script(
    change: str, says: str, folder: Path, brrt: Command
) -> None:
    """It is one line; without a world the rest is recorded all the same."""
    (folder / "odd.py").write_text(
        "from planners import *\n"
        "class Odd(RRT):\n"
        "    def get_random_node(self):\n"
        f"        if len(self.node_list) == {5 if 'node_list' in change else 1}:\n"
        f"            {change}\n"
        "        return self.Node(random.random(), random.random())\n"
        "    def steer(self, *given):\n"
        "        return self.Node(1, 1)\n"
        "    def is_free(self, node):\n"
        "        return True\n"
        "print(Odd([0, 0], [9, 10], [], [-1, 11], max_iter=40).planning())\n"
    )
    done = brrt("record", "odd.py")
    assert done.out == "None\n"
    assert done.err.splitlines()[0].startswith(f"brrt: {says}")
    assert done.code == 0


def test_a_child_process_is_not_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would write its parent's files."""
    solves = Solves(tmp_path, "x", lambda _: None)
    assert solves.next_file() == tmp_path / "x-1.mcap"
    monkeypatch.setattr("os.getpid", lambda: -1)
    with pytest.raises(BrrtError, match="child process"):
        solves.open(dof=2, start=[0, 0], goal=[1, 1])


@pytest.mark.parametrize("curve", ["new.yaw = 0.0", "new.path_y[1:-1] = [9] * len(new.path_y[2:])"])
def test_curved_motions_are_claimed(curve: str, folder: Path, brrt: Command) -> None:
    """Their ends alone are recorded, so verify judges neither what is between them nor bounds."""
    (folder / "curves.py").write_text(
        "from planners import *\n"
        "class Curves(RRT):\n"
        "    def steer(self, *given):\n"
        "        new = super().steer(*given)\n"
        f"        {curve}\n"
        "        return new\n"
        "    def way_back(self, node):\n"
        "        return True, [1.0, 2.0]\n"
        "random.seed(1)\n"
        "Curves([0, 0], [9, 10], [], [-1, 11]).planning()\n"
    )
    done = brrt("record", "curves.py")
    assert done.code == 0
    assert "the path of Curves.planning is not recorded: planning returned no points" in done.err
    recording = read("curves-1.mcap")
    assert recording.manifest.claims.motions == "own"
    assert not recording.world.bounded
    assert "the recording claims motions: own" in verify(recording).not_judged
    assert verify(recording).holds


def test_compiled_scripts_announce_their_classes() -> None:
    """After all decorators, with the lines and the docstring as they are."""
    text = (
        '"""Doc."""\nfrom __future__ import annotations\nfrom dataclasses import dataclass\n'
        "@dataclass(slots=True)\nclass A:\n    x: NoSuchType = 1\n"
        "def f():\n    class B(A): pass\n    return B\nB = f()\nwrong = None + 1\n"
    )
    names: list[str] = []
    end = when_defined(lambda kind: names.append(f"{kind.__qualname__} {kind.__dict__.keys()}"))
    scope: dict[str, Any] = {"__name__": __name__, DECORATOR: announced}
    with pytest.raises(TypeError) as caught:
        exec(compile_script(text, "m.py"), scope)  # noqa: S102 - our own text
    end()
    assert [name.split()[0] for name in names] == ["A", "f.<locals>.B"]
    assert "__slots__" in names[0]
    assert scope["__doc__"] == "Doc."
    assert caught.traceback[-1].lineno == 10
    assert announced(int) is int
    assert len(names) == 2


def test_modules_call_back_when_they_are_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each import calls back once, that of a loaded module at once, and none after the end."""
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("late_one", "late_two"):
        (tmp_path / f"{name}.py").write_text("class A: pass\nfrom math import pi\n")
    seen: list[str] = []
    ends = [
        when_imported("late_one", lambda module: seen.append(f"1 {module.A.__name__}")),
        when_imported("late_one", lambda module: seen.append(f"2 {module.pi:.2f}")),
        when_imported("json", lambda module: seen.append(module.__name__)),
        when_defined(lambda kind: seen.append(kind.__module__)),
    ]
    __import__("late_one")
    assert sorted(seen) == ["1 A", "2 3.14", "json", "late_one"]
    for end in ends:
        end()
    __import__("late_two")
    assert len(seen) == 4
    for name in ("late_one", "late_two"):
        del sys.modules[name]


def test_hooks_are_taken_out_again(tmp_path: Path) -> None:
    """The classes are as they were."""
    scope: dict[str, Any] = {"__name__": "m", DECORATOR: announced}
    solves = Solves(tmp_path, "x", lambda _: None)
    undo = ADAPTERS["rrt-classes"]().install(solves)
    exec(compile_script(EXAMPLE.read_text(), "m.py"), scope)  # noqa: S102 - our own text
    kind = scope["RRT"]
    assert hasattr(kind.planning, "__brrt__")
    assert isinstance(vars(kind)["check_collision"], staticmethod)
    undo()
    assert not hasattr(kind.planning, "__brrt__")
    assert kind([0, 0], [9, 10], [], [-1, 11]).planning()
    assert not solves.files
