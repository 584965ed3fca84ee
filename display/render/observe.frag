// The image of a moving observer: spans of light, each shifted, bilinear, dark outside.
//
// A fragment has four neighbouring pixels of a row, as in drive.frag, which writes the spans.

uniform usampler2D span0, span1, span2, span3;
uniform int height;
layout(location = 0) out vec4 image;
// For each span (weight, slope, dy fraction, dy slope), (dx fraction, dx slope, dy integer, dx
// integer). Integers are separate, so that a shift of thousands of pixels keeps its precision.
layout(std140) uniform Views { vec4 table[2 * GROUPS]; };

vec4 quad(usampler2D span, int column, int row) {
    ivec2 size = textureSize(span, 0);
    bool inside = column >= 0 && column < size.x && row >= 0 && row < size.y;
    ivec2 at = clamp(ivec2(column, row), ivec2(0), size - 1);
    return inside ? uintBitsToFloat(texelFetch(span, at, 0)) : vec4(0.0);
}

// Light at columns x + f to x + 3 + f of a row.
vec4 line(usampler2D span, int x, float f, int row) {
    vec4 low = quad(span, x >> 2, row), high = quad(span, (x >> 2) + 1, row);
    if ((x & 1) != 0) { low = vec4(low.yzw, high.x); high = vec4(high.yzw, 0.0); }
    if ((x & 2) != 0) { low = vec4(low.zw, high.xy); high = vec4(high.zw, 0.0, 0.0); }
    return low * (1.0 - f) + vec4(low.yzw, high.x) * f;
}

#define ADD_SPAN(g, span) { \
    vec4 a = table[2 * g], b = table[2 * g + 1]; \
    float sx = b.x + b.y * place, fx = sx - floor(sx); \
    int x = 4 * at.x + int(b.w) + int(floor(sx)); \
    float sy = a.z + a.w * place, fy = sy - floor(sy); \
    int y = at.y + int(b.z) + int(floor(sy)); \
    LINES(span) \
    sum += (a.x + a.y * place) * moved; }
#if VERTICAL
#define LINES(span) vec4 moved = line(span, x, fx, y) * (1.0 - fy) + line(span, x, fx, y + 1) * fy;
#else
#define LINES(span) vec4 moved = line(span, x, fx, y);
#endif

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    float place = float(at.y) / float(height);
    vec4 sum = vec4(0.0);
    BODY
    image = sum;
}
