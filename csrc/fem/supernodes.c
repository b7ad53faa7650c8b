/* Solves with a Cholesky factor in single precision or in 16 bits, whose time is that of reading it. */
#include "internal.h"

#define RUN 16    /* rows that are taken at a time */
#define COLUMNS 4 /* columns that are taken at a time: their rows of x are read once */

typedef float many __attribute__((vector_size(RUN * sizeof(float)), may_alias, aligned(sizeof(float))));

/* names of functions and types for each type of the values */
#define packed NAMED(packed, VALUE)
#define forward_columns NAMED(forward_columns, VALUE)
#define backward_columns NAMED(backward_columns, VALUE)

#define VALUE float
#include "supernode_columns.h"
#undef VALUE
#define VALUE int16_t
#include "supernode_columns.h"
#undef VALUE

#undef packed
#undef forward_columns
#undef backward_columns
