/* Memory of the caller's, given out array by array. */
#ifndef AOM_ARENA_H
#define AOM_ARENA_H

#include <stddef.h>

/* Where the next array begins; without memory only the size is counted. */
typedef struct arena {
    char *at;
    size_t used;
} arena;

static inline void *take(arena *a, size_t count, size_t size) {
    size_t begin = a->used;
    a->used += (count * size + 15) & ~(size_t)15;
    return a->at == NULL ? NULL : a->at + begin;
}

#endif
