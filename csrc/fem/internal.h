/* What the files of the finite-element loops share. */
#ifndef AFE_INTERNAL_H
#define AFE_INTERNAL_H

#include <string.h>

#include "antiosc_fem.h"

/* One function for each kind of processor, where the linker can choose among them. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_PROCESSORS __attribute__((target_clones("avx512f", "avx2,fma", "default")))
#else
#define FOR_PROCESSORS
#endif
#define INLINE static inline __attribute__((always_inline))

/* names of functions that one source gives for several types */
#define JOINED(name, type) name##_##type
#define NAMED(name, type) JOINED(name, type)

#endif
