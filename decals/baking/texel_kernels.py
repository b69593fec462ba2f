"""Warp kernels of baked textures: faces at texels, surface points below them, sRGB bytes, and gutters."""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.baking.srgb import encoded

wp.set_module_options(KERNEL_OPTIONS)

FAR = 1.0e30
TINY = 1.0e-30
MIN_AREA = 1.0e-12
"""Doubled area of a face on the texture, in texels, from which on its points have weights."""


@wp.kernel
def cover_rows(
    first: wp.int32,
    starts: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
    places: wp.array(dtype=wp.vec2),
    band: wp.int32,
    parts: wp.int32,
    top: wp.int32,
    steps: wp.int32,
    width: wp.int32,
    margin: wp.float32,
    wanted: wp.array(dtype=wp.uint8),
    found: wp.array(dtype=wp.int32),
    overlaps: wp.array(dtype=wp.int32),
):
    """Write the first face at each sample of a part of a row, and count those that lie in another one too.

    A row has ``parts``. There are ``steps`` rows and columns of samples in a texel, from the row of texels
    ``top`` on. ``band`` rows of texels share a list of faces; those of the r-th ones are
    ``listed[starts[r]:starts[r + 1]]``. Each face is widened by ``margin`` samples. If ``wanted`` has the
    texels of the texture, samples of those with 0 are left out. -1 stands for no face.
    """
    at = first + wp.tid()
    row = at / parts
    left = at % parts * width / parts
    right = (at % parts + 1) * width / parts
    texel_row = top + row / steps
    y = float(top) + (float(row) + 0.5) / float(steps)
    scale = float(steps)
    limited = wanted.shape[0] > 0
    twice = wp.int32(0)
    for j in range(starts[texel_row / band], starts[texel_row / band + 1]):
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
            begin = wp.max(int(wp.ceil(low * scale - 0.5 - margin)), left)
            end = wp.min(int(wp.floor(high * scale - 0.5 + margin)), right - 1)
            for column in range(begin, end + 1):
                slot = row * width + column
                use = wp.bool(True)
                if limited:
                    use = wanted[texel_row * (width / steps) + column / steps] != wp.uint8(0)
                if use:
                    if found[slot] < 0:
                        found[slot] = listed[j]
                    else:
                        twice += 1
    overlaps[at] = twice


@wp.kernel
def share_alike(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    units: wp.array(dtype=wp.vec3),
    alike: wp.float32,
    other_points: wp.array(dtype=wp.vec3),
    other_units: wp.array(dtype=wp.vec3),
):
    """Replace points by others where the cosine between both unit normals is more than ``alike``."""
    i = first + wp.tid()
    if wp.dot(units[i], other_units[i]) > alike:
        other_points[i] = points[i]
        other_units[i] = units[i]


@wp.kernel
def mark_free(
    first: wp.int32,
    found: wp.array(dtype=wp.int32),
    filled: wp.array(dtype=wp.uint8),
    begin: wp.int32,
    marks: wp.array(dtype=wp.int32),
):
    """Write 1 for texels from ``begin`` on that are not filled, and in which a face was found; else 0."""
    i = first + wp.tid()
    marks[i] = 0
    if found[i] >= 0 and filled[begin + i] == wp.uint8(0):
        marks[i] = 1


@wp.kernel
def mark_listed(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    own: wp.array(dtype=wp.uint8),
    filled: wp.array(dtype=wp.uint8),
    marks: wp.array(dtype=wp.int32),
):
    """Write 1 for listed texels that are neither own ones nor filled; else 0."""
    i = first + wp.tid()
    marks[i] = 0
    if own[texels[i]] == wp.uint8(0) and filled[texels[i]] == wp.uint8(0):
        marks[i] = 1


@wp.kernel
def mark_range(
    first: wp.int32, chosen: wp.array(dtype=wp.uint8), begin: wp.int32, marks: wp.array(dtype=wp.int32)
):
    """Write 1 for chosen texels from ``begin`` on, else 0."""
    i = first + wp.tid()
    marks[i] = 0
    if chosen[begin + i] != wp.uint8(0):
        marks[i] = 1


@wp.kernel
def list_marked(
    first: wp.int32,
    marks: wp.array(dtype=wp.int32),
    ends: wp.array(dtype=wp.int32),
    begin: wp.int32,
    numbers: wp.array(dtype=wp.int32),
):
    """Write the numbers of the marks that are 1, from ``begin`` on; ``ends`` are the sums of marks."""
    i = first + wp.tid()
    if marks[i] != 0:
        numbers[ends[i] - 1] = begin + i


@wp.func
def weights_in_plane(at: wp.vec2, face: wp.vec3i, places: wp.array(dtype=wp.vec2)) -> wp.vec2:
    """Return the weights of a face's second and third corner at a place of its plane; 0 without an area."""
    a = places[face[0]]
    e = places[face[1]] - a
    f = places[face[2]] - a
    d = at - a
    area = e[0] * f[1] - e[1] * f[0]
    if wp.abs(area) > MIN_AREA:
        return wp.vec2((d[0] * f[1] - d[1] * f[0]) / area, (e[0] * d[1] - e[1] * d[0]) / area)
    return wp.vec2(0.0, 0.0)


@wp.func
def weights_in(at: wp.vec2, face: wp.vec3i, places: wp.array(dtype=wp.vec2)) -> wp.vec3:
    """Return the barycentric weights of a place in a face, or about those of the point closest to it."""
    w = weights_in_plane(at, face, places)
    second = wp.clamp(w[0], 0.0, 1.0)
    third = wp.clamp(w[1], 0.0, 1.0)
    total = wp.max(second + third, 1.0)
    return wp.vec3(wp.max(1.0 - second - third, 0.0), second / total, third / total)


@wp.func
def mixed(w: wp.vec3, face: wp.vec3i, values: wp.array(dtype=wp.vec3)) -> wp.vec3:
    """Return the mean of the values at the corners of a face."""
    return w[0] * values[face[0]] + w[1] * values[face[1]] + w[2] * values[face[2]]


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
    """Write the points of the surface at places in faces, their unit normals and barycentric weights."""
    i = first + wp.tid()
    face = faces[found[i]]
    w = weights_in(samples[i], face, places)
    points[i] = mixed(w, face, vertices)
    units[i] = wp.normalize(mixed(w, face, normals))
    weights[i] = w


@wp.kernel
def sample_points(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    found: wp.array(dtype=wp.int32),
    top: wp.int32,
    size: wp.int32,
    steps: wp.int32,
    faces: wp.array(dtype=wp.vec3i),
    places: wp.array(dtype=wp.vec2),
    vertices: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    numbers: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    units: wp.array(dtype=wp.vec3),
    weights: wp.array(dtype=wp.vec3),
):
    """Write faces, points, unit normals and weights of ``steps`` × ``steps`` samples of each texel.

    ``found`` has the faces of samples from the row of texels ``top`` on. The number is -1 without a face.
    """
    i = first + wp.tid()
    texel = texels[i / (steps * steps)]
    number = i % (steps * steps)
    row = texel / size * steps + number / steps
    column = texel % size * steps + number % steps
    chosen = found[(row - top * steps) * (size * steps) + column]
    numbers[i] = chosen
    points[i] = wp.vec3(0.0, 0.0, 0.0)
    units[i] = wp.vec3(0.0, 0.0, 1.0)
    weights[i] = wp.vec3(1.0, 0.0, 0.0)
    if chosen >= 0:
        face = faces[chosen]
        at = wp.vec2((float(column) + 0.5) / float(steps), (float(row) + 0.5) / float(steps))
        w = weights_in(at, face, places)
        points[i] = mixed(w, face, vertices)
        units[i] = wp.normalize(mixed(w, face, normals))
        weights[i] = w


@wp.kernel
def points_beyond(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    here: wp.array(dtype=wp.vec3i),
    there: wp.array(dtype=wp.vec3i),
    others: wp.array(dtype=wp.int32),
    size: wp.int32,
    steps: wp.int32,
    faces: wp.array(dtype=wp.vec3i),
    places: wp.array(dtype=wp.vec2),
    vertices: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    numbers: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    units: wp.array(dtype=wp.vec3),
    weights: wp.array(dtype=wp.vec3),
    along: wp.array(dtype=wp.vec3),
):
    """Write what `sample_points` writes for texels beyond seams, with the faces on the other side.

    The places of a texel lie in the plane of the face ``here``, beyond its first edge. They are turned about
    that edge into the plane of the face ``there``, whose first edge it is too. ``along`` are the weights of
    the closest points of the edge, in the order of the corners ``here``.
    """
    i = first + wp.tid()
    t = i / (steps * steps)
    number = i % (steps * steps)
    at = wp.vec2(
        float(texels[t] % size) + (float(number % steps) + 0.5) / float(steps),
        float(texels[t] / size) + (float(number / steps) + 0.5) / float(steps),
    )
    own = here[t]
    begin = vertices[own[0]]
    edge = vertices[own[1]] - begin
    square = wp.max(wp.dot(edge, edge), TINY)
    arm = vertices[own[2]] - begin
    foot = wp.dot(arm, edge) / square
    own_weights = weights_in_plane(at, own, places)
    share = own_weights[0] + own_weights[1] * foot
    away = -own_weights[1] * wp.length(arm - foot * edge)
    other = there[t]
    arm_there = vertices[other[2]] - begin
    foot_there = wp.dot(arm_there, edge) / square
    height = arm_there - foot_there * edge
    tall = wp.max(wp.length(height), wp.sqrt(TINY))
    points[i] = begin + share * edge + (away / tall) * height
    high = wp.clamp(away / tall, 0.0, 1.0)
    middle = wp.clamp(share - high * foot_there, 0.0, 1.0 - high)
    w = wp.vec3(1.0 - middle - high, middle, high)
    units[i] = wp.normalize(mixed(w, other, normals))
    face = faces[others[t]]
    own_order = wp.vec3(0.0, 0.0, 0.0)
    for k in range(3):
        for j in range(3):
            if face[k] == other[j]:
                own_order[k] = w[j]
    numbers[i] = others[t]
    weights[i] = own_order
    beside = wp.clamp(share, 0.0, 1.0)
    along[i] = wp.vec3(1.0 - beside, beside, 0.0)


@wp.kernel
def over_base(
    first: wp.int32,
    colors: wp.array(dtype=wp.vec4),
    base: wp.array(dtype=wp.vec3),
    values: wp.array(dtype=wp.float32),
):
    """Write base colours, one or one for each point, under premultiplied colours of decals."""
    i = first + wp.tid()
    color = colors[i]
    below = base[wp.min(i, base.shape[0] - 1)]
    for k in range(3):
        values[3 * i + k] = below[k] * (1.0 - color[3]) + color[k]


@wp.kernel
def mean_samples(
    first: wp.int32,
    values: wp.array(dtype=wp.float32),
    numbers: wp.array(dtype=wp.int32),
    samples: wp.int32,
    channels: wp.int32,
    means: wp.array(dtype=wp.float32),
    counts: wp.array(dtype=wp.int32),
):
    """Write the means of the samples of each texel that have a face, and how many these are."""
    i = first + wp.tid()
    count = wp.int32(0)
    for k in range(samples):
        if numbers[i * samples + k] >= 0:
            count += 1
    counts[i] = count
    for channel in range(channels):
        total = wp.float32(0.0)
        for k in range(samples):
            if numbers[i * samples + k] >= 0:
                total += values[(i * samples + k) * channels + channel]
        means[i * channels + channel] = total / float(wp.max(count, 1))


@wp.kernel
def sum_parts(
    first: wp.int32,
    values: wp.array(dtype=wp.float32),
    channels: wp.int32,
    length: wp.int32,
    sums: wp.array(dtype=wp.float64),
):
    """Write the sums of each channel over parts of so many rows."""
    part = first + wp.tid()
    last = wp.min((part + 1) * length, values.shape[0] / channels)
    for channel in range(channels):
        total = wp.float64(0.0)
        for row in range(part * length, last):
            total += wp.float64(values[row * channels + channel])
        sums[part * channels + channel] = total


@wp.kernel
def write_texels(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    levels: wp.array(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    mark: wp.uint8,
    channels: wp.int32,
    image: wp.array(dtype=wp.uint8),
    own: wp.array(dtype=wp.uint8),
):
    """Write levels to texels and mark them as own; texels without samples or of a higher mark stay."""
    i = first + wp.tid()
    texel = texels[i]
    if own[texel] <= mark and (counts.shape[0] == 0 or counts[wp.min(i, counts.shape[0] - 1)] > 0):
        own[texel] = mark
        for channel in range(channels):
            image[texel * channels + channel] = levels[i * channels + channel]


@wp.kernel
def fill_own(first: wp.int32, own: wp.array(dtype=wp.uint8), filled: wp.array(dtype=wp.uint8)):
    """Mark own texels as filled."""
    i = first + wp.tid()
    if own[i] != wp.uint8(0):
        filled[i] = wp.uint8(1)


@wp.kernel
def read_listed(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    image: wp.array(dtype=wp.uint8),
    channels: wp.int32,
    levels: wp.array(dtype=wp.uint8),
):
    """Write the levels of some texels, one after another."""
    i = first + wp.tid()
    for channel in range(channels):
        levels[i * channels + channel] = image[texels[i] * channels + channel]


@wp.kernel
def write_listed(
    first: wp.int32,
    texels: wp.array(dtype=wp.int32),
    levels: wp.array(dtype=wp.uint8),
    channels: wp.int32,
    image: wp.array(dtype=wp.uint8),
    filled: wp.array(dtype=wp.uint8),
):
    """Write the levels of some texels, and mark these as filled."""
    i = first + wp.tid()
    filled[texels[i]] = wp.uint8(1)
    for channel in range(channels):
        image[texels[i] * channels + channel] = levels[i * channels + channel]


@wp.func
def byte_level(light: wp.float32) -> wp.float32:
    """Return linear light, clamped to [0, 1], as an sRGB level from 0 to 255."""
    return 255.0 * encoded(wp.clamp(light, 0.0, 1.0))


@wp.kernel
def encode_levels(first: wp.int32, light: wp.array(dtype=wp.float32), levels: wp.array(dtype=wp.uint8)):
    """Write linear light as sRGB bytes."""
    i = first + wp.tid()
    levels[i] = wp.uint8(int(byte_level(light[i]) + 0.5))


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
    """Sharpen the sRGB channels of chosen texels, as much as programs blur them by mixing four.

    ``light_of`` is the light of each level. The weights are (−s, 1 + 2 s, −s) along rows and columns, with
    neighbours in charts alone. A level leaves the range of those around it by ``most`` at most.
    """
    slot = first + wp.tid()
    row = slot / size
    column = slot % size
    channels = srgb.shape[0]
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
                result = wp.clamp(byte_level(light), least - most, largest + most)
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
    if (own[slot] == wp.uint8(0)) != (own[other] == wp.uint8(0)):
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
    filled: wp.array(dtype=wp.uint8),
    levels: wp.array(dtype=wp.uint8),
    size: wp.int32,
    channels: wp.int32,
    step: wp.int32,
    uneven: wp.array(dtype=wp.uint8),
):
    """Write 1 at texels that are not filled and differ from one of their four neighbours."""
    slot = first + wp.tid()
    row = slot / size
    column = slot % size
    mark = wp.bool(False)
    if filled[slot] == wp.uint8(0):
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
def fill_gutters(
    first: wp.int32,
    filled: wp.array(dtype=wp.uint8),
    columns: wp.array(dtype=wp.int32),
    size: wp.int32,
    reach: wp.int32,
    rest: wp.array(dtype=wp.uint8),
    levels: wp.array(dtype=wp.uint8),
):
    """Give each empty texel the levels of the nearest filled one within reach, else those of ``rest``.

    Of texels at one distance it is the one in the row closest to that of the empty one, above before below.
    ``columns`` has the nearest filled texels of each row.
    """
    slot = first + wp.tid()
    row = slot / size
    column = slot % size
    channels = rest.shape[0]
    if filled[slot] == wp.uint8(0):
        nearest = wp.int32(-1)
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
                            nearest = other * size + found
        for channel in range(channels):
            if nearest >= 0:
                levels[slot * channels + channel] = levels[nearest * channels + channel]
            else:
                levels[slot * channels + channel] = rest[channel]
