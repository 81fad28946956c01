// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to every pixel what it receives from a run of samples of one reflective shadow map (seed 003, 4.3.3): surface
// that the lamp lights, looked up in a disc around the place where the pixel projects into the map. With a history, a
// pixel that has one takes only a part of the samples.
#include "passes/gbuffer_samplers.glsl"
#include "lib/rsm.glsl"
#include "lib/vpl.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

// A place in the unit disc, the weight of the flux found there, and the weight that the evenly covered disc would need.
layout(std430, binding = TAP_BINDING) readonly buffer Taps { vec4 taps[]; };
layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(binding = RSM_POSITION_UNIT) uniform sampler2D rsm_position;
layout(binding = RSM_NORMAL_UNIT) uniform sampler2D rsm_normal;
layout(binding = RSM_FLUX_UNIT) uniform sampler2D rsm_flux;

layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²; w: what bounds took off, mean of the channels
layout(binding = PICKED_PIXEL_UNIT) uniform isampler2D picked_pixel;
#if HAS_HISTORY
layout(binding = AGE_UNIT) uniform sampler2D history_age;   // 0 where there is none
uniform uvec2 part;         // first and end of the taps of pixels with a history
uniform int reach;          // pixels to each side that have to have one, too
#endif
#if MARKS_PLACES
layout(r32f, binding = 1) writeonly uniform image2D places; // 1 where the marked pixel looked
uniform ivec2 marked;
#endif

uniform uint first_tap, end_tap; // of this run
uniform uint tap_count;
uniform float area_share;   // one over the taps of all pictures: in their mean a tap stands for so much of the surface
uniform float map_scale;    // with the offset takes a pixel's place into the space of the map
uniform vec3 map_offset;
uniform float radius;       // of the disc; 1 reaches all of the map from everywhere
uniform int side;           // texels along a face
uniform bool is_cut;        // at the brightest, after this run
uniform vec3 brightest;     // W/m², what no surface's radiosity exceeds

// First and end of the taps of a pixel.
uvec2 own_taps(ivec2 pixel) {
#if HAS_HISTORY
    // What is found here may be spread over the pixels around, and none of them may go without.
    bool has_history = true;
    ivec2 last = textureSize(history_age, 0) - 1;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            has_history = has_history && texelFetch(history_age, clamp(pixel + ivec2(x, y), ivec2(0), last), 0).x > 0.0;
        }
    }
    if (has_history) {
        return part;
    }
#endif
    return uvec2(0u, tap_count);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(irradiance))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    ivec2 picture_pixel = texelFetch(picked_pixel, pixel, 0).xy;
    uvec2 own = own_taps(picture_pixel);
    uint first = max(own.x, first_tap), end = min(own.y, end_tap);
    float tap_share = 1.0 / float(own.y - own.x);
    Lamp lamp = lamps[0];
    vec3 p = map_scale * texelFetch(gbuffer_position, pixel, 0).xyz + map_offset;
    vec3 n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
#if IS_CUBE
    // The map is the sphere in Lambert's equal-area projection about the pixel: of radius 1, as large as 4 pi.
    vec3 from_lamp = p - lamp.shadow_origin;
    mat3 lamp_axes = mat3(lamp.x_axis, lamp.y_axis, lamp.z_axis);
    mat3 frame = frame_of(dot(from_lamp, from_lamp) > 0.0 ? normalize(from_lamp * lamp_axes) : vec3(0.0, 0.0, 1.0));
    float disc_radius = radius;
    float disc_measure = 4.0 * FORM_FACTOR_PI * radius * radius;
#else
    vec2 centre = map_place(lamp, p);
    float disc_radius = min(radius * sqrt(2.0), covering_radius(centre));
    float disc_measure = FORM_FACTOR_PI * disc_radius * disc_radius;
#endif
    vec3 sum = vec3(0.0);
    float removed = 0.0;
    for (uint i = first; i < end; ++i) {
        vec4 tap = taps[i];
#if IS_CUBE
        ivec2 texel = cube_texel(sphere_direction(frame, disc_radius * tap.xy), side);
#else
        vec2 place = centre + disc_radius * tap.xy;
        if (any(lessThan(place, vec2(0.0))) || any(greaterThanEqual(place, vec2(1.0)))) {
            continue;
        }
        ivec2 texel = ivec2(place * float(side));
#endif
#if MARKS_PLACES
        if (picture_pixel == marked) {
            imageStore(places, texel, vec4(1.0));
        }
#endif
        vec4 flux = texelFetch(rsm_flux, texel, 0);
        if (max(max(flux.r, flux.g), flux.b) <= 0.0) {
            continue;
        }
        vec4 surface = texelFetch(rsm_normal, texel, 0);
        // How many such texels the sample stands for, in this picture and in the mean of all; never for less than one.
        float texels = tap_share * disc_measure / flux.w;
        float area = max(tap.w * area_share * disc_measure / flux.w, 1.0) * surface.w;
        vec2 geometry = bounded_geometry(p, n, texelFetch(rsm_position, texel, 0).xyz, surface.xyz, area);
        vec3 power = tap.z * texels * flux.rgb;
        sum += geometry.x * power;
        removed += geometry.y * dot(power, vec3(1.0 / 3.0));
    }
    vec4 total = imageLoad(irradiance, pixel) + vec4(sum, removed);
    if (is_cut) {
        vec3 over = max(total.rgb - brightest, 0.0);
        total += vec4(-over, dot(over, vec3(1.0 / 3.0)));
    }
    imageStore(irradiance, pixel, total);
}
