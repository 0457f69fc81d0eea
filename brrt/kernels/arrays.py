"""Arrays with room for more rows."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def enlarged(array: NDArray[Any], used: int, capacity: int) -> NDArray[Any]:
    """Return an array with the first `used` rows of another one and room for `capacity`.

    The other rows are zero; the system provides their memory when they are written.
    """
    larger = np.zeros((capacity, *array.shape[1:]), array.dtype)
    larger[:used] = array[:used]
    return larger
