from .builtin import BUILTIN_IMAGES, generate_image, is_builtin
from .load import MAX_IMAGE_EDGE, image_pixels, load_image, read_image

__all__ = [
    "BUILTIN_IMAGES",
    "MAX_IMAGE_EDGE",
    "generate_image",
    "image_pixels",
    "is_builtin",
    "load_image",
    "read_image",
]
