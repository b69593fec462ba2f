"""Further formats of images: for each, a test of the first bytes and a function of bytes and name."""

from decals.images.radiance import decode_radiance, is_radiance

DECODERS = ((is_radiance, decode_radiance),)
