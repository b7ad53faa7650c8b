/* A Cholesky factor in single precision, where each supernode takes its share of those to its left by
 * BLAS; and the same factor in 16 bits. */
#include "internal.h"

/* Rows of a supernode that are still to be subtracted from supernodes to its right. */
typedef struct pending {
    int64_t from; /* the first of them among its rows */
    int64_t next; /* another supernode that waits for the same one; -1: none */
} pending;

static int64_t height_of(const afe_supernodes *L, int64_t s) { return L->row[s + 1] - L->row[s]; }

static int64_t width_of(const afe_supernodes *L, int64_t s) { return L->start[s + 1] - L->start[s]; }

/* The columns of A in supernode s, whose row r stands at place[r]. */
static void take_columns(const afe_supernodes *L, int64_t s, const afe_lower *A, const int64_t *place,
                         float *values) {
    int64_t height = height_of(L, s), width = width_of(L, s);
    memset(values, 0, (size_t)(height * width) * sizeof *values);
    for (int64_t j = 0; j < width; j++) {
        int64_t column = L->start[s] + j;
        for (int64_t k = A->start[column]; k < A->start[column + 1]; k++)
            values[j * height + place[A->rows[k]]] = A->values[k];
    }
}

/* Subtract from supernode s the product of the next rows of supernode d, `count` of which are columns of s. */
static void subtract(const afe_supernodes *L, int64_t d, int64_t from, int64_t count, int64_t s,
                     const int64_t *place, const afe_blas *blas, float *update, float *values) {
    const int64_t *rows = L->rows + L->row[d] + from;
    const float *block = (const float *)L->values + L->value[d] + from;
    int n = (int)count, m = (int)(height_of(L, d) - from), below = m - n;
    int height = (int)height_of(L, d), width = (int)width_of(L, d);
    float one = 1.0F, zero = 0.0F;
    blas->syrk("L", "N", &n, &width, &one, block, &height, &zero, update, &m);
    if (below)
        blas->gemm("N", "T", &below, &n, &width, &one, block + n, &height, block, &height, &zero,
                   update + n, &m);
    int64_t into = height_of(L, s);
    for (int j = 0; j < n; j++) {
        float *column = values + place[rows[j]] * into;
        for (int i = j; i < m; i++)
            column[place[rows[i]]] -= update[(int64_t)j * m + i];
    }
}

/* Let supernode d wait for the one that has its next row among its columns. */
static void queue(const afe_supernodes *L, const int64_t *owner, int64_t d, pending *of, int64_t *waiting) {
    if (of[d].from == height_of(L, d))
        return;
    int64_t s = owner[L->rows[L->row[d] + of[d].from]];
    of[d].next = waiting[s];
    waiting[s] = d;
}

int afe_supernodes_factor(const afe_supernodes *L, const afe_lower *A, const afe_blas *blas,
                          int64_t *work, float *update) {
    int64_t supernodes = L->n_supernodes, columns = L->start[supernodes];
    int64_t *place = work, *owner = place + columns, *waiting = owner + columns;
    pending *of = (pending *)(waiting + supernodes);
    for (int64_t s = 0; s < supernodes; s++) {
        waiting[s] = -1;
        for (int64_t j = L->start[s]; j < L->start[s + 1]; j++)
            owner[j] = s;
    }
    for (int64_t s = 0; s < supernodes; s++) {
        const int64_t *rows = L->rows + L->row[s];
        float *values = (float *)L->values + L->value[s], one = 1.0F;
        int height = (int)height_of(L, s), width = (int)width_of(L, s), below = height - width, failed;
        for (int64_t i = 0; i < height; i++)
            place[rows[i]] = i;
        take_columns(L, s, A, place, values);
        for (int64_t d = waiting[s], next; d >= 0; d = next) {
            next = of[d].next;
            int64_t from = of[d].from, end = from;
            while (end < height_of(L, d) && L->rows[L->row[d] + end] < L->start[s + 1])
                end++;
            subtract(L, d, from, end - from, s, place, blas, update, values);
            of[d].from = end;
            queue(L, owner, d, of, waiting);
        }
        blas->potrf("L", &width, values, &height, &failed);
        if (failed)
            return 0;
        if (below)
            blas->trsm("R", "L", "T", "N", &below, &width, &one, values, &height, values + width, &height);
        of[s].from = width;
        queue(L, owner, s, of, waiting);
    }
    return 1;
}

typedef int16_t int16 __attribute__((may_alias)); /* stands where single precision has been read */

void afe_supernodes_to_16_bits(const afe_supernodes *L, float *scale) {
    for (int64_t s = 0; s < L->n_supernodes; s++) {
        int64_t height = height_of(L, s);
        for (int64_t j = 0; j < width_of(L, s); j++) {
            int64_t first = L->value[s] + j * height;
            const float *column = (const float *)L->values + first;
            int16 *rounded = (int16 *)L->values + first;
            float largest = 0.0F;
            for (int64_t i = j; i < height; i++) {
                float size = column[i] < 0.0F ? -column[i] : column[i];
                largest = size > largest ? size : largest;
            }
            for (int64_t i = 0; i < height; i++) {
                float x = column[i] * (INT16_MAX / largest);
                rounded[i] = i < j ? 0 : (int16_t)(x < 0.0F ? x - 0.5F : x + 0.5F);
            }
            if (rounded[j] < 1)
                rounded[j] = 1; /* no division by zero */
            scale[L->start[s] + j] = largest / INT16_MAX;
        }
    }
}
