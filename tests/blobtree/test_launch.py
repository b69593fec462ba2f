"""Memory that is handed out is whole, whatever its size."""

import numpy as np
import pytest

from blobtree.launch import fresh_memory


@pytest.mark.parametrize("count", [0, 1, 5000, 2_000_000])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_fresh_memory_can_be_written_and_read(count: int, dtype: type) -> None:
    array = fresh_memory((count, 3), dtype)
    assert (array.shape, array.dtype, array.flags.c_contiguous) == ((count, 3), dtype, True)
    array[:] = np.arange(count)[:, None] % 1000
    assert np.array_equal(array[:, 2], np.arange(count) % 1000)
