"""Points and normals for `evaluate`: arrays of NumPy, or of other libraries, which stay on their device.

Arrays of other libraries are read through DLPack: without a copy, and in the order of the streams of a card.
"""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.device import known_device, start_warp
from blobtree.validation import describe, real
from decals.errors import InvalidDevice, InvalidPoints

HOST, CUDA, PINNED, MANAGED = 1, 2, 3, 13
"""Types of devices in DLPack: memory of the processor, of a card, and of both."""

_VECTORS = {2: wp.vec2, 3: wp.vec3, 4: wp.vec4}


class Rows(NamedTuple):
    """Points and normals, ``float32[m, 3]`` of NumPy, or arrays of vec3 on one Warp device."""

    points: Any
    normals: Any

    @property
    def stay(self) -> bool:
        """True for Warp arrays: then results are Warp arrays on their device."""
        return isinstance(self.points, wp.array)


def checked_rows(points: ArrayLike, normals: ArrayLike) -> Rows:
    """Return points and normals; raise InvalidPoints if they do not fit together."""
    rows = Rows(as_rows("points", points), as_rows("normals", normals))
    if len(rows.points) != len(rows.normals):
        raise InvalidPoints(
            f"normals: expected one for each of {len(rows.points)} points, got {len(rows.normals)}"
        )
    places = [place(array) for array in rows]
    if places[0] != places[1]:
        raise InvalidPoints(
            f"normals: expected an array {places[0]} like the points, got one {places[1]}; move one of them"
        )
    return rows


def device_of(rows: Rows, device: Any) -> str:
    """Return the name of the device that evaluates points: theirs if they stay there.

    Raises
    ------
    InvalidDevice
        There is no such device, or the points stay on another one.
    """
    if not rows.stay:
        return known_device(device)
    own = str(rows.points.device)
    if device is not None and known_device(device) != own:
        raise InvalidDevice(f"device: expected {own!r}, where the points lie, got {device!r}; leave it out")
    return known_device(own)


def checked_turns(normal_derivatives: ArrayLike | None, count: int) -> Float64Array | None:
    """Return derivatives of normals ``float64[m, 3, 3]``; raise InvalidPoints for other shapes."""
    if normal_derivatives is None:
        return None
    turns = _host_rows("normal_derivatives", normal_derivatives, (3, 3)).astype(np.float64)
    if len(turns) != count:
        raise InvalidPoints(f"normal_derivatives: expected one for each of {count} points, got {len(turns)}")
    return turns


def rows_on(device: str, rows: Rows) -> Rows:
    """Return points and normals on a device; the processor reads the memory of NumPy's arrays."""
    if rows.stay:
        return rows
    placed: list[Any] = [
        wp.array(np.ascontiguousarray(array), dtype=wp.vec3, device=device, copy=device != "cpu")
        for array in rows
    ]
    return Rows(*placed)


def joined_rows(parts: Sequence[Rows]) -> Rows:
    """Return the points and normals of several sets, one after the other."""
    if parts and parts[0].stay:
        return Rows(*(joined_arrays([part[side] for part in parts]) for side in (0, 1)))
    none = np.zeros((0, 3), np.float32)
    return Rows(*(np.concatenate([none, *(part[side] for part in parts)]) for side in (0, 1)))


def joined_arrays(parts: Sequence[Any]) -> Any:
    """Return arrays of Warp or NumPy, one after the other."""
    if not isinstance(parts[0], wp.array):
        return np.concatenate(parts)
    first = parts[0]
    shape = (sum(len(part) for part in parts), *first.shape[1:])
    whole: Any = wp.empty(shape, dtype=first.dtype, device=first.device)
    begin = 0
    for part in parts:
        if len(part):
            wp.copy(whole[begin : begin + len(part)], part)
            begin += len(part)
    return whole


def part_of(array: Any, first: int, last: int) -> Any:
    """Return some rows of an array of Warp or NumPy, which share its memory."""
    if first == last and isinstance(array, wp.array):  # Warp has no empty slices
        return wp.zeros((0, *array.shape[1:]), dtype=array.dtype, device=array.device)
    return array[first:last]


def on_host(array: Any) -> NDArray[Any]:
    """Return an array of Warp or NumPy as one of NumPy."""
    values: NDArray[Any] = array.numpy() if isinstance(array, wp.array) else array
    return values


def like(array: Any, values: NDArray[Any]) -> Any:
    """Return values as an array of Warp or NumPy, as another array is."""
    return wp.array(values, device=array.device) if isinstance(array, wp.array) else values


def placed(values: Any, device: str, *, stay: bool) -> Any:
    """Return results, which may hold arrays of Warp and NumPy, as Warp arrays on a device, or as NumPy's."""
    if is_dataclass(values) and not isinstance(values, type):
        names = [field.name for field in fields(values)]
        return replace(values, **{name: placed(getattr(values, name), device, stay=stay) for name in names})
    if isinstance(values, wp.array):
        return values if stay else values.numpy()
    if isinstance(values, np.ndarray) and stay:
        is_vector = values.ndim == 2 and values.dtype == np.float32
        kind = _VECTORS[values.shape[1]] if is_vector else Any
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=device)
    return values


def as_rows(name: str, values: Any) -> Any:
    """Return rows of three numbers as float32 of NumPy, or as vec3 on the Warp device where they lie.

    Raises
    ------
    InvalidPoints
        Values of other types, shapes or strides, or on a device that Warp cannot use.
    """
    if isinstance(values, wp.array):
        return _vectors(name, values)
    kind = _device_type(name, values)
    if kind in (CUDA, MANAGED):
        start_warp()
        try:
            shared = wp.from_dlpack(values)
        except Exception as error:  # of any kind, by the library of the array or by Warp
            raise _unreadable(name, error) from None
        return _vectors(name, shared)
    if kind not in (None, HOST, PINNED):
        raise InvalidPoints(
            f"{name}: expected an array on the processor or on a CUDA device, got one on a device of type "
            f"{kind} of DLPack; copy it to the processor"
        )
    return _host_rows(name, values, (3,))


def _device_type(name: str, values: Any) -> int | None:
    """Return the type of device of an array of another library; None for other values."""
    if isinstance(values, np.ndarray) or not hasattr(values, "__dlpack_device__"):
        return None
    try:
        return int(values.__dlpack_device__()[0])
    except Exception as error:
        raise _unreadable(name, error) from None


def _unreadable(name: str, error: Exception) -> InvalidPoints:
    text = str(error).strip().splitlines()
    return InvalidPoints(
        f"{name}: expected an array that DLPack can share, got {type(error).__name__}: "
        f"{text[0] if text else 'no reason'}; give a plain float32 array, without gradients"
    )


def _vectors(name: str, array: Any) -> Any:
    """Return an array of Warp as vec3; raise InvalidPoints if it is none."""
    if array.dtype == wp.vec3 and array.ndim == 1:
        return array
    shape = [*array.shape, *getattr(array.dtype, "_shape_", ())]
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    if scalar != wp.float32:
        raise InvalidPoints(
            f"{name}: expected float32 on {array.device}, got {scalar.__name__}; convert it there"
        )
    if len(shape) != 2 or shape[1] != 3:
        raise InvalidPoints(f"{name}: expected shape [m, 3], got {shape}; give one row per point")
    if shape[0] == 0:
        return wp.zeros(0, dtype=wp.vec3, device=array.device)
    if array.strides[1] != 4 or array.strides[0] % 4:
        raise InvalidPoints(
            f"{name}: expected rows of three adjacent numbers on {array.device}, got strides of "
            f"{list(array.strides)} bytes; make the array contiguous"
        )
    vectors: Any = wp.array(
        ptr=array.ptr, dtype=wp.vec3, shape=(shape[0],), strides=(array.strides[0],), device=array.device
    )
    vectors.shared = array  # keeps the memory
    return vectors


def place(array: Any) -> str:
    """Return where an array lies, in words."""
    return f"on {array.device}" if isinstance(array, wp.array) else "of NumPy"


def _host_rows(name: str, values: Any, shape: tuple[int, ...]) -> Float32Array:
    """Return rows of numbers as float32; raise InvalidPoints for other values or shapes."""
    expected = ", ".join(map(str, ("m", *shape)))
    try:
        with np.errstate(over="ignore"):
            array: NDArray[Any] = np.asarray(real(_shared(values)), np.float32)
    except (TypeError, ValueError, OverflowError):
        foreign = hasattr(values, "dtype") and not isinstance(values, np.ndarray)
        got = f"{describe(values)} of {values.dtype}" if foreign else describe(values)
        raise InvalidPoints(f"{name}: expected numbers of shape [{expected}], got {got}") from None
    except Exception as error:  # of any kind, by the library of the array
        raise _unreadable(name, error) from None
    if array.shape == (0,):  # of an empty list
        return array.reshape(0, *shape)
    if array.shape[1:] != shape:
        raise InvalidPoints(
            f"{name}: expected shape [{expected}], got {list(array.shape)}; give one row per point"
        )
    return array


def _shared(values: Any) -> Any:
    """Return an array of another library as one of NumPy with the same memory, if it has no such form."""
    foreign = hasattr(values, "__dlpack__") and not hasattr(values, "__array__")
    return np.from_dlpack(values) if foreign else values
