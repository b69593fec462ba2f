"""The bytes that a glTF file names: the chunk of a GLB file, data URIs, and files in the model's folder."""

from pathlib import Path

from decals.surfaces.files.faults import Unreadable, item
from decals.surfaces.files.gltf_document import Buffer
from decals.surfaces.files.pieces import Budget
from decals.surfaces.files.uris import read_uri


class Buffers:
    """Buffers of a file, each read when it is first used."""

    def __init__(
        self, buffers: tuple[Buffer, ...], binary: bytes | None, folder: Path, budget: Budget
    ) -> None:
        self._buffers = buffers
        self._binary = binary
        self._folder = folder
        self._budget = budget
        self._contents: dict[int, bytes] = {}

    def has_bytes(self, index: int) -> bool:
        """Return True if a buffer has a source, which those that decompression fills do not have."""
        buffer = item(self._buffers, index, "buffer", "a buffer view")
        return buffer.uri is not None or (index == 0 and self._binary is not None)

    def content(self, index: int, place: str) -> bytes:
        """Return the bytes of a buffer that a place of the file names."""
        buffer = item(self._buffers, index, "buffer", place)
        if index not in self._contents:
            self._contents[index] = self._read(buffer, f"buffer {index}")
        return self._contents[index]

    def _read(self, buffer: Buffer, name: str) -> bytes:
        if buffer.uri is not None:
            content = read_uri(buffer.uri, self._folder, name)
            self._budget.grow(len(content))
            return content
        if self._binary is None or name != "buffer 0":
            raise Unreadable(f"{name} has neither a URI nor a binary chunk")
        return self._binary
