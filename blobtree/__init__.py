"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp."""

import warp as wp

wp.config.quiet = True
