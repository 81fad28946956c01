// SPDX-License-Identifier: GPL-3.0-or-later
// For each pixel the sum of those within `radius` along one axis. An invocation walks a row or (IS_VERTICAL) a column.

layout(local_size_x = GROUP_SIZE) in;

layout(binding = PICTURE_UNIT) uniform sampler2D picture;
layout(rgba32f, binding = 0) writeonly uniform image2D result;

uniform int radius;

const bool is_vertical = IS_VERTICAL == 1;

ivec2 place(int along, int line) {
    return is_vertical ? ivec2(line, along) : ivec2(along, line);
}

vec4 value(int along, int line, int length) {
    return along >= 0 && along < length ? texelFetch(picture, place(along, line), 0) : vec4(0.0);
}

void main() {
    ivec2 size = textureSize(picture, 0);
    int line = int(gl_GlobalInvocationID.x);
    int length = is_vertical ? size.y : size.x;
    if (line >= (is_vertical ? size.x : size.y)) {
        return;
    }
    vec4 sum = vec4(0.0);
    for (int along = -radius; along < length; ++along) {
        sum += value(along + radius, line, length) - value(along - radius - 1, line, length);
        if (along >= 0) {
            imageStore(result, place(along, line), sum);
        }
    }
}
