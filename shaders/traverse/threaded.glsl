// A binary tree in post-order whose nodes are sewn together: after a hit the right child lies just
// before its parent, after a miss or a leaf the node names where to go on. No stack at all.
// Twin: src/reference/traverse/threaded.rs.

#include "leaf.glsl"

#ifdef THREADED48
ThreadedNode48 load_threaded48(int i) { LOAD_ThreadedNode48(NODE_WORD, uint(i)) }
#else
ThreadedNode load_threaded(int i) { LOAD_ThreadedNode(NODE_WORD, uint(i)) }
#endif

struct Stop {
    vec3 pmin;
    vec3 pmax;
    int skip;
    int first;
    int last;
};

// first is -1 inside the tree.
Stop load_stop(int index) {
#ifdef THREADED48
    ThreadedNode48 node = load_threaded48(index);
    return node.left < 0 ? Stop(node.pmin, node.pmax, node.skip, -1 - node.left, -1 - node.right)
                         : Stop(node.pmin, node.pmax, node.skip, -1, -1);
#else
    ThreadedNode node = load_threaded(index);
    int packed_leaf = -1 - node.leaf;
    int first = packed_leaf >> int(LEAF_BITS);
    return Stop(node.pmin, node.pmax, node.skip, first, first + (packed_leaf & int(LEAF_LIMIT - 1u)));
#endif
}

// The next leaf whose ancestors' boxes the ray meets before t_max, and where to go on after it; first is
// -1 where none is left, or where the loop was cut short (then index is not).
Stop next_leaf(Slabs slabs, float t_max, inout int index) {
    Stop stop = Stop(vec3(0.0), vec3(0.0), index, -1, -1);
    while (index >= 0 && stop.first < 0) {
        stop = load_stop(index);
        bool enters = stop.first < 0 && meets_box(slabs, stop.pmin, stop.pmax, t_max);
        index = enters ? index - 1 : stop.skip;
    }
    return stop;
}

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    int index = int(frame.node_count) - 1;
    bool finished = true;
    bool more = true;
    while (more) {
        Stop stop = next_leaf(slabs, box_limit(hit.t), index);
        more = stop.first >= 0;
        if (more) finished = closest_of_leaf(ray, slabs, stop.first, stop.last, hit) && finished;
    }
    return finished && !more && index < 0;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int index = int(frame.node_count) - 1;
    bool finished = true;
    bool more = !occluded;
    while (more) {
        Stop stop = next_leaf(slabs, box_limit(ray.t_max), index);
        more = stop.first >= 0;
        if (more) finished = any_of_leaf(ray, slabs, stop.first, stop.last, occluded) && finished;
        more = more && !occluded;
    }
    return occluded || (finished && !more && index < 0);
}

#include "one_ray.glsl"
