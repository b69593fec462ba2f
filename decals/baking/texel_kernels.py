"""Warp kernels of baked textures: faces at texels, surface points below them, sRGB bytes, and gutters."""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

FAR = 1.0e30
MIN_AREA = 1.0e-12
"""Doubled area of a face on the texture, in texels, from which on its points have weights."""


@wp.kernel
def cover_rows(
    first: wp.int32,
    starts: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
    places: wp.array(dtype=wp.vec2),
    top: wp.int32,
    steps: wp.int32,
    width: wp.int32,
    margin: wp.float32,
    wanted: wp.array(dtype=wp.uint8),
    found: wp.array(dtype=wp.int32),
    overlaps: wp.array(dtype=wp.int32),
):
    """Write the first face at each sample of a row, and count the samples that lie in another one too.

    There are ``steps`` rows and columns of samples in a texel, from the row of texels ``top`` on. The faces
    at row r are ``listed[starts[r]:starts[r + 1]]``. They are wider than they are by ``margin`` samples. If
    ``wanted`` has texels, samples of texels with 0 are left out. -1 stands for no face.
    """
    row = first + wp.tid()
    y = float(top) + (float(row) + 0.5) / float(steps)
    scale = float(steps)
    limited = wanted.shape[0] > 0
    twice = wp.int32(0)
    for j in range(starts[row], starts[row + 1]):
        face = faces[listed[j]]
        low = wp.float32(FAR)
        high = wp.float32(-FAR)
        for k in range(3):
            p = places[face[k]]
            q = places[face[(k + 1) % 3]]
            if wp.min(p[1], q[1]) <= y and wp.max(p[1], q[1]) >= y:
                if p[1] == q[1]:
                    low = wp.min(low, wp.min(p[0], q[0]))
                    high = wp.max(high, wp.max(p[0], q[0]))
                else:
                    x = p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
                    low = wp.min(low, x)
                    high = wp.max(high, x)
        if low <= high:
            begin = wp.max(int(wp.ceil(low * scale - 0.5 - margin)), 0)
            end = wp.min(int(wp.floor(high * scale - 0.5 + margin)), width - 1)
            for column in range(begin, end + 1):
                slot = row * width + column
                use = wp.bool(True)
                if limited:
                    use = wanted[(row / steps) * (width / steps) + column / steps] != wp.uint8(0)
                if use:
                    if found[slot] < 0:
                        found[slot] = listed[j]
                    else:
                        twice += 1
    overlaps[row] = twice


@wp.kernel
def surface_points(
    first: wp.int32,
    samples: wp.array(dtype=wp.vec2),
    found: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
    places: wp.array(dtype=wp.vec2),
    vertices: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    points: wp.array(dtype=wp.vec3),
    units: wp.array(dtype=wp.vec3),
    weights: wp.array(dtype=wp.vec3),
):
    """Write the points of the surface at places in faces, their unit normals and barycentric weights.

    Places outside of a face count as the closest ones along its sides, about.
    """
    i = first + wp.tid()
    face = faces[found[i]]
    a = places[face[0]]
    e = places[face[1]] - a
    f = places[face[2]] - a
    d = samples[i] - a
    area = e[0] * f[1] - e[1] * f[0]
    w = wp.vec3(1.0, 0.0, 0.0)
    if wp.abs(area) > MIN_AREA:
        second = wp.clamp((d[0] * f[1] - d[1] * f[0]) / area, 0.0, 1.0)
        third = wp.clamp((e[0] * d[1] - e[1] * d[0]) / area, 0.0, 1.0)
        total = wp.max(second + third, 1.0)
        w = wp.vec3(wp.max(1.0 - second - third, 0.0), second / total, third / total)
    points[i] = w[0] * vertices[face[0]] + w[1] * vertices[face[1]] + w[2] * vertices[face[2]]
    units[i] = wp.normalize(w[0] * normals[face[0]] + w[1] * normals[face[1]] + w[2] * normals[face[2]])
    weights[i] = w


@wp.func
def encoded(light: wp.float32) -> wp.float32:
    """Return linear light, clamped to [0, 1], as an sRGB level from 0 to 255."""
    x = wp.clamp(light, 0.0, 1.0)
    if x > 0.0031308:
        return 255.0 * (1.055 * wp.pow(x, 1.0 / 2.4) - 0.055)
    return 255.0 * 12.92 * x


@wp.kernel
def encode_levels(first: wp.int32, light: wp.array(dtype=wp.float32), levels: wp.array(dtype=wp.uint8)):
    """Write linear light as sRGB bytes."""
    i = first + wp.tid()
    levels[i] = wp.uint8(int(encoded(light[i]) + 0.5))


@wp.kernel
def compensate(
    first: wp.int32,
    chosen: wp.array(dtype=wp.uint8),
    own: wp.array(dtype=wp.uint8),
    levels: wp.array(dtype=wp.uint8),
    light_of: wp.array(dtype=wp.float32),
    srgb: wp.array(dtype=wp.uint8),
    size: wp.int32,
    strength: wp.float32,
    most: wp.float32,
    sharper: wp.array(dtype=wp.uint8),
):
    """Sharpen the sRGB channels of chosen texels of a row, as much as programs blur them by mixing four.

    ``light_of`` is the light of each level. The weights are (−s, 1 + 2 s, −s) along rows and columns, with
    neighbours in charts alone. A level leaves the range of those around it by ``most`` at most.
    """
    row = first + wp.tid()
    channels = srgb.shape[0]
    for column in range(size):
        slot = row * size + column
        if chosen[slot] != wp.uint8(0) and own[slot] != wp.uint8(0):
            for channel in range(channels):
                if srgb[channel] != wp.uint8(0):
                    center = float(levels[slot * channels + channel])
                    least = center
                    largest = center
                    light = float(0.0)
                    for j in range(-1, 2):
                        for i in range(-1, 2):
                            other = slot
                            if row + j >= 0 and row + j < size and column + i >= 0 and column + i < size:
                                if own[slot + j * size + i] != wp.uint8(0):
                                    other = slot + j * size + i
                            level = levels[other * channels + channel]
                            weight = (1.0 + 2.0 * strength - float(wp.abs(i)) * (1.0 + 3.0 * strength)) * (
                                1.0 + 2.0 * strength - float(wp.abs(j)) * (1.0 + 3.0 * strength)
                            )
                            light += weight * light_of[int(level)]
                            least = wp.min(least, float(level))
                            largest = wp.max(largest, float(level))
                    result = wp.clamp(encoded(light), least - most, largest + most)
                    sharper[slot * channels + channel] = wp.uint8(int(wp.clamp(result, 0.0, 255.0) + 0.5))


@wp.func
def differs(
    slot: wp.int32,
    other: wp.int32,
    own: wp.array(dtype=wp.uint8),
    levels: wp.array(dtype=wp.uint8),
    channels: wp.int32,
    step: wp.int32,
) -> wp.bool:
    """Return True if two texels differ by more than a step, or only one of them lies in a chart."""
    if own[slot] != own[other]:
        return True
    if own[slot] != wp.uint8(0):
        for channel in range(channels):
            change = int(levels[slot * channels + channel]) - int(levels[other * channels + channel])
            if wp.abs(change) > step:
                return True
    return False


@wp.kernel
def mark_uneven(
    first: wp.int32,
    own: wp.array(dtype=wp.uint8),
    levels: wp.array(dtype=wp.uint8),
    size: wp.int32,
    channels: wp.int32,
    step: wp.int32,
    uneven: wp.array(dtype=wp.uint8),
):
    """Write 1 at the texels of a row that differ from one of their four neighbours."""
    row = first + wp.tid()
    for column in range(size):
        slot = row * size + column
        mark = wp.bool(False)
        if row > 0:
            mark = differs(slot, slot - size, own, levels, channels, step)
        if not mark and row + 1 < size:
            mark = differs(slot, slot + size, own, levels, channels, step)
        if not mark and column > 0:
            mark = differs(slot, slot - 1, own, levels, channels, step)
        if not mark and column + 1 < size:
            mark = differs(slot, slot + 1, own, levels, channels, step)
        uneven[slot] = wp.uint8(0)
        if mark:
            uneven[slot] = wp.uint8(1)


@wp.kernel
def nearest_in_rows(
    first: wp.int32,
    filled: wp.array(dtype=wp.uint8),
    size: wp.int32,
    reach: wp.int32,
    columns: wp.array(dtype=wp.int32),
):
    """Write the column of the nearest filled texel of the row within reach, -1 for none; of two the left."""
    row = first + wp.tid()
    last = wp.int32(-1)
    for column in range(size):
        slot = row * size + column
        if filled[slot] != wp.uint8(0):
            last = column
        columns[slot] = -1
        if last >= 0 and column - last <= reach:
            columns[slot] = last
    last = wp.int32(-1)
    for back in range(size):
        column = size - 1 - back
        slot = row * size + column
        if filled[slot] != wp.uint8(0):
            last = column
        if last >= 0 and last - column <= reach:
            if columns[slot] < 0 or last - column < column - columns[slot]:
                columns[slot] = last


@wp.kernel
def nearest_texels(
    first: wp.int32,
    filled: wp.array(dtype=wp.uint8),
    columns: wp.array(dtype=wp.int32),
    size: wp.int32,
    reach: wp.int32,
    nearest: wp.array(dtype=wp.int32),
):
    """Write the slot of the nearest filled texel within reach of each empty one, else -1.

    Of texels at one distance it is the one in the row closest to that of the empty one, above before below.
    """
    row = first + wp.tid()
    for column in range(size):
        slot = row * size + column
        nearest[slot] = -1
        if filled[slot] == wp.uint8(0):
            least = reach * reach + 1
            for away in range(reach + 1):
                if away * away >= least:
                    break
                for side in range(2):
                    other = row - away
                    if side == 1:
                        other = row + away
                    if other >= 0 and other < size:
                        found = columns[other * size + column]
                        if found >= 0:
                            distance = away * away + (found - column) * (found - column)
                            if distance < least:
                                least = distance
                                nearest[slot] = other * size + found
