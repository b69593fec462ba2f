// Records, index and images of decals: decals.rendering.decal_data.DecalData.

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

#ifdef STORED  // the same in storage buffers (`decals.rendering.uploads.STORED`), which many look-ups read faster
layout(std430, binding = 1) readonly buffer StoredRecords { vec4 stored_records[]; };
layout(std430, binding = 2) readonly buffer StoredLevels { vec4 stored_levels[]; };
layout(std430, binding = 3) readonly buffer StoredTable { ivec4 stored_table[]; };
layout(std430, binding = 4) readonly buffer StoredIds { int stored_ids[]; };

vec4 fetch_decal_records(ivec2 texel, int level) { return stored_records[texel.y << 12 | texel.x]; }
vec4 fetch_index_levels(ivec2 texel, int level) { return stored_levels[texel.y << 12 | texel.x]; }
ivec4 fetch_index_table(ivec2 texel, int level) { return stored_table[texel.y << 12 | texel.x]; }
ivec4 fetch_index_ids(ivec2 texel, int level) { return ivec4(stored_ids[texel.y << 12 | texel.x]); }
#else
vec4 fetch_decal_records(ivec2 texel, int level) { return texelFetch(decal_records, texel, level); }
#endif
