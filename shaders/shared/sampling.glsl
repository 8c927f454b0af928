// Directions of ambient rays. Twin: src/reference/sampling.rs.

// A unit vector along v; v must not be zero.
vec3 normalized(vec3 v) {
    float largest = max_abs(v);
    precise vec3 scaled = v * reciprocal(largest);
    precise vec3 unit = scaled * reciprocal_sqrt(dot3(scaled, scaled));
    return unit;
}

// Two vectors that complete n to an orthonormal basis: Duff et al., "Building an Orthonormal Basis,
// Revisited" (2017).
void basis_of(vec3 n, out vec3 tangent, out vec3 bitangent) {
    float side = n.z >= 0.0 ? 1.0 : -1.0;
    precise float a = -side * reciprocal(1.0 + abs(n.z));
    precise float b = n.x * n.y * a;
    precise vec3 first = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    precise vec3 second = vec3(b, side + n.y * n.y * a, -n.y);
    tangent = first;
    bitangent = second;
}

// A direction with density cos(theta) / pi about n (Malley's method); u in [0, 1]^2.
vec3 cosine_direction(vec2 u, vec3 n, vec3 tangent, vec3 bitangent) {
    precise float rest = 1.0 - u.x;
    precise float cos_theta = u.x * reciprocal_sqrt(u.x);
    precise float sin_theta = rest * reciprocal_sqrt(rest);
    vec2 turn = cos_sin_turn(u.y);
    precise vec3 direction =
        (sin_theta * turn.x) * tangent + (sin_theta * turn.y) * bitangent + cos_theta * n;
    return direction;
}
