// Proof of the layouts: takes records apart through the row's accessor and writes them as structs.
// `stage` picks the record by its place in the list of records.
#include "shared/scene.glsl"
#include "record_copies"

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < range.pixel_end) copy_record(range.stage, i);
}
