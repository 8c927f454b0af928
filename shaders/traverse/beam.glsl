// What a subgroup's rays have in common: their starts lie in one box, their directions in another, and what no such ray could
// meet none of them does (interval arithmetic on packets: Boulos, Wald and Shirley, "Geometric and Arithmetic Culling Methods for
// Entire Ray Packets", 2006). All lanes take part in what is found together.
// Twin: src/reference/traverse/beam.rs.

// Farther than any scene.
#define NOWHERE 1e30
// Stands for a direction's component of 0, on the side that lets more through.
#define LEAST_COMPONENT 1e-20

struct Bounds {
    vec3 low;
    vec3 high;
};

// Of all lanes' bounds; those that do not take part may have any. As floats: reductions of integers, which an H100 has an instruction for,
// gave bounds of some lanes alone in one of two kernels (docs/measurements.md).
Bounds bounds_together(Bounds own, bool takes_part) {
    vec3 low = takes_part ? own.low : vec3(NOWHERE);
    vec3 high = takes_part ? own.high : vec3(-NOWHERE);
    return Bounds(subgroupMin(low), subgroupMax(high));
}

struct Beam {
    Bounds starts;
    // Of the directions' bounds, without zeros.
    vec3 low;
    vec3 high;
    vec3 low_inverse;
    vec3 high_inverse;
};

Beam beam_of(Bounds starts, Bounds directions) {
    vec3 low = mix(directions.low, vec3(-LEAST_COMPONENT), lessThan(abs(directions.low), vec3(LEAST_COMPONENT)));
    vec3 high = mix(directions.high, vec3(LEAST_COMPONENT), lessThan(abs(directions.high), vec3(LEAST_COMPONENT)));
    return Beam(starts, low, high, 1.0 / low, 1.0 / high);
}

// A ray each of the lanes that take part.
Beam beam_of_rays(bool takes_part, vec3 origin, vec3 direction) {
    Bounds starts = bounds_together(Bounds(origin, origin), takes_part);
    return beam_of(starts, bounds_together(Bounds(direction, direction), takes_part));
}

// Whether some ray of the beam may meet the box, which has to be grown by what this errs (`beam_pad` of src/pack.rs). After t, rays of the beam
// lie between starts.low + t low and starts.high + t high: so t is bounded by where the one leaves the box and where the
// other enters it.
bool beam_meets(Beam beam, Bounds box) {
    vec3 below = (box.high - beam.starts.low) * beam.low_inverse;
    vec3 above = (box.low - beam.starts.high) * beam.high_inverse;
    bvec3 low_rises = greaterThan(beam.low, vec3(0.0));
    bvec3 high_rises = greaterThan(beam.high, vec3(0.0));
    vec3 enter = max(mix(below, vec3(0.0), low_rises), mix(vec3(0.0), above, high_rises));
    vec3 leave = min(mix(vec3(NOWHERE), below, low_rises), mix(above, vec3(NOWHERE), high_rises));
    return max(max(max(enter.x, enter.y), enter.z), 0.0) <= min(min(leave.x, leave.y), leave.z);
}
