// Camera rays. Twin: src/reference/camera.rs.

// Pixels are numbered tile by tile (8x8), row by row within a tile; the last tiles may reach out of
// the image.
ivec2 pixel_position(uint pixel) {
    uint tiles_in_row = (frame.width + TILE_SIDE - 1u) / TILE_SIDE;
    uint tile = pixel / WORKGROUP_SIZE;
    uint place = pixel % WORKGROUP_SIZE;
    return ivec2((tile % tiles_in_row) * TILE_SIDE + place % TILE_SIDE,
                 (tile / tiles_in_row) * TILE_SIDE + place / TILE_SIDE);
}

bool inside_image(ivec2 position) {
    return position.x < int(frame.width) && position.y < int(frame.height);
}

Ray camera_ray(ivec2 position) {
    precise float x = float(position.x) + frame.pixel_shift;
    precise float y = float(position.y) + frame.pixel_shift;
    precise vec3 origin = frame.origin + x * frame.origin_dx + y * frame.origin_dy;
    precise vec3 direction = frame.direction + x * frame.direction_dx + y * frame.direction_dy;
    return Ray(origin, direction, frame.camera_t_max);
}
