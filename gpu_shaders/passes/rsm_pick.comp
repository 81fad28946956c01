// SPDX-License-Identifier: GPL-3.0-or-later
// What is in listed texels of a reflective shadow map: each as a point light of the texel's flux and area.
#include "gpu_layout/VirtualPointLight"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = RSM_POSITION_UNIT) uniform sampler2D rsm_position;
layout(binding = RSM_NORMAL_UNIT) uniform sampler2D rsm_normal;
layout(binding = RSM_FLUX_UNIT) uniform sampler2D rsm_flux;
layout(std430, binding = TEXEL_BINDING) readonly buffer Texels { ivec2 texels[]; };
layout(std430, binding = PICKED_BINDING) writeonly buffer Picked { VirtualPointLight picked[]; };

uniform uint count;
uniform uint first; // place of the first one in the list

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
    ivec2 texel = texels[first + i];
    vec4 surface = texelFetch(rsm_normal, texel, 0);
    VirtualPointLight light;
    light.position = texelFetch(rsm_position, texel, 0).xyz;
    light.area = surface.w;
    light.normal = surface.xyz;
    light.flux = texelFetch(rsm_flux, texel, 0).rgb;
    light.geometric_normal = vec3(0.0);
    picked[first + i] = light;
}
