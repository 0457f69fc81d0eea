"""Events as Arrow columns, as Rerun takes them, and back; and checksums over them."""

import json
import zlib
from collections.abc import Buffer, Iterable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Field, Table
