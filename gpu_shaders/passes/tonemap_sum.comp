// SPDX-License-Identifier: GPL-3.0-or-later
// Sums of a picture's rows.

layout(local_size_x = GROUP_SIZE) in;

layout(binding = PICTURE_UNIT) uniform sampler2D picture;
layout(std430, binding = SUM_BINDING) writeonly buffer Sums { vec4 sums[]; };

void main() {
    ivec2 size = textureSize(picture, 0);
    int row = int(gl_GlobalInvocationID.x);
    if (row >= size.y) {
        return;
    }
    vec4 sum = vec4(0.0);
    for (int x = 0; x < size.x; ++x) {
        sum += texelFetch(picture, ivec2(x, row), 0);
    }
    sums[row] = sum;
}
