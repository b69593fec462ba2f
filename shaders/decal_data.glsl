// Records, index and images of decals: decals.rendering.uploads.DecalData.
uniform sampler2D decal_records;  // decal i: 4i (position, s), 4i + 1 (normal, rank), (u, image), (tint, opacity)
uniform sampler2D index_levels;
uniform isampler2D index_table;
uniform isampler2D index_ids;
uniform int index_level_count;
uniform int index_mask;
uniform sampler2D decal_limits;  // decal i: cosines between which it fades, depth at which it ends, place of receivers
uniform sampler2D decal_walks;  // see decals/field/walks.py
uniform int decal_mapping;
uniform float decal_stiffness;
uniform sampler2DArray decal_images;  // linear, premultiplied
