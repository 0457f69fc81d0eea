"""Arms from URDF files: kinematics, limits, hostile files, and one recording end to end."""

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brrt as package
from brrt.errors import BrrtError
from brrt.robots import Arm, make_robot, robot_from_json
from brrt.worlds.world import World

CELL = World("cell", lower=np.full(3, -2.0), upper=np.full(3, 2.0))
EXAMPLES = Path(__file__).parents[2] / "examples"
LINKS = "".join(f'<link name="{name}"/>' for name in "abcd")


def joint(
    name: str = "j", parent: str = "a", child: str = "b", kind: str = "revolute",
    inside: str = "", limit: str = "-1 1",
) -> str:  # fmt: skip
    """Return the text of a joint."""
    lower, upper = limit.split()
    bounds = (
        f'<limit lower="{lower}" upper="{upper}"/>' if kind in ("revolute", "prismatic") else ""
    )
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{inside}{bounds}</joint>"
    )


def written(folder: Path, *joints: str, links: str = LINKS) -> str:
    """Write a URDF and return its name."""
    file = folder / "arm.urdf"
    file.write_text(f'<robot name="r">{links}{"".join(joints)}</robot>')
    return str(file)


def make_arm(spec: str) -> Arm:
    """Make a robot that is an arm."""
    arm = make_robot(spec)
    assert isinstance(arm, Arm)
    return arm


def slow_tip(arm: Any, q: Any) -> Any:
    """Multiply homogeneous matrices, one joint after another, as scalars."""
    at, values = np.eye(4), iter(q)
    for each in arm.joints:
        (r, p, y), value = each.rpy, 0.0 if each.type == "fixed" else next(values)
        x = np.array([[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]])
        yy = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
        z = np.array([[math.cos(y), -math.sin(y), 0], [math.sin(y), math.cos(y), 0], [0, 0, 1]])
        origin, move = np.eye(4), np.eye(4)
        origin[:3, :3], origin[:3, 3] = z @ yy @ x, each.xyz
        if each.type == "prismatic":
            move[:3, 3] = value * np.array(each.axis)
        elif each.type != "fixed":
            half = value / 2  # a unit quaternion, which shares nothing with Rodrigues' formula
            w, (i, j, k) = math.cos(half), math.sin(half) * np.array(each.axis)
            move[:3, :3] = [
                [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
                [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
                [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
            ]
        at = at @ origin @ move
    return at


@pytest.mark.parametrize("name", ["arm6", "arm7"])
def test_forward_kinematics_equal_products_of_matrices(name: str) -> None:
    """Frames of the tip are those of homogeneous matrices that are multiplied one by one."""
    arm = make_robot(str(EXAMPLES / f"{name}.urdf"))
    assert isinstance(arm, Arm)
    Q = np.random.default_rng(0).uniform(*arm.bounds(CELL), (50, len(arm.moving)))
    origins, rotations = arm.forward(Q)
    for q, origin, rotation in zip(Q, origins[:, -1], rotations[:, -1], strict=True):
        wanted = slow_tip(arm, q)
        np.testing.assert_allclose(origin, wanted[:3, 3], atol=1e-12)
        np.testing.assert_allclose(rotation, wanted[:3, :3], atol=1e-12)


def test_a_tilted_skew_joint_moves_as_its_matrix(tmp_path: Path) -> None:
    """An axis that is no unit vector, and an origin that is turned about all axes."""
    inside = '<origin xyz="1 2 3" rpy="0.3 -0.4 0.5"/><axis xyz="1 2 -2"/>'
    arm = make_robot(
        written(tmp_path, joint(inside=inside), joint("k", "b", "c", "prismatic", inside))
    )
    q = np.array([0.7, 0.2])
    np.testing.assert_allclose(arm.places(q[None])[0], slow_tip(arm, q)[:3, 3], atol=1e-12)


def test_a_planar_arm_has_the_tip_that_trigonometry_gives(tmp_path: Path) -> None:
    """Two links in the plane: a textbook case."""
    axis = '<axis xyz="0 0 1"/>'
    out = f'<origin xyz="2 0 0"/>{axis}'
    end = joint("end", "c", "d", "fixed", '<origin xyz="1 0 0"/>')
    arm = make_robot(written(tmp_path, joint(inside=axis), joint("k", "b", "c", inside=out), end))
    tip = arm.places(np.array([[0.3, 0.4]]))[0]
    wanted = [2 * math.cos(0.3) + math.cos(0.7), 2 * math.sin(0.3) + math.sin(0.7), 0]
    np.testing.assert_allclose(tip, wanted, atol=1e-12)
    assert arm.skeleton(np.zeros((3, 2))).shape == (3, 4, 3)


def test_continuous_joints_wrap_and_the_others_do_not() -> None:
    """The metric takes the short way round for continuous joints alone."""
    arm = make_robot(str(EXAMPLES / "arm7.urdf"))
    assert isinstance(arm, Arm)
    assert arm.coordinates(CELL)[:3] == ("rail", "pan", "lift")
    assert arm.wraps.tolist() == [False, True, False, False, False, False, True]
    a, b = np.zeros(7), np.zeros(7)
    a[1], b[1] = 3.0, -3.0
    assert arm.distance(a, b) == pytest.approx(2 * math.pi - 6)
    assert abs(arm.interpolate(a, b, 0.5)[1]) == pytest.approx(math.pi)
    a[2], b[2] = 1.5, -1.5
    assert arm.distance(a, b) == pytest.approx(math.hypot(2 * math.pi - 6, 3))
    assert arm.canonical(a + 2 * math.pi)[1] == pytest.approx(3.0)


def test_the_chain_is_the_longest_or_the_named_one(tmp_path: Path) -> None:
    """Among chains of one length the first of the file is taken."""
    more = joint("j", "a", "b"), joint("k", "b", "c"), joint("side", "b", "d")
    file = written(tmp_path, joint("k", "b", "c"), joint("j", "a", "b"), joint("side", "c", "d"))
    assert make_robot(file).coordinates(CELL) == ("j", "k", "side")
    assert make_robot(f"{file}:tip=c").coordinates(CELL) == ("j", "k")
    assert make_robot(f"{file}:base=b,tip=d").coordinates(CELL) == ("k", "side")
    assert make_robot(f"{file}:base=c").coordinates(CELL) == ("side",)
    file = written(tmp_path, *more)
    assert make_arm(file).tip == "c"  # the first of two of the same length
    assert make_robot(f"{file}:tip=d").coordinates(CELL) == ("j", "side")


def test_mimic_joints_end_the_chain(tmp_path: Path) -> None:
    """A tip beyond one is refused, with the link to choose."""
    finger = joint("finger", "b", "c", "prismatic", '<mimic joint="j"/>')
    file = written(tmp_path, joint(), finger)
    assert make_arm(file).tip == "b"
    with pytest.raises(BrrtError, match=r"joint 'finger' mimics 'j'.*tip=b"):
        make_robot(f"{file}:tip=c")


@pytest.mark.parametrize(
    ("joints", "options", "said"),
    [
        ([joint(limit="1 -1")], "", r"joint 'j' limits 1 and -1 must rise"),
        ([joint(limit="nan 1")], "", "joint 'j' limits must be 2 finite numbers"),
        ([joint().replace("<limit lower", "<safety lower")], "", "must state lower and upper"),
        ([joint(inside='<axis xyz="0 0 0"/>')], "", "joint 'j' axis must not be 0 0 0"),
        ([joint(inside='<origin xyz="1 2"/>')], "", "joint 'j' xyz must be 3 finite numbers"),
        ([joint(inside='<origin rpy="1 2 x"/>')], "", "joint 'j' rpy must be 3 finite numbers"),
        ([joint(child="z")], "", "joint 'j': its child is link 'z', which is not defined"),
        ([joint(), joint("k", "c", "b")], "", "'j' and 'k' have the same child 'b'"),
        ([joint(), joint("k", "b", "a")], "", "closes a loop"),
        ([joint(), joint("j", "b", "c")], "", "joint 'j' is there twice"),
        ([joint(kind="fixed")], "", "no chain of joints that move"),
        ([joint(kind="floating")], "base=a,tip=b", "type 'floating'; choose a base after it"),
        ([joint()], "tip=e", "unknown link 'e'"),
        ([joint()], "top=b", "unknown parameter"),
        ([joint()], "base=c,tip=b", "no joints lead from base 'c' to tip 'b'"),
        ([], "", "no chain of joints"),
    ],
)
def test_errors_name_file_element_and_value(
    tmp_path: Path, joints: list[str], options: str, said: str
) -> None:
    """Each in one line."""
    file = written(tmp_path, *joints)
    with pytest.raises(BrrtError, match=said) as error:
        make_robot(f"{file}:{options}")
    assert "arm.urdf" in str(error.value)
    assert "\n" not in str(error.value)


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{LAUGHS}<robot name='&b;'/>", "<!DOCTYPE> is refused"),
        ('<!doctype x SYSTEM "file:///etc/passwd"><robot/>', "is refused"),
        ('<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot>&e;</robot>', "is refused"),
        ("<robot>&e;</robot>", "not XML: undefined entity"),
        ("<a>" * 100_000, "more than 32 elements within each other"),
        ("<robot>" + "<a/>" * 200_001 + "</robot>", "or 200,000 in all"),
        ("<robot>" + " " * 8_000_000 + "</robot>", "a URDF has at most 8,000,000"),
        ('<robot xmlns:xacro="x"><link name="a"/></robot>', "no chain"),
        ('<x xmlns:xacro="x"/>', "root element is 'x', not 'robot'; expand it by xacro"),
        ('<?xml version="1.0" encoding="no-such"?><robot/>', "no chain|not XML"),
        ("<robot>\x00</robot>", "not a text file"),
        ("", "not XML: no element found"),
    ],
)
def test_hostile_files_are_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    """Nothing is expanded, opened or nested deeply."""
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    with pytest.raises(BrrtError, match=said) as error:
        make_robot(str(file))
    assert "\n" not in str(error.value)
    assert "root:" not in str(error.value)


def test_no_mesh_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh that cannot be read does not matter."""
    mesh = (
        '<link name="m"><visual><geometry><mesh filename="secret.stl"/></geometry></visual></link>'
    )
    written(tmp_path, joint(), links=LINKS + mesh)
    (tmp_path / "secret.stl").mkdir()
    monkeypatch.chdir(tmp_path)
    assert make_arm("arm.urdf").tip == "b"


def test_definitions_are_read_as_they_were_written() -> None:
    """Bit for bit."""
    for name in ("arm6", "arm7"):
        arm = make_robot(str(EXAMPLES / f"{name}.urdf"))
        assert robot_from_json(arm.to_json()) == arm


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("joints", [], "1 to 256 joints"),
        ("joints", {}, "1 to 256 joints"),
        ("joints", [3], "must be an object"),
        ("base", 7, "base must be a name"),
        ("drawn", 4, "drawn must be at most 3"),
    ],
)
def test_damaged_definitions_are_refused(field: str, value: object, said: str) -> None:
    """As a recording may contain them."""
    data = json.loads(make_robot(str(EXAMPLES / "arm6.urdf")).to_json())
    with pytest.raises(BrrtError, match=said):
        robot_from_json(json.dumps(data | {field: value}))


def recorded(folder: Path, middle: float = 0.5, name: str = "run.mcap") -> Path:
    """Record two motions of an arm whose file is gone afterwards."""
    file = written(folder, joint(inside='<axis xyz="0 0 1"/>'), joint("k", "b", "c", "continuous",
                   '<origin xyz="1 0 0"/><axis xyz="0 1 0"/>'),
                   joint("end", "c", "d", "fixed", '<origin xyz="1 0 0"/>'))  # fmt: skip
    start, goal = [-0.5, 0.0], [0.5, 1.0]
    with package.record(folder / name, robot=file, start=start, goal=goal) as rec:
        rec.edge([-0.5, 0.0])
        rec.iteration = 1
        rec.sample([middle, 0.2])
        rec.edge([middle, 0.2], 0)
        rec.iteration = 2
        rec.edge([0.5, 1.0], 1)
        rec.path([[-0.5, 0.0], [middle, 0.2], [0.5, 1.0]])
    Path(file).unlink()
    return folder / name


def test_a_recording_needs_no_file(tmp_path: Path) -> None:
    """The manifest has the joints, and all readers work from it."""
    recording = package.read(recorded(tmp_path))
    assert isinstance(recording.robot(), Arm)
    assert recording.world.inside([0, 0, 0])  # the base is within what is drawn
    assert recording.robot().coordinates(CELL) == ("j", "k")
    found = package.verify(recording)
    assert not found.findings
    assert package.snapshot(recording).forest[0].q.shape == (3, 2)
    assert "solved" in str(package.explain(recording))


def test_a_broken_joint_limit_is_found(tmp_path: Path) -> None:
    """The one rule that is broken is bounds."""
    findings = package.verify(package.read(recorded(tmp_path, middle=1.5))).findings
    assert {finding.rule for finding in findings} == {"bounds"}


def test_an_end_beyond_the_limits_names_the_joint(tmp_path: Path) -> None:
    """Before a file is written."""
    file = written(tmp_path, joint())
    with pytest.raises(BrrtError, match=r"start 2 has joint j at 2, beyond its limits -1 to 1"):
        package.record(tmp_path / "run.mcap", robot=file, start=[2.0], goal=[0.0])


def test_motions_are_drawn_as_curves() -> None:
    """A turn about the vertical keeps the distance from it."""
    arm = make_robot(str(EXAMPLES / "arm6.urdf"))
    path = np.array([[0, 1, 0, 0, 0, 0], [2, 1, 0, 0, 0, 0]], float)
    trail = arm.trail(path)
    np.testing.assert_allclose(np.hypot(*trail.T[:2]), np.hypot(*trail[0, :2]))
    assert len(trail) > 10


def test_the_commands_read_a_recording_of_an_arm(tmp_path: Path, brrt: Callable[..., Any]) -> None:
    """Each reads the one recording."""
    one, other = recorded(tmp_path), recorded(tmp_path, 0.4, "other.mcap")
    for words in (("replay",), ("verify",), ("plot", "--out", "run.svg"),
                  ("export", "--foxglove", "viz.mcap")):  # fmt: skip
        assert brrt(words[0], one, *words[1:]).code == 0
    assert brrt("diff", one, other).code == 1
    assert "solved" in brrt("explain", one).out


def test_an_arm_cannot_plan_and_the_message_says_what_can(brrt: Callable[..., Any]) -> None:
    """Before start and goal are asked for."""
    done = brrt("plan", "--robot", EXAMPLES / "arm6.urdf")
    assert done.code == 2
    assert "robot arm cannot plan" in done.err
    assert "brrt.record" in done.err


def test_the_example_plans_and_records(tmp_path: Path) -> None:
    """Its recording breaks no rule."""
    subprocess.run([sys.executable, EXAMPLES / "arm_rrt.py"], cwd=tmp_path, check=True)
    recording = package.read(tmp_path / "arm_rrt.mcap")
    assert not package.verify(recording).findings
    assert recording.robot().coordinates(CELL)[0] == "pan"
