"""ROS 2 messages that Foxglove, Lichtblick and rviz draw, in CDR.

The definitions are those of visualization_msgs and nav_msgs of ROS 2 Foxy; later ones have more
fields for textures. The file contains the definitions, so readers use these.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.views.colours import Colour, rgb
from brrt.worlds.occupancy import Grid

FRAME = "world"
"""The only frame; there are no transforms."""
_STAMP_AND_FRAME = struct.pack("<iII", 0, 0, len(FRAME) + 1) + FRAME.encode() + b"\0"

_HEADER = """
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
""".strip()
_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
_POSE = """
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
""".strip()
_POINT = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w"
_MARKER = """
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string text
string mesh_resource
bool mesh_use_embedded_materials
""".strip()
_PARTS_OF_MARKER = (
    _HEADER,
    _TIME,
    _POSE,
    _POINT,
    _QUATERNION,
    "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z",
    "MSG: std_msgs/ColorRGBA\nfloat32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec",
)
_GRID = """
std_msgs/Header header
nav_msgs/MapMetaData info
int8[] data
""".strip()
_INFO = """
MSG: nav_msgs/MapMetaData
builtin_interfaces/Time map_load_time
float32 resolution
uint32 width
uint32 height
geometry_msgs/Pose origin
""".strip()
_RULE = "\n" + "=" * 80 + "\n"

MARKER, MARKERS, MAP = (
    "visualization_msgs/msg/Marker",
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/OccupancyGrid",
)
DEFINITIONS = {
    MARKER: _RULE.join([_MARKER, *_PARTS_OF_MARKER]),
    MARKERS: _RULE.join(
        [
            "visualization_msgs/Marker[] markers",
            f"MSG: visualization_msgs/Marker\n{_MARKER}",
            *_PARTS_OF_MARKER,
        ]
    ),
    MAP: _RULE.join([_GRID, _HEADER, _TIME, _INFO, _POSE, _POINT, _QUATERNION]),
}
"""The definition of each type of message."""


class MarkerType(IntEnum):
    """Types of markers, as visualization_msgs numbers them."""

    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_STRIP = 4
    LINES = 5
    CUBES = 6
    TEXT = 9
    TRIANGLES = 11


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """Something to draw.

    Attributes:
        type: What it is.
        colour: Its colour.
        scale: Its size along each axis; the first is the width of lines.
        points: Points of a list or a line, shape (n, d); in 2D they lie at height `z`.
        place: Centre of any other type, shape (d,).
        colours: RGBA of each point, from 0 to 1, shape (n, 4); `colour` for all by default.
        text: The text of a text marker.
        z: Height in a 2D world.
        alpha: From 0, transparent, to 1.
    """

    type: MarkerType
    colour: Colour
    scale: tuple[float, float, float]
    points: NDArray[Any] | None = None
    place: NDArray[Any] | None = None
    colours: NDArray[np.float32] | None = None
    text: str = ""
    z: float = 0.0
    alpha: float = 1.0

    def message(self) -> bytes:
        """Return the marker as a message; a list without points deletes it."""
        body = _Body()
        self.put(body, 0)
        return bytes(body.data)

    def put(self, body: "_Body", number: int) -> None:
        """Append the marker to a message."""
        gone = self.points is not None and not len(self.points)
        body.header()
        body.text("")
        body.put("3i", number, self.type, 2 if gone else 0)
        body.put("10d", *_space(self.place, self.z), 0, 0, 0, 1, *self.scale)
        body.put("4fiI?", *rgb(self.colour), self.alpha, 0, 0, False)
        points = np.empty((0, 3)) if self.points is None else self.points
        body.rows(_heights(points, self.z), "<f8")
        body.rows(np.empty((0, 4)) if self.colours is None else self.colours, "<f4")
        body.text(self.text)
        body.text("")
        body.put("?", False)


def marker_array(markers: Sequence[Marker]) -> bytes:
    """Return markers as one message."""
    body = _Body()
    body.put("I", len(markers))
    for number, marker in enumerate(markers):
        marker.put(body, number)
    return bytes(body.data)


def fits(grid: Grid) -> bool:
    """Whether a grid's cells are right to a tenth of one in a message, which has a float32 edge."""
    with np.errstate(over="ignore"):
        edge = float(np.float32(grid.resolution))
    return bool(abs(edge / grid.resolution - 1) * max(grid.cells.shape) < 0.1)


def occupancy(grid: Grid, z: float) -> bytes:
    """Return a grid at a height as a message: 100 for blocked cells, 0 for free ones."""
    body = _Body()
    body.header()
    body.put("iI", 0, 0)
    rows, columns = grid.cells.shape
    body.put("fII", grid.resolution, columns, rows)
    body.put("7d", *grid.origin, z, 0, 0, np.sin(grid.yaw / 2), np.cos(grid.yaw / 2))
    cells = np.where(grid.cells, np.int8(100), np.int8(0))
    body.put("I", cells.size)
    body.data += cells.tobytes()
    return bytes(body.data)


class _Body:
    """A message that is being written: numbers are aligned to their size, counted after byte 4."""

    def __init__(self) -> None:
        self.data = bytearray(b"\x00\x01\x00\x00")

    def put(self, codes: str, *values: Any) -> None:
        """Append numbers in the format `codes` of `struct`; none may be larger than the first."""
        self._align(struct.calcsize(codes.lstrip("0123456789")[0]))
        self.data += struct.pack("<" + codes, *values)

    def header(self) -> None:
        """Append a header; a stamp of 0 asks for no transforms of a certain time."""
        self._align(4)
        self.data += _STAMP_AND_FRAME

    def text(self, text: str) -> None:
        """Append a text."""
        data = text.encode() + b"\0"
        self.put("I", len(data))
        self.data += data

    def rows(self, rows: NDArray[Any], dtype: str) -> None:
        """Append a sequence of rows of numbers."""
        self.put("I", len(rows))
        if len(rows):
            self._align(np.dtype(dtype).itemsize)
            self.data += np.ascontiguousarray(rows, dtype).tobytes()

    def _align(self, size: int) -> None:
        self.data += bytes(-(len(self.data) - 4) % size)


def _space(place: NDArray[Any] | None, z: float) -> tuple[float, float, float]:
    """Return a place as a point in 3D."""
    x, y, *rest = (0.0, 0.0, 0.0) if place is None else place.tolist()
    return (x, y, *rest)[:3] if rest else (x, y, z)


def _heights(points: NDArray[Any], z: float) -> NDArray[Any]:
    """Return points, shape (n, d), in 3D."""
    return np.insert(points, 2, z, axis=1) if points.shape[1] == 2 else points
