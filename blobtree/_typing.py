"""Names of NumPy array types, by the type of their elements."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
UInt8Array: TypeAlias = NDArray[np.uint8]
Int32Array: TypeAlias = NDArray[np.int32]
Int64Array: TypeAlias = NDArray[np.int64]
IndexArray: TypeAlias = NDArray[np.intp]
"""Indices into other arrays, as `np.flatnonzero` and `np.argsort` return them."""
Float32Array: TypeAlias = NDArray[np.float32]
Float64Array: TypeAlias = NDArray[np.float64]
FloatArray: TypeAlias = NDArray[np.floating]
"""Floats of any width."""
Box: TypeAlias = tuple[Float64Array, Float64Array]
"""Lower and upper corner (3,) of an axis-aligned box."""
