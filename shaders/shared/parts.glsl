// Rays traced over several dispatches, each with a part of the triangles (methods that define
// CARRIES_STATE). The carry buffer keeps a pixel's state between them. Other methods always see all
// triangles.

#ifdef CARRIES_STATE

STORAGE_BLOCK(BINDING_CARRY) buffer CarryBlock { Carry carries[]; };

bool last_part() { return range.triangle_end == frame.triangle_count; }

// The closest hit of the parts before, if there were any.
Hit carried_hit(float t_max) {
    if (range.stage != STAGE_ANY && range.triangle_begin == 0u) return no_hit(t_max);
    Carry carry = carries[pixel - range.pixel_base];
    return Hit(carry.t, carry.u, carry.v, carry.index, carry.id);
}

void carry_hit(Hit hit) {
    carries[pixel - range.pixel_base] = Carry(hit.t, hit.u, hit.v, hit.index, hit.id, 0u, 0u, 0u);
}

bool carried_occlusion() {
    return range.triangle_begin > 0u && carries[pixel - range.pixel_base].occluded == 1u;
}

void carry_occlusion(bool occluded) {
    carries[pixel - range.pixel_base].occluded = occluded ? 1u : 0u;
}

#else

bool last_part() { return true; }
Hit carried_hit(float t_max) { return no_hit(t_max); }
void carry_hit(Hit hit) {}
bool carried_occlusion() { return false; }
void carry_occlusion(bool occluded) {}

#endif
