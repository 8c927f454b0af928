// Camera rays. Twin: src/reference/camera.rs.

#include "rng.glsl"
#include "sobol.glsl"

// Pixels are numbered tile by tile (8x8), row by row within a tile; the last tiles may reach out of
// the image. With several camera rays a pixel, number p + j frame.pixels is ray j of pixel p.
ivec2 pixel_position(uint pixel) {
    if (JITTERED) pixel %= frame.pixels;
    uint tiles_in_row = (frame.width + TILE_SIDE - 1u) / TILE_SIDE;
    uint tile = pixel / WORKGROUP_SIZE;
    uint place = pixel % WORKGROUP_SIZE;
    return ivec2((tile % tiles_in_row) * TILE_SIDE + place % TILE_SIDE,
                 (tile / tiles_in_row) * TILE_SIDE + place / TILE_SIDE);
}

bool inside_image(ivec2 position) {
    return position.x < int(frame.width) && position.y < int(frame.height);
}

// Through a point of the raster, in pixels.
Ray camera_ray_through(vec2 raster) {
    float x = raster.x;
    float y = raster.y;
    precise vec3 origin = frame.origin + x * frame.origin_dx + y * frame.origin_dy;
    precise vec3 direction = frame.direction + x * frame.direction_dx + y * frame.direction_dy;
    return Ray(origin, direction, frame.camera_t_max);
}

// Where in its pixel a camera ray goes through: at one place, or, where there are several, at points of a scrambled
// (0, 2)-sequence, each pixel's own.
vec2 pixel_place(uint pixel) {
    if (!JITTERED) return vec2(frame.pixel_shift);
    uvec2 keys = pcg4d(uvec4(pixel % frame.pixels, 0u, KEY_CAMERA, frame.seed)).xy;
    return unit_floats(sobol_bits(sobol_digits(pixel / frame.pixels), keys));
}

Ray camera_ray(uint pixel) {
    precise vec2 raster = vec2(pixel_position(pixel)) + pixel_place(pixel);
    return camera_ray_through(raster);
}
