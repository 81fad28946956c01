// SPDX-License-Identifier: GPL-3.0-or-later
// Blocks of 2 x 2 x 2 cells of one level, or bricks, each with a triangle that may meet them.
#include "lib/triangle_box.glsl"

layout(local_size_x = GROUP_SIZE) in;

// Corners in voxels and in their fourth components the normal.
layout(std430, binding = TRIANGLE_BINDING) readonly buffer Triangles { vec4 triangles[]; };
// The block's first cell in one word, and the triangle.
layout(std430, binding = BLOCK_BINDING) readonly buffer Blocks { uvec2 blocks[]; };

uniform uint block_count;

uint block_index() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * GROUP_SIZE + gl_LocalInvocationID.x;
}

uvec3 unpacked_cell(uint word) {
    return uvec3(word, word >> 10, word >> 20) & 1023u;
}

uint packed_cell(uvec3 cell) {
    return cell.x | cell.y << 10 | cell.z << 20;
}

VoxelTriangle triangle_at(uint index) {
    vec4 a = triangles[3u * index], b = triangles[3u * index + 1u], c = triangles[3u * index + 2u];
    return VoxelTriangle(a.xyz, b.xyz, c.xyz, vec3(a.w, b.w, c.w));
}
