// SPDX-License-Identifier: GPL-3.0-or-later
// The next coarser level of a map of flux: sums of four texels, so that every level holds all of it.
layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = 0) readonly uniform image2D finer;
layout(rgba32f, binding = 1) writeonly uniform image2D coarser;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(coarser)))) {
        return;
    }
    ivec2 corner = 2 * texel;
    vec4 lower = imageLoad(finer, corner) + imageLoad(finer, corner + ivec2(1, 0));
    vec4 upper = imageLoad(finer, corner + ivec2(0, 1)) + imageLoad(finer, corner + ivec2(1, 1));
    imageStore(coarser, texel, lower + upper);
}
