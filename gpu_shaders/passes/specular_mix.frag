// SPDX-License-Identifier: GPL-3.0-or-later
// Light in glossy surfaces from what found it: each leaves to the next what it has not found (seed 003, 4.3.1).
// rgb: W/(m² sr), times the share that was found; w: that share. What is in maps was asked of what the screen left.

#ifdef OWN_UNIT
layout(binding = OWN_UNIT) uniform sampler2D own;           // of the technique, beside the others
#endif
#ifdef SCREEN_UNIT
layout(binding = SCREEN_UNIT) uniform sampler2D on_screen;
#endif
#ifdef MAPS_UNIT
layout(binding = MAPS_UNIT) uniform sampler2D in_maps;
#endif
#ifdef LIGHTS_UNIT
layout(binding = LIGHTS_UNIT) uniform sampler2D of_lights;
#endif

layout(location = 0) out vec4 out_radiance; // W/(m² sr)

// Nothing that is not a number, infinite or negative goes on.
vec4 clean(vec4 value) {
    bvec4 usable = lessThan(floatBitsToUint(value) & 0x7fffffffu, uvec4(floatBitsToUint(1e30)));
    return all(usable) ? max(value, 0.0) : vec4(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 sum = vec3(0.0);
    float left = 1.0;
#ifdef SCREEN_UNIT
    vec4 screen = clean(texelFetch(on_screen, pixel, 0));
    sum += screen.rgb;
    left *= 1.0 - min(screen.w, 1.0);
#endif
#ifdef MAPS_UNIT
    vec4 maps = clean(texelFetch(in_maps, pixel, 0));
    sum += maps.rgb;
    left = max(left - maps.w, 0.0);
#endif
#ifdef LIGHTS_UNIT
    sum += left * clean(texelFetch(of_lights, pixel, 0)).rgb;
#endif
#ifdef OWN_UNIT
    sum += clean(texelFetch(own, pixel, 0)).rgb;
#endif
    out_radiance = vec4(sum, 1.0);
}
