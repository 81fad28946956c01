// SPDX-License-Identifier: GPL-3.0-or-later
// Which surfaces a virtual light leaves out (core/light_links.py): those of its own tag (seed 002, 3.4) and, where the
// light mesh has links (LIGHT_LINKS), those of the tags that it is linked to.
#ifndef PASSES_LIGHT_TAGS
#define PASSES_LIGHT_TAGS

#ifdef LIGHT_LINKS
// render/link_table.py: buckets of four pairs (light tag, surface tag), two pairs in a texel, row by row.
layout(binding = LIGHT_LINK_UNIT) uniform isampler2D light_links;

uint link_hash(int light_tag, int surface_tag) {
    uint mixed = uint(light_tag) * uint(LINK_HASH_LIGHT) + uint(surface_tag) * uint(LINK_HASH_SURFACE);
    mixed = (mixed ^ (mixed >> LINK_HASH_SHIFT)) * uint(LINK_HASH_MIX);
    return mixed ^ (mixed >> LINK_HASH_SHIFT);
}

bool is_linked(int light_tag, int surface_tag) {
    ivec2 size = textureSize(light_links, 0);
    int buckets_across = size.x / 2;
    // A power of two.
    int buckets = buckets_across * size.y;
    int bucket = int(link_hash(light_tag, surface_tag) & uint(buckets - 1));
    ivec2 place = ivec2(2 * (bucket % buckets_across), bucket / buckets_across);
    ivec4 wanted = ivec4(light_tag, surface_tag, light_tag, surface_tag);
    bvec4 in_first = equal(texelFetch(light_links, place, 0), wanted);
    bvec4 in_second = equal(texelFetch(light_links, place + ivec2(1, 0), 0), wanted);
    return all(in_first.xy) || all(in_first.zw) || all(in_second.xy) || all(in_second.zw);
}

bool leaves_out(int light_tag, int surface_tag) {
    if (light_tag == UNTAGGED || surface_tag == UNTAGGED) {
        return false;
    }
    return light_tag == surface_tag || is_linked(light_tag, surface_tag);
}
#define LEAVES_OUT(LIGHT_TAG, SURFACE_TAG) leaves_out(LIGHT_TAG, SURFACE_TAG)
#else
#define LEAVES_OUT(LIGHT_TAG, SURFACE_TAG) ((LIGHT_TAG) != UNTAGGED && (LIGHT_TAG) == (SURFACE_TAG))
#endif
#endif
