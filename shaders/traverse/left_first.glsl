// Any hit with nodes that hold both children's boxes: the left child first, the larger one, since which one is nearer does not tell which one
// occludes. Twin: src/reference/traverse/children.rs.

#ifdef USES_ANY

// A node's children, and which of their boxes the ray meets up to t_max.
#ifdef NODES_CENTRED
#define BOX_RAY GrownRay
#define BOX_RAY_OF(ray, slabs) grown_ray_of(ray)
bvec2 met_children(GrownRay ray, int reference, float t_max, out ivec2 children) {
    CentredNode node = load_centred(reference);
    children = ivec2(node.left, node.right);
    return bvec2(meets_grown(ray, node.left_center, node.left_half, t_max),
                 meets_grown(ray, node.right_center, node.right_half, t_max));
}
#else
#define BOX_RAY Slabs
#define BOX_RAY_OF(ray, slabs) slabs
bvec2 met_children(Slabs slabs, int reference, float t_max, out ivec2 children) {
    Children node = open_pair(slabs, reference);
    children = ivec2(node.left, node.right);
    return meets_pair(node.intervals, t_max);
}
#endif

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
