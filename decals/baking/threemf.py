"""3MF files (3MF Consortium: core 1.3, materials 1.2): a build item for each part, closed by indices."""

import io
import json
import zipfile
from collections.abc import Generator, Iterable, Sequence
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from blobtree._typing import Int64Array
from decals.baking.parts import Baked, Part
from decals.baking.pictures import png_bytes
from decals.surfaces.topology import welded

MODEL_PART, TEXTURE_PART = "3D/3dmodel.model", "3D/Textures/color.png"

_TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
<Default Extension="png" ContentType="image/png"/>
</Types>
"""

_RELATIONSHIPS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rel0" Target="/{target}" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3d{kind}"/>
</Relationships>
"""

_MODEL = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<model unit="{unit}" xml:lang="en-US" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
    'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" '
    'xmlns:decals="https://implicit-decals.invalid/2025">'
)

PALETTE, TEXTURE = 1, 2
"""Numbers of the colours' resources; those of objects follow."""


def threemf_bytes(baked: Baked) -> bytes:
    """Return a 3MF file. Corners of faces name their colours or places in the texture."""
    parts = {
        "[Content_Types].xml": _TYPES.encode(),
        "_rels/.rels": _RELATIONSHIPS.format(target=MODEL_PART, kind="model").encode(),
        MODEL_PART: "\n".join(_model_lines(baked)).encode(),
    }
    if baked.maps is not None:
        names = _RELATIONSHIPS.format(target=TEXTURE_PART, kind="texture")
        parts |= {
            "3D/_rels/3dmodel.model.rels": names.encode(),
            TEXTURE_PART: png_bytes(baked.maps.color),
        }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as package:
        for name, content in parts.items():
            package.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _model_lines(baked: Baked) -> Iterable[str]:
    """Yield the lines of the model."""
    yield _MODEL.format(unit=baked.unit or "millimeter")
    yield '<metadata name="Application">Implicit Decals</metadata>'
    if baked.recipe is not None:
        text = escape(json.dumps(baked.recipe.record, ensure_ascii=False))
        yield f'<metadata name="decals:recipe" preserve="1">{_legal(text)}</metadata>'
    yield "<resources>"
    properties = yield from _color_lines(baked)
    for number, (part, rows) in enumerate(zip(baked.parts, properties, strict=True), TEXTURE + 1):
        kind = "model" if part.check.closed and part.check.sound else "surface"
        yield f'<object id="{number}" name={quoteattr(_legal(part.name))} type="{kind}"><mesh><vertices>'
        yield from _part_lines(part, rows)
        yield "</triangles></mesh></object>"
    yield "</resources>\n<build>"
    matrix = baked.placement("z", metres=False)[:3].T.reshape(-1)  # the file has row vectors
    transform = " ".join(f"{value:.17g}" for value in matrix)
    for number in range(len(baked.parts)):
        yield f'<item objectid="{number + TEXTURE + 1}" transform="{transform}"/>'
    yield "</build>\n</model>\n"


def _color_lines(baked: Baked) -> Generator[str, None, Sequence[Int64Array | None]]:
    """Yield the lines of colours or of places in the texture; return the row there of each vertex."""
    parts = baked.parts
    if parts[0].uv is not None:
        yield f'<m:texture2d id="{TEXTURE}" path="/{TEXTURE_PART}" contenttype="image/png" '
        yield 'tilestyleu="clamp" tilestylev="clamp"/>'
        yield f'<m:texture2dgroup id="{PALETTE}" texid="{TEXTURE}">'
        for part in parts:
            assert part.uv is not None
            yield from map('<m:tex2coord u="%.9g" v="%.9g"/>'.__mod__, map(tuple, part.uv.tolist()))
        yield "</m:texture2dgroup>"
        starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
        return [start + np.arange(len(part.vertices)) for part, start in zip(parts, starts, strict=True)]
    colors = [part.color_bytes for part in parts if part.color_bytes is not None]
    if not colors:
        return [None for _ in parts]
    distinct, rows = np.unique(np.concatenate(colors), axis=0, return_inverse=True)
    yield f'<m:colorgroup id="{PALETTE}">'
    yield from map('<m:color color="#%02X%02X%02X"/>'.__mod__, map(tuple, distinct.tolist()))
    yield "</m:colorgroup>"
    return np.split(rows.reshape(-1), np.cumsum([len(part.vertices) for part in parts])[:-1])


def _part_lines(part: Part, rows: Int64Array | None) -> Iterable[str]:
    """Yield the lines of a mesh with one vertex at each position."""
    kept, corners = np.unique(welded(part.vertices), return_inverse=True)
    points = part.vertices[kept].tolist()
    yield from map('<vertex x="%.9g" y="%.9g" z="%.9g"/>'.__mod__, map(tuple, points))
    yield "</vertices><triangles>"
    faces = corners.reshape(-1)[part.faces]
    form = '<triangle v1="%d" v2="%d" v3="%d"'
    if rows is not None:
        faces = np.hstack([faces, rows[part.faces]])
        form += f' pid="{PALETTE}" p1="%d" p2="%d" p3="%d"'
    yield from map(f"{form}/>".__mod__, map(tuple, faces.tolist()))


def _legal(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return "".join(letter for letter in text if letter >= " " and letter not in "\ufffe\uffff")
