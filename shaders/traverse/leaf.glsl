// The triangles of a leaf, from first to last. Trees with one triangle a leaf need no loop.

CONSTANT(SPEC_LEAF_SIZE, uint, LEAF_SIZE, 8);

// Returns whether it came to its end, as does `any_of_leaf`: on any device, since `packet` lost rays on an H100 where it did not ask (docs/measurements.md).
bool closest_of_leaf(Ray ray, Slabs slabs, int first, int last, inout Hit hit) {
    if (LEAF_SIZE == 1u) {
        closest_of_triangle(ray, slabs, first, hit);
        return true;
    }
    int i = first;
    for (; i <= last; i++) {
        closest_of_triangle(ray, slabs, i, hit);
    }
    return i > last;
}

bool any_of_leaf(Ray ray, Slabs slabs, int first, int last, inout bool occluded) {
    if (LEAF_SIZE == 1u) {
        occluded = any_of_triangle(ray, slabs, first);
        return true;
    }
    int i = first;
    for (; i <= last && !occluded; i++) {
        occluded = any_of_triangle(ray, slabs, i);
    }
    return occluded || i > last;
}
