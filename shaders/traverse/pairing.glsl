// Lanes of a subgroup that give work to others, paired with those that take some.

// Of each subgroup: the lane that gives to the first, the second, ... that takes.
shared uint giving_lanes[WORKGROUP_SIZE];

uint lanes_with(bool condition) { return subgroupBallotBitCount(subgroupBallot(condition)); }

// Leaves `takes` and `gives` to as many lanes as have one another; a lane does one of them at most. Returns the lane that gives to this one, itself where it
// takes nothing. Every lane of the subgroup calls this.
uint pair_up(inout bool takes, inout bool gives) {
    uvec4 takers = subgroupBallot(takes);
    uvec4 givers = subgroupBallot(gives);
    uint pairs = min(subgroupBallotBitCount(takers), subgroupBallotBitCount(givers));
    uint rank = subgroupBallotExclusiveBitCount(takes ? takers : givers);
    takes = takes && rank < pairs;
    gives = gives && rank < pairs;
    // A driver may run subgroups of fewer lanes than it tells of.
    uint place = gl_SubgroupID * (WORKGROUP_SIZE / gl_NumSubgroups) + rank;
    if (gives) giving_lanes[place] = gl_SubgroupInvocationID;
    subgroupBarrier();
    return takes ? giving_lanes[place] : gl_SubgroupInvocationID;
}
