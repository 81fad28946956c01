// SPDX-License-Identifier: GPL-3.0-or-later
// Puts what was gathered for picked pixels where they are in the picture.

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = PICKED_PIXEL_UNIT) uniform isampler2D picked_pixel;
layout(binding = PICKED_RESULT_UNIT) uniform sampler2D picked_result;
layout(rgba32f, binding = 0) writeonly uniform image2D result;

uniform uint count; // of the picked pixels

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(picked_pixel, 0);
    uint square = gl_WorkGroupID.y * uint(size.x / GROUP_SIDE) + gl_WorkGroupID.x;
    if (square * uint(GROUP_SIDE * GROUP_SIDE) + gl_LocalInvocationIndex < count) {
        imageStore(result, texelFetch(picked_pixel, texel, 0).xy, texelFetch(picked_result, texel, 0));
    }
}
