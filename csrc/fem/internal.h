/* What the files of the finite-element loops share. */
#ifndef AFE_INTERNAL_H
#define AFE_INTERNAL_H

#include <string.h>

#include "antiosc_fem.h"

/* One function for each kind of processor, where the linker can choose among them: with AVX-512, with
 * AVX2 and FMA, and others. Standard C keeps gcc from using FMA, which takes a tenth to a quarter less. */
#if defined(__x86_64__) && defined(__gnu_linux__) && __GNUC__ >= 12 && !defined(__clang__)
#define FOR_PROCESSORS                                                                                        \
    __attribute__((optimize("fp-contract=fast"),                                                              \
                   target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FOR_PROCESSORS
#endif
#define INLINE static inline __attribute__((always_inline))

/* names of functions that one source gives for several types */
#define JOINED(name, type) name##_##type
#define NAMED(name, type) JOINED(name, type)

#endif
