// Any hit with nodes that hold both children's boxes: the left child first, the larger one, since which one is nearer does not tell which one
// occludes. Twin: src/reference/traverse/children.rs.

#include "met_children.glsl"

#ifdef USES_ANY

bool any_hit_left_first(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    BOX_RAY box_ray = BOX_RAY_OF(ray, slabs);
    int top = 0;
    int reference = ROOT;
    bool finished = true;
    bool more = !occluded;
    while (more) {
        bool descends = false;
        if (reference >= 0) {
            COUNT_VISIT();
            ivec2 children;
            bvec2 meets = met_children(box_ray, reference, box_limit(ray.t_max), children);
            descends = meets.x || meets.y;
            if (meets.x && meets.y) stack[top++] = children.y;
            reference = meets.x ? children.x : children.y;
        } else {
            finished = any_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), occluded) && finished;
        }
        more = descends || (!occluded && top > 0);
        if (!more) {
            reference = NOTHING;
        } else if (!descends) {
            reference = stack[--top];
        }
    }
    return occluded || (finished && reference == NOTHING);
}

#endif
