// Where the rays through a square of pixels begin: body of pixels.frag and pixels.comp, of which a pixel is a square of
// BLOCK x BLOCK. A cone around its middle ray is followed as long as all of it is outside (cone marching).
//@ include pixel.glsl
//@ include offset_foot.glsl

const int START_STEPS = 32;
const float BEYOND = 1e30;  // no ray of the square meets the surface

// color.x: the distance from the origins of rays
Pixel pixel_at(ivec2 square) {
    read_receivers();
    vec2 corner = vec2(BLOCK * square);
    vec2 middle = corner + 0.5 * float(BLOCK);
    vec3 origin = ray_origin(middle);
    vec3 direction = normalize(ray_direction(middle));
    vec2 width = vec2(0.0);  // radius of the cone: x + t y
    for (int i = 0; i < 4; i++) {
        vec2 other = corner + float(BLOCK) * vec2(i & 1, i >> 1);
        vec3 way = normalize(ray_direction(other));
        width = max(width, vec2(distance(ray_origin(other), origin), distance(way, direction)));
    }
    vec3 upper = shell_lower + shell_cell * vec3(shell_counts);
    float reach = width.x + width.y * (distance(origin, shell_lower) + distance(shell_lower, upper));
    vec2 range = box_interval(origin, direction, shell_lower - reach, upper + reach);
    float shortest = max(SHORTEST * relief_step, tolerance);
    float longest = min(shell_cell, LONGEST * relief_step);
    float t = range.x;
    Foot foot = Foot(vec3(0.0), vec3(0.0), 0.0, 0.0);
    bool tracked = false;
    for (int i = 0; i < START_STEPS && t <= range.y; i++) {
        vec3 p = origin + t * direction;
        float radius = width.x + t * width.y;
        float free = free_way(p) - radius;
        if (free > LEAST_FREE * shell_cell) {
            tracked = false;
            t += free / (1.0 + width.y);
            continue;
        }
        follow(foot, p, tracked, 0.1 * shortest);
        tracked = true;
        Nearness near = nearness(foot, direction, 2.0 * radius + shortest);
        // normals turn in the cone, and feet are as far apart as its width
        near.nearing += radius / (STEPS_PER_RADIUS * relief_step);
        vec4 steepest = sqrt(1.0 + near.slopes * near.slopes);
        vec4 rates = near.nearing + near.across * near.slopes + steepest * width.y;
        vec4 ways = (near.gap - steepest * radius) / rates;
        ways = min(ways, (cone_lengths / max(near.pace, 1e-6) - radius) / (near.across + width.y + 1e-6));
        float way = max(max(ways.x, ways.y), max(ways.z, ways.w));
        if (way < max(shortest, 0.3 * radius)) {
            t += max(way, 0.0);
            break;
        }
        t += min(way, longest);
    }
    Pixel pixel;
    pixel.color = vec4(t > range.y ? BEYOND : t, 0.0, 0.0, 0.0);
    return pixel;
}
