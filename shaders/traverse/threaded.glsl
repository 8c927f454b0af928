// A binary tree in post-order whose nodes are sewn together: after a hit the right child lies just
// before its parent, after a miss or a leaf the node names where to go on. No stack at all.
// Twin: src/reference/traverse/threaded.rs.

#include "leaf.glsl"

#ifdef NODES_THREADED48
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
#ifdef NODES_THREADED48
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

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    int index = int(frame.node_count) - 1;
    bool finished = true;
    while (index >= 0) {
        COUNT_VISIT();
        Stop stop = load_stop(index);
        if (stop.first >= 0) {
            finished = closest_of_leaf(ray, slabs, stop.first, stop.last, hit) && finished;
            index = stop.skip;
        } else {
            index = meets_box(slabs, stop.pmin, stop.pmax, box_limit(hit.t)) ? index - 1 : stop.skip;
        }
    }
    return finished && index < 0;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int index = int(frame.node_count) - 1;
    bool finished = true;
    while (index >= 0 && !occluded) {
        COUNT_VISIT();
        Stop stop = load_stop(index);
        if (stop.first >= 0) {
            finished = any_of_leaf(ray, slabs, stop.first, stop.last, occluded) && finished;
            index = stop.skip;
        } else {
            index = meets_box(slabs, stop.pmin, stop.pmax, box_limit(ray.t_max)) ? index - 1 : stop.skip;
        }
    }
    return occluded || (finished && index < 0);
}

#include "one_ray.glsl"
