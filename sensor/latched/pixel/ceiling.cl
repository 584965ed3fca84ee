// The least work that turns charge into a spike bit: one 32-bit addition, whose carry is the spike, and
// the packing of that bit. Its throughput on a device is the upper limit in benchmarks of the pixel.
__kernel void ceiling(__global uint *phase_, __global const uint *add_, __global uint *words,
                      const uint n)
{
    const size_t g = get_global_id(0), stride = get_global_size(0);
    uint16 phase = vload16(g, phase_);
    const uint16 add = vload16(g, add_);
    for (uint w = 0; w < n; w++) {
        uint16 word = 0;
#pragma unroll
        for (uint b = 0; b < 32; b++) {
            phase += add;
            word |= as_uint16(phase < add) & (1u << b);
        }
        vstore16(word, w * stride + g, words);
    }
    vstore16(phase, g, phase_);
}
