// The rays of a subgroup share one stack, as in packet.glsl, and each lane has several: the node's words and everything
// that steers the walk are shared by them, and what a box or a triangle is as seen from a lane's origin is shared by the
// lane's rays, which all start there. Nodes have four children. All that steers the walk is voted on, so it is the same in
// all lanes.
// Twin: src/reference/traverse/bundle.rs.

#include "together.glsl"

#ifdef USES_CLOSEST
#include "bundle_closest.glsl"
#endif

#ifdef USES_ANY
#include "bundle_any.glsl"
#endif
