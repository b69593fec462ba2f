from .shader import Changes, Shader, Upload
from .textures import ShaderTexture

__all__ = [
    "Changes",
    "Shader",
    "ShaderTexture",
    "Upload",
]
