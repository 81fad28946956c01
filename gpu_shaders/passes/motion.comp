// SPDX-License-Identifier: GPL-3.0-or-later
// Where the surface that a pixel shows was in the picture before, by how far the corners of its triangle have moved.
#include "lib/triangle_motion.glsl"
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// First face, end face, first corner or -1 where nothing is known of before; by first face.
layout(std430, binding = MOVE_BINDING) readonly buffer Moves { ivec4 moves[]; };
// Pairs: place now, and the way back to where it was.
layout(std430, binding = VERTEX_BINDING) readonly buffer Vertices { vec4 vertices[]; };
layout(std430, binding = CORNER_BINDING) readonly buffer Corners { uint corners[]; };
layout(rgba32f, binding = 0) writeonly uniform image2D place_before;    // w: whether there is one
layout(rgba16f, binding = 1) writeonly uniform image2D normal_before;
layout(rgba16f, binding = 2) writeonly uniform image2D plane_before;

uniform int move_count;

// The last move whose first face is not beyond `face`, or -1.
int move_of(int face) {
    int low = -1;
    int high = move_count;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (moves[middle].x <= face) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(place_before)))) {
        return;
    }
    vec4 place = vec4(0.0);
    vec3 normal = vec3(0.0);
    vec3 plane = vec3(0.0);
    if (pixel_shows_geometry(pixel)) {
        Surface surface = fetch_surface(pixel);
        place = vec4(surface.position, 1.0);
        normal = surface.shading_normal;
        plane = surface.geometric_normal;
        int move = move_of(surface.face_id);
        if (move >= 0 && surface.face_id < moves[move].y) {
            int first = moves[move].z + 3 * (surface.face_id - moves[move].x);
            if (moves[move].z < 0) {
                place = vec4(0.0);
            } else {
                vec3 now[3];
                vec3 back[3];
                for (int k = 0; k < 3; ++k) {
                    uint vertex = corners[first + k];
                    now[k] = vertices[2u * vertex].xyz;
                    back[k] = vertices[2u * vertex + 1u].xyz;
                }
                place.xyz += moved_by(place.xyz, now, back);
                mat3 turn = turned_by(now, back);
                normal = turn * normal;
                plane = turn * plane;
            }
        }
    }
    imageStore(place_before, pixel, place);
    imageStore(normal_before, pixel, vec4(normal, 0.0));
    imageStore(plane_before, pixel, vec4(plane, 0.0));
}
