// Light of planes of a spike-continuous panel: drive, emission, and the images of still observers.
//
// A fragment has four neighbouring pixels of a row, one in each component, so words are not
// transposed and are fetched once for four pixels. The planes are unrolled: display/render/shader.py
// adds the switches before this text, and replaces BODY by a call for each plane. Code that a scene
// does not need is left out.

uniform usampler2D words0, words1, words2, words3;
uniform uint skip;    // bits of the word before the first plane, if less than a word is drawn
uniform int height;

#if INTERVALS
uniform usampler2D tau_before, age_before;
layout(location = 0) out uvec4 tau_after;
layout(location = 1) out uvec4 age_after;
#endif
#if MEMORY
uniform usampler2D memory_before, emitted_before;    // bits of floats, as for spans
layout(location = 2) out uvec4 memory_after;
layout(location = 3) out uvec4 emitted_after;
#endif
#if EMITS
uniform usampler2D level_before;
uniform float unit;   // unit of the stored level, packets a cycle
uniform vec3 rise, fall;            // (light of x, light of y, relative change) in the driven part
#if PULSED
uniform vec3 rest;                  // the same in the dark part of the plane
uniform float peak;                 // 1 / pulse
#endif
layout(location = LEVEL_AT) out uvec4 level_after;
#endif
#if SPANS
layout(location = SPANS_AT) out uvec4 span[GROUPS];  // bits of floats: GL does not blend integers
#endif
#if IMAGES
layout(location = IMAGES_AT) out vec4 image[IMAGES];
layout(std140) uniform Views { vec4 table[IMAGES * GROUPS]; };  // (weight, slope of the rows)
#endif

#ifdef GL_ARB_gpu_shader5
vec4 ones(uvec4 w) { return vec4(bitCount(w)); }
#else
vec4 ones(uvec4 w) {
    w -= (w >> 1u) & 0x55555555u;
    w = (w & 0x33333333u) + ((w >> 2u) & 0x33333333u);
    return vec4((((w + (w >> 4u)) & 0x0F0F0F0Fu) * 0x01010101u) >> 24u);
}
#endif

// b where `choose`, else a; mix() of GL 3.3 has floats only.
uvec4 pick(uvec4 a, uvec4 b, bvec4 choose) {
    uvec4 bits = 0u - uvec4(choose);
    return (a & ~bits) | (b & bits);
}

// In place of mix(held, 1 / run, spike), for which NVIDIA's driver 580.159 selects the wrong operand.
vec4 pick(vec4 a, vec4 b, bvec4 choose) {
    return uintBitsToFloat(pick(floatBitsToUint(a), floatBitsToUint(b), choose));
}

// Adds the light of a plane with the drive x.
#if EMITS
#define RELAX(drive, up, down) { \
    vec4 to = drive, from = vec4(level) * unit; \
    bvec4 more = greaterThan(to, from); \
    part += to * mix(vec4(down.x), vec4(up.x), more) + from * mix(vec4(down.y), vec4(up.y), more); \
    vec4 gone = (to - from) * mix(vec4(down.z), vec4(up.z), more); \
    /* from is rounded: the change may exceed the level by one unit */ \
    level = uvec4(max(ivec4(level) + ivec4(floor(gone / unit + 0.5)), 0)); }
#if PULSED
#define EMIT(x) RELAX((x * peak), rise, fall) RELAX(vec4(0.0), rest, rest)
#else
#define EMIT(x) RELAX(x, rise, fall)
#endif
#else
#define EMIT(x) part += x;
#endif

// A plane, bit n of the word. run: planes since the last spike, infinite before the first. held:
// 1 / tau. LEVEL and REMEMBER are expressions of the drive.
#if MEMORY
#define UPDATE memory = mix(memory, REMEMBER, spike);
#define ADD_EMITTED emitted = mix(emitted, vec4(0.0), spike) + x;
#else
#define UPDATE
#define ADD_EMITTED
#endif
#define AGE mix(run, vec4(0.0), spike)
// Intervals of DARK planes or more are dark, and no interval.
#if DARK
#define SHORT(planes) * clamp(vec4(DARK) - planes, 0.0, 1.0)
#else
#define SHORT(planes)
#endif
#if INTERVALS
#define PLANE(n) { \
    vec4 inverse = 1.0 / run SHORT(run); \
    uvec4 fired = (w >> uint(n)) & 1u; \
    bvec4 spike = notEqual(fired, uvec4(0u)); \
    UPDATE \
    held = pick(held, inverse, spike); \
    vec4 x = (LEVEL) SHORT(AGE); \
    ADD_EMITTED \
    run = mix(run + 1.0, vec4(1.0), spike); \
    EMIT(x) }
#else
#define PLANE(n) { uvec4 fired = (w >> uint(n)) & 1u; vec4 x = LEVEL; EMIT(x) }
#endif
#define COUNT(shift, mask) part += ones((w >> shift) & mask);
#define PART { light += part; part = vec4(0.0); }

// The end of a group of planes that share their weights.
#if IMAGES
#if SLOPES
#define TAKE_IMAGES(g) for (int i = 0; i < IMAGES; i++) { \
    few[i] += table[i * GROUPS + g].x * light; few_slope[i] += table[i * GROUPS + g].y * light; }
#define FOLD for (int i = 0; i < IMAGES; i++) { \
    sum[i] += few[i]; few[i] = vec4(0.0); slope_sum[i] += few_slope[i]; few_slope[i] = vec4(0.0); }
#else
#define TAKE_IMAGES(g) for (int i = 0; i < IMAGES; i++) few[i] += table[i * GROUPS + g].x * light;
#define FOLD for (int i = 0; i < IMAGES; i++) { sum[i] += few[i]; few[i] = vec4(0.0); }
#endif
#else
#define TAKE_IMAGES(g)
#define FOLD
#endif
#if SPANS
#define TAKE_SPAN(g) span[g] = floatBitsToUint(light);
#else
#define TAKE_SPAN(g)
#endif
#define GROUP(g) { TAKE_IMAGES(g) TAKE_SPAN(g) light = vec4(0.0); }

#if WHOLE
#define LOAD(texture_) { w = texelFetch(texture_, at, 0); any_spike |= w; }
#else
#define LOAD(texture_) { w = texelFetch(texture_, at, 0) >> skip; any_spike |= w & MASK; }
#endif

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    uvec4 w, any_spike = uvec4(0u);
    vec4 part = vec4(0.0), light = vec4(0.0);
#if IMAGES
    vec4 few[IMAGES], sum[IMAGES];
    for (int i = 0; i < IMAGES; i++) few[i] = sum[i] = vec4(0.0);
#if SLOPES
    vec4 few_slope[IMAGES], slope_sum[IMAGES];
    for (int i = 0; i < IMAGES; i++) few_slope[i] = slope_sum[i] = vec4(0.0);
#endif
#endif
#if INTERVALS
    uvec4 tau = texelFetch(tau_before, at, 0), age = texelFetch(age_before, at, 0);
    vec4 never = vec4(uintBitsToFloat(0x7F800000u));
    vec4 held = mix(1.0 / vec4(tau), vec4(0.0), equal(tau, uvec4(0u)));
    vec4 run = mix(vec4(age), never, equal(age, uvec4(0u)));
#endif
#if MEMORY
    vec4 memory = uintBitsToFloat(texelFetch(memory_before, at, 0));
    vec4 emitted = uintBitsToFloat(texelFetch(emitted_before, at, 0));
#endif
#if EMITS
    uvec4 level = texelFetch(level_before, at, 0);
#endif
    BODY
#if INTERVALS
    // Without a spike, the age increases up to FOREVER; with a spike, it is the count in `run`.
    bvec4 fired = notEqual(any_spike, uvec4(0u));
    uvec4 older = pick(min(age, uvec4(FOREVER - PLANES)) + PLANES, uvec4(0u), equal(age, uvec4(0u)));
    age_after = pick(older, uvec4(run), fired);
    vec4 interval = min(floor(1.0 / held + 0.5), vec4(4294967040.0));
    uvec4 new_tau = pick(uvec4(interval), uvec4(0u), equal(held, vec4(0.0)));
    tau_after = pick(tau, new_tau, fired);
#endif
#if MEMORY
    memory_after = floatBitsToUint(memory);
    emitted_after = floatBitsToUint(emitted);
#endif
#if EMITS
    level_after = level;
#endif
#if IMAGES
    for (int i = 0; i < IMAGES; i++) {
#if SLOPES
        image[i] = sum[i] + (float(at.y) / float(height)) * slope_sum[i];
#else
        image[i] = sum[i];
#endif
    }
#endif
}
