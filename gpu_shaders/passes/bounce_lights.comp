// SPDX-License-Identifier: GPL-3.0-or-later
// The next bounce of a run of virtual point lights: each sends its light on along one direction, spread as a diffuse
// surface does, and what that meets first becomes a light (Keller 1997; seed 004, 3.3).
#include "gpu_layout/VirtualPointLight"
#include "lib/directions.glsl"
#include "lib/halton.glsl"
#include "lib/octree_triangles.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = LIGHT_BINDING) readonly buffer Lights { VirtualPointLight lights[]; };
layout(std430, binding = NEXT_BINDING) writeonly buffer NextLights { VirtualPointLight next_lights[]; };

uniform uint count;
uniform uint first_index;   // in Halton's sequence, of the first light
uniform uvec2 bases;
uniform vec2 shift;
uniform float gain;         // the lights that go on stand for all
uniform float area;         // of the surface that each stands for
uniform vec4 octree_frame;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
    VirtualPointLight light = lights[i];
    vec2 point = vec2(radical_inverse(first_index + i, bases.x), radical_inverse(first_index + i, bases.y));
    point = vec2(rotated(point.x, shift.x), rotated(point.y, shift.y));
    vec3 direction = cosine_direction(light.normal, point);
    VirtualPointLight next = VirtualPointLight(light.position, 0.0, vec3(0.0), vec3(0.0), vec3(0.0));
    // Smooth normals send some light into their own surface.
    bool leaves = dot(direction, light.geometric_normal) > 0.0;
    if (leaves && max(light.flux.r, max(light.flux.g, light.flux.b)) > 0.0) {
        vec3 place = octree_place(light.position, octree_frame);
        OctreeHit hit = octree_first_hit(place, light.geometric_normal, direction);
        if (hit.found && !hit.from_back) {
            next.position = hit.place / octree_frame.w + octree_frame.xyz;
            next.area = area;
            next.normal = next.geometric_normal = hit.normal;
            next.flux = gain * hit.reflectance * light.flux;
        }
    }
    next_lights[i] = next;
}
