// Any hit with nodes that hold both children's boxes: the left child first, the larger one, since which one is nearer does not tell which one
// occludes. Twin: src/reference/traverse/children.rs.

#ifdef USES_ANY

bool any_hit_left_first(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int reference = ROOT;
    bool finished = true;
    bool more = !occluded;
    while (more) {
        bool descends = false;
        if (reference >= 0) {
            COUNT_VISIT();
            Children node = open_pair(slabs, reference);
            bvec2 meets = meets_pair(node.intervals, box_limit(ray.t_max));
            descends = meets.x || meets.y;
            if (meets.x && meets.y) stack[top++] = node.right;
            reference = meets.x ? node.left : node.right;
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
