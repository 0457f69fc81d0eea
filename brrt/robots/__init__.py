"""Robots in numpy: one file and one line here for each, and its counterpart in kernels/spaces."""

import json
from pathlib import Path

from brrt.errors import BrrtError, unknown
from brrt.files import is_file, read_text
from brrt.registry import Registry
from brrt.robots.arm import Arm
from brrt.robots.chain import Chain
from brrt.robots.opaque import Opaque
from brrt.robots.point import Point
from brrt.robots.polygon import Polygon
from brrt.robots.robot import SCHEMA, VERSION, Robot
from brrt.robots.urdf import load_arm, split_urdf
from brrt.settings import parse_pairs

ROBOTS: Registry[type[Robot]] = Registry(
    {
        "point": "brrt.robots.point:Point",
        "polygon": "brrt.robots.polygon:Polygon",
        "chain": "brrt.robots.chain:Chain",
        "arm": "brrt.robots.arm:Arm",
        "opaque": "brrt.robots.opaque:Opaque",
    },
    group="brrt.robots",
    base="brrt.robots.robot:Robot",
    label="kind",
)

_MAX_BYTES = 16_000_000


def make_robot(spec: str) -> Robot:
    """Make a robot from its specification.

    Args:
        spec: A name with parameters, such as `polygon:length=4,width=2`, a JSON file, or a URDF
            with the ends of the chain, such as `arm.urdf:base=base_link,tip=tool0`.

    Raises:
        BrrtError: The robot is unknown, or a parameter is invalid.
    """
    if names_robot_file(spec):
        urdf = split_urdf(spec)
        return load_robot(Path(spec)) if urdf is None else load_arm(Path(urdf[0]), urdf[1])
    name, _, rest = spec.partition(":")
    if name not in ROBOTS:
        raise unknown("robot", name, ROBOTS)
    return ROBOTS[name].parse(f"robot {name}", parse_pairs(f"robot {spec}", rest))


def names_robot_file(spec: str) -> bool:
    """Whether a specification names a file, which need not exist."""
    if spec.partition(":")[0] in ROBOTS:
        return False
    return _is_marked(spec) or (bool(spec) and is_file(spec))


def mark_robot_file(spec: str) -> str:
    """Return the specification of a file so that it differs from a robot's name."""
    return spec if _is_marked(spec) else f"./{spec}"


def _is_marked(spec: str) -> bool:
    return spec.endswith(".json") or "/" in spec or split_urdf(spec) is not None


def load_robot(path: Path) -> Robot:
    """Read a robot from a JSON file.

    Raises:
        BrrtError: The file cannot be read, or does not define a robot.
    """
    text = read_text(path, "a robot", _MAX_BYTES)
    try:
        return robot_from_json(text)
    except BrrtError as error:
        raise BrrtError(f"{path}: {error}") from None


def robot_from_json(text: str) -> Robot:
    """Read the text that `Robot.to_json` wrote.

    Raises:
        BrrtError: The text does not define a robot.
    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BrrtError(f"not a JSON robot: {error}") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise BrrtError(f'not a brrt robot: the field "schema" must be "{SCHEMA}"')
    if data.get("version") != VERSION:
        raise BrrtError(f"robot version {data.get('version')!r} is not {VERSION}; update brrt")
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in ROBOTS:
        why = unknown("kind of robot", str(kind), ROBOTS)
        raise BrrtError(f"{why}; if it is a plug-in's, install its package")
    known = ("schema", "version", "kind", "name")
    return ROBOTS[kind].from_definition({k: v for k, v in data.items() if k not in known})


__all__ = [
    "ROBOTS",
    "Arm",
    "Chain",
    "Opaque",
    "Point",
    "Polygon",
    "Robot",
    "load_robot",
    "make_robot",
    "mark_robot_file",
    "names_robot_file",
    "robot_from_json",
]
