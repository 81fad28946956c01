// SPDX-License-Identifier: GPL-3.0-or-later
// The next coarser level of a pyramid of depths: the nearest of four.
layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(r32f, binding = 0) readonly uniform image2D finer;
layout(r32f, binding = 1) writeonly uniform image2D coarser;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(coarser)))) {
        return;
    }
    ivec2 last = imageSize(finer) - 1, corner = 2 * texel;
    float nearest = DEPTH_EMPTY;
    for (int part = 0; part < 4; ++part) {
        nearest = min(nearest, imageLoad(finer, min(corner + ivec2(part & 1, part >> 1), last)).r);
    }
    imageStore(coarser, texel, vec4(nearest));
}
