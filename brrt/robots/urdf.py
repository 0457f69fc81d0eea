"""Arms from URDF files: a small subset, read without opening any other file.

Read are joints with their origin, axis and limits. Links are only names here: visuals, collisions,
meshes and inertias are ignored. See https://wiki.ros.org/urdf/XML/joint.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from brrt.errors import BrrtError, unknown
from brrt.files import read_text
from brrt.robots.arm import CONTINUOUS, FIXED, TYPES, Arm, ArmJoint, joint_of, name_of
from brrt.settings import parse_pairs

_MOST_BYTES = 8_000_000
_DEEPEST, _MOST_ELEMENTS = 32, 200_000
_SPEC = re.compile(r"(?s)(.*\.urdf)(?::([^/]*))?", re.IGNORECASE)
_FORBIDDEN = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


class _Link(NamedTuple):
    """A joint of a file between the names of two links."""

    joint: ET.Element
    name: str
    parent: str
    child: str

    @property
    def follows(self) -> bool:
        """Whether an arm may have it: it has one value or none, and that is its own."""
        return self.joint.get("type") in TYPES and self.joint.find("mimic") is None


def split_urdf(spec: str) -> tuple[str, str] | None:
    """Split `arm.urdf:tip=tool0` into file and parameters; None if it names no URDF."""
    found = _SPEC.fullmatch(spec)
    return None if found is None else (found[1], found[2] or "")


def load_arm(path: Path, options: str = "") -> Arm:
    """Read an arm from a URDF.

    Args:
        path: The file.
        options: `base=LINK,tip=LINK`, either or none. By default it is the chain with the most
            joints that move, the first of several.

    Raises:
        BrrtError: The file cannot be read, is no URDF, or has no such chain.
    """
    values = parse_pairs(f"robot {path}", options)
    for name in values:
        if name not in ("base", "tip"):
            raise unknown(f"parameter of robot {path}", name, ("base", "tip"))
    text = read_text(path, "a URDF", _MOST_BYTES)
    try:
        return _arm(_parse(text), values)
    except BrrtError as error:
        raise BrrtError(f"{path}: {error}") from None


class _Builder(ET.TreeBuilder):
    """Builds a tree of bounded depth and size."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._count = 0

    def start(self, tag: Any, attrs: Any) -> Any:
        self._depth, self._count = self._depth + 1, self._count + 1
        if self._depth > _DEEPEST or self._count > _MOST_ELEMENTS:
            raise BrrtError(
                f"more than {_DEEPEST} elements within each other, or {_MOST_ELEMENTS:,} in all; "
                "a URDF has fewer"
            )
        return super().start(tag, attrs)

    def end(self, tag: Any) -> Any:
        self._depth -= 1
        return super().end(tag)


def _parse(text: str) -> ET.Element:
    found = _FORBIDDEN.search(text)
    if found is not None:
        raise BrrtError(f"<!{found[1]}> is refused, for safety; remove it, or expand the file")
    parser = ET.XMLParser(target=_Builder())  # noqa: S314 - without a DTD it expands no entities
    try:
        parser.feed(text)
        root = parser.close()
    except ET.ParseError as error:
        raise BrrtError(f"not XML: {error}") from None
    except (ValueError, LookupError) as error:
        raise BrrtError(f"not XML that can be read: {error}") from None
    if root.tag != "robot":
        xacro = "; expand it by xacro first" if "xacro" in text[:2000] else ""
        raise BrrtError(f"not a URDF: the root element is {root.tag!r:.60}, not 'robot'{xacro}")
    return root


def _arm(root: ET.Element, values: Mapping[str, str]) -> Arm:
    """Make the arm from a parsed file."""
    links = {name_of("name of a link", link.get("name")): None for link in root.findall("link")}
    joints = [_link(joint, links) for joint in root.findall("joint")]
    for name in values:
        if values[name] not in links:
            raise unknown("link", values[name], links)
    to: dict[str, _Link] = {}
    for each in joints:
        if each.child in to:
            pair = f"joints {to[each.child].name!r} and {each.name!r}"
            raise BrrtError(f"{pair} have the same child {each.child!r}; a link has one parent")
        to[each.child] = each
    base = values.get("base")
    if "tip" in values:
        chain = _up(to, values["tip"], base, strict=True)
    else:
        ups = (_up(to, each, base) for each in links)
        chain = max(ups, key=lambda up: sum(j.joint.get("type") != FIXED for j in up), default=[])
        chain = _with_fixed(chain, joints)
    if not any(each.joint.get("type") != FIXED for each in chain):
        start = f" from {base!r}" if base else ""
        raise BrrtError(f"no chain of joints{start} that move; name its ends by base and tip")
    arm = Arm(base=chain[0].parent, tip=chain[-1].child)
    return arm.with_joints([_joint(each) for each in chain])


def _link(joint: ET.Element, links: Mapping[str, None]) -> _Link:
    """Read what a joint connects."""
    name = name_of("name of a joint", joint.get("name"))
    ends = {}
    for tag in ("parent", "child"):
        element = joint.find(tag)
        link = None if element is None else element.get("link")
        if link not in links:
            raise BrrtError(f"joint {name!r}: its {tag} is link {link!r:.60}, which is not defined")
        ends[tag] = str(link)
    return _Link(joint, name, **ends)


def _up(
    to: Mapping[str, _Link], tip: str, base: str | None, *, strict: bool = False
) -> list[_Link]:
    """Return the joints from a base, or as far up as an arm may go, to a tip.

    Args:
        to: The joint above each link.
        tip: Where the chain ends.
        base: Where it begins; the root if it is None.
        strict: Whether to raise an error where the chain does not begin at the base, or has a
            joint that no arm may have; otherwise the chain is empty, or begins behind that joint.
    """
    chain: list[_Link] = []
    at, seen = tip, {tip}
    while at != base and at in to:
        above = to[at]
        if not above.follows:
            if strict and (base is not None or above.joint.find("mimic") is not None):
                raise BrrtError(_why_not(above))
            break
        chain.append(above)
        at = above.parent
        if at in seen:
            raise BrrtError(f"joint {above.name!r} closes a loop; an arm is a tree of links")
        seen.add(at)
    if base is not None and at != base:
        if strict:
            raise BrrtError(f"no joints lead from base {base!r} to tip {tip!r}; choose others")
        return []
    return chain[::-1]


def _why_not(link: _Link) -> str:
    mimic = link.joint.find("mimic")
    if mimic is not None:
        return (
            f"joint {link.name!r} mimics {mimic.get('joint')!r:.60}, which is not supported; "
            f"choose the tip before it: tip={link.parent}"
        )
    kind = link.joint.get("type")
    return f"joint {link.name!r} has type {kind!r:.60}; choose a base after it: base={link.child}"


def _with_fixed(chain: list[_Link], joints: list[_Link]) -> list[_Link]:
    """Extend a chain by the fixed joints behind it, as long as there is one only."""
    while chain:
        after = [each for each in joints if each.parent == chain[-1].child]
        if len(after) != 1 or after[0].joint.get("type") != FIXED or after[0] in chain:
            break
        chain = [*chain, after[0]]
    return chain


def _joint(link: _Link) -> ArmJoint:
    """Read a joint of a chain."""
    joint, where = link.joint, f"joint {link.name!r}"
    origin, axis, limit = (joint.find(tag) for tag in ("origin", "axis", "limit"))
    kind = str(joint.get("type"))
    limits: Any = None
    if kind not in (FIXED, CONTINUOUS):
        ends = [None if limit is None else limit.get(end) for end in ("lower", "upper")]
        if None in ends:
            raise BrrtError(f"{where}: <limit> must state lower and upper; or make it continuous")
        limits = ends
    xyz, rpy = (_vector(origin, name, "0 0 0") for name in ("xyz", "rpy"))
    return joint_of(link.name, kind, xyz, rpy, _vector(axis, "xyz", "1 0 0"), limits, where)


def _vector(element: ET.Element | None, name: str, default: str) -> list[str]:
    return (default if element is None else element.get(name, default)).split()
