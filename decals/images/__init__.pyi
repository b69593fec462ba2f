from .builtin import BUILTIN_IMAGES, generate_image, is_builtin
from .load import image_pixels, load_image, read_image
from .texels import MAX_IMAGE_EDGE

__all__ = [
    "BUILTIN_IMAGES",
    "MAX_IMAGE_EDGE",
    "generate_image",
    "image_pixels",
    "is_builtin",
    "load_image",
    "read_image",
]
