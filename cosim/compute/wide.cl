// Beginning of a kernel's source. WIDE: without this attribute the compiler splits sixteen lanes into
// vectors of half the width.
#ifndef WIDE
#ifndef __has_attribute // not all compilers have these
#define __has_attribute(name) 0
#endif
#ifndef __has_builtin
#define __has_builtin(name) 0
#endif
#if __has_attribute(min_vector_width)
#define WIDE __attribute__((min_vector_width(512)))
#else
#define WIDE
#endif
#endif
