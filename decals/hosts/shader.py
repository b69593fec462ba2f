"""`shader`: the decals of a scene as GLSL for shaders of other programs, with its textures and uniforms."""

import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from numpy.typing import NDArray

from blobtree.immutable import Immutable
from blobtree.validation import describe, truth
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.hosts.code import FIRST_TEXTURE, VERSIONS, Code, code_of
from decals.hosts.textures import ShaderTexture, data_size, data_texture, image_texture, map_texture
from decals.hosts.unsupported import refuse_unsupported
from decals.index.editor import DecalArrays, DecalEditor
from decals.receivers import EVERYTHING, mask_on
from decals.record import Contact
from decals.rendering.data_texture import rectangles
from decals.rendering.decal_library import Form
from decals.rendering.options import SceneLike, check_scene, drawing_of, has_materials, is_limited
from decals.scenes.origin import WORLD, Origin
from decals.shaders import ComposeError
from decals.shaders.isolate import prefixed_name
from decals.validation import instance, one_of, whole_number

RECEIVERS = "surface_receivers"
"""Uniform with the mask of an object."""

MAX_PREFIX = 64
"""Characters of a prefix, at most: WebGL allows names of 1,024."""

PREFIX = re.compile(r"(?!gl_|webgl_|_webgl_)(?!.*__)[A-Za-z_][A-Za-z0-9_]*\Z")
"""Prefixes that GLSL allows."""


@dataclass(frozen=True)
class Upload:
    """Texels of a texture that changed.

    Attributes
    ----------
    texture : str
        Name of the texture.
    size : tuple of int
        Its width and height now. If the texture has another size, make it anew; then all texels are uploaded.
    x, y : int
        Column and row of the first texel.
    array : numpy.ndarray
        The texels, ``[height, width]`` or ``[height, width, 4]``.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> editor = decals.index.DecalEditor(scene.decals)
    >>> shader, version = decals.shader(scene, editable=True), editor.version
    >>> editor.change(3, tints=["red"])
    >>> uploads = {upload.texture: upload for upload in shader.changes(editor, version).uploads}
    >>> records = uploads["decal_records"]
    >>> records.x, records.y, records.array.shape
    (12, 0, (1, 4, 4))
    """

    texture: str
    size: tuple[int, int]
    x: int
    y: int
    array: NDArray[Any] = field(repr=False)


@dataclass(frozen=True)
class Changes:
    """What an edit of decals changed in a shader, see `Shader.changes`.

    Attributes
    ----------
    uploads : tuple of Upload
        Changed texels.
    uniforms : dict
        Values of all uniforms.
    version : int
        Version of the editor, for the next call.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> editor = decals.index.DecalEditor(scene.decals)
    >>> changes = decals.shader(scene, editable=True).changes(editor, 0)
    >>> changes.version == editor.version
    True
    """

    uploads: tuple[Upload, ...]
    uniforms: dict[str, int | float]
    version: int


@dataclass(frozen=True, eq=False)
class Shader(Immutable):
    """The decals of a scene for the shaders of another program; `decals.shader` makes one.

    It holds no handle of a graphics card, and can be pickled.

    Attributes
    ----------
    code : str
        GLSL: uniforms and functions, without a version and without a main function. Names begin with the
        prefix.
    header : str
        What a whole shader begins with: the version, and extensions that the code needs.
    textures : tuple of ShaderTexture
        The textures that the code reads.
    uniforms : dict
        Values of the other uniforms, int or float, in the order of their block in version "450".
    version, stage, prefix : str
        Version of GLSL, stage, and beginning of all names.
    form : Form
        What decides the code: contact mode, and True for what the decals need.
    origin : (x, y, z)
        Point that positions are relative to, see `Scene.origin`.
    receiver_table : tuple of str
        Receivers of decals, see `receivers`.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> list(decals.shader(scene, prefix="my").uniforms)
    ['myindex_level_count', 'myindex_mask', 'mymapping', 'mystiffness']
    """

    code: str = field(repr=False)
    header: str = field(repr=False)
    textures: tuple[ShaderTexture, ...] = field(repr=False)
    uniforms: dict[str, int | float] = field(repr=False)
    version: str
    stage: str
    prefix: str
    form: Form
    origin: Origin
    receiver_table: tuple[str, ...] = field(repr=False)

    def receivers(self, on: object | str | Iterable[str] | None = None) -> int:
        """Return the value of the uniform ``surface_receivers`` for an object: which decals lie on it.

        The code has this uniform if decals have receivers or fades.

        Parameters
        ----------
        on : object of a scene, str or sequence of str, optional
            The object, or its labels. By default all decals lie on it.

        Raises
        ------
        InvalidScene
            ``on`` is neither object nor labels.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> decals.shader(scene).receivers(scene.objects[0])
        1
        """
        return mask_on(on, self.receiver_table, InvalidScene)

    def uniform_block(self, receivers: int | None = None) -> bytes:
        """Return the values of the block of uniforms in version "450", as std140 lays them out.

        Parameters
        ----------
        receivers : int, optional
            Value of the uniform ``surface_receivers``, see `receivers`. Default: that in `uniforms`.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> len(decals.shader(scene, version="450").uniform_block())
        16
        """
        values = dict(self.uniforms)
        if receivers is not None:
            values[prefixed_name(RECEIVERS, self.prefix)] = receivers
        packed = b"".join(
            struct.pack("<f" if isinstance(self.uniforms[name], float) else "<i", values[name])
            for name in self.uniforms
        )
        return packed + bytes(-len(packed) % 16)

    def changes(self, editor: DecalEditor, since: int) -> Changes | None:
        """Return what edits of decals changed since a version of their editor: only these bytes.

        Parameters
        ----------
        editor : DecalEditor
            The decals.
        since : int
            The editor's version when the textures were last filled; 0 if they were filled from other decals.

        Returns
        -------
        Changes or None
            None if the decals need other code now; call `decals.shader` again. With ``editable=True`` the
            code never changes.

        Raises
        ------
        InvalidScene
            No editor, or no version.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> shader = decals.shader(scene, editable=True)
        >>> editor = decals.index.DecalEditor(scene.decals)
        >>> version = shader.changes(editor, 0).version
        >>> editor.change(3, radii=[0.1])
        >>> sum(upload.array.nbytes for upload in shader.changes(editor, version).uploads) < 2000
        True
        """
        instance("editor", editor, DecalEditor, InvalidScene, "decals.index.DecalEditor(scene.decals) is one")
        since = whole_number("since", since, 0, None, InvalidScene)
        data = DecalArrays.of(editor)
        if not self.form.covers(data, limited=editor.limited):
            return None
        code = code_of(self.form, self.version, self.stage, self.prefix)
        uploads = [
            Upload(code.textures[name], data_size(data.arrays[name]), x, y, texels.copy())
            for name, ranges in editor.changed_rows(since).items()
            if name in code.textures
            for first, end in ranges
            for x, y, texels in rectangles(first, data.arrays[name][first:end])
        ]
        index = {code.uniforms[name]: value for name, value in data.uniforms.items()}
        return Changes(tuple(uploads), self.uniforms | index, data.version)


def shader(
    scene: SceneLike,
    *,
    version: str = "330 core",
    stage: str = "fragment",
    prefix: str = "decal_",
    contact: Contact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    editable: bool = False,
) -> Shader:
    """Return the decals of a scene as GLSL for the shaders of other programs, with textures and uniforms.

    The code has the functions ``decal_color``, ``decal_material`` and ``decal_owner``, with the prefix in
    place of ``decal_``. No OpenGL is needed.

    Parameters
    ----------
    scene : Scene or SceneLike
        The scene. Its objects are not exported.
    version : str
        Version of GLSL: ``"330 core"``, ``"300 es"`` (also for WebGL 2) or ``"450"`` (with separate samplers,
        for SPIR-V and WGSL).
    stage : str
        Stage of the shader: ``"fragment"``, ``"vertex"`` or, in version "450", ``"compute"``.
    prefix : str
        Beginning of all names that are not in functions.
    contact : Contact or str, optional
        Contact mode. Default: that of the scene, as for stiffness and mapping.
    stiffness : float, optional
        Stiffness of elastic contact, from 1.
    mapping : ImageMapping or str, optional
        Image mapping, ``"corrected"`` or ``"chord"``.
    editable : bool
        True for code that stays the same after all edits of decals. It is slower for simple decals.

    Returns
    -------
    Shader
        Code, textures and uniforms.

    Raises
    ------
    InvalidScene
        No scene, a scene with a feature that shaders do not have, or an unknown version, stage or option.
    TooMuchData
        More decals than a texture holds.

    See Also
    --------
    decals.bake : textures for programs whose shaders stay as they are.
    decals.evaluate : the same values on the processor.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20, images=["scale"])
    >>> shader = decals.shader(scene, version="300 es")
    >>> shader.header.strip()
    '#version 300 es'
    >>> "vec4 decal_color(vec3 position, vec3 normal)" in shader.code
    True
    >>> [texture.name for texture in shader.textures][:2]
    ['decal_records', 'decal_index_levels']
    """
    check_scene(scene)
    one_of("version", version, VERSIONS, InvalidScene)
    one_of("stage", stage, VERSIONS[version].stages, InvalidScene)
    truth("editable", editable, InvalidScene)
    if not isinstance(prefix, str) or not PREFIX.match(prefix) or len(prefix) > MAX_PREFIX:
        raise InvalidScene(
            f"prefix: expected a name of GLSL with up to {MAX_PREFIX} characters, without '__' and not "
            f"beginning with 'gl_', got {describe(prefix)}"
        )
    drawing = drawing_of(scene).overridden(contact=contact, mapping=mapping, stiffness=stiffness)
    refuse_unsupported(scene, drawing)
    data = DecalArrays.of(scene.decals)
    form = Form(drawing.contact, data.layered, is_limited(scene), data.nested, has_materials(scene))
    form = replace(form, layered=True, limited=True, nested=True) if editable else form
    try:
        code = code_of(form, version, stage, prefix)
    except ComposeError as error:
        raise InvalidScene(
            f"prefix: expected one that makes no name twice, got {prefix!r}: {error}"
        ) from None
    values: dict[str, int | float] = {
        **data.uniforms,
        "decal_mapping": int(drawing.mapping),
        "decal_stiffness": drawing.stiffness,
        RECEIVERS: EVERYTHING,
    }
    return Shader(
        code=code.text,
        header=VERSIONS[version].header,
        textures=_textures(code, scene, data, numbered=VERSIONS[version].apart),
        uniforms={new: values[name] for name, new in code.uniforms.items()},
        version=version,
        stage=stage,
        prefix=prefix,
        form=form,
        origin=getattr(scene, "origin", WORLD),
        receiver_table=tuple(scene.decals.receiver_table),
    )


def _textures(
    code: Code, scene: SceneLike, data: DecalArrays, *, numbered: bool
) -> tuple[ShaderTexture, ...]:
    """Return the textures that a code reads, in the order of their declarations."""
    result = []
    for binding, (name, new) in enumerate(code.textures.items(), FIRST_TEXTURE):
        place = binding if numbered else None
        if name in data.arrays:
            result.append(data_texture(new, data.arrays[name], place))
        else:
            make = map_texture if name == "decal_materials" else image_texture
            result.append(make(new, scene.images, place))
    return tuple(result)
