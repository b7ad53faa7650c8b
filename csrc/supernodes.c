/* Solves with a Cholesky factor in single precision, whose time is that of reading it.
 *
 * A supernode is a run of columns that meet the same rows below; `own` holds its rows of x.
 */
#include "internal.h"

#define LANES 16 /* sums that run beside each other */

/* one column of a supernode: own[i] -= c[i] x */
INLINE void subtract(int64_t n, const float *c, float x, float *own) {
    for (int64_t i = 0; i < n; i++)
        own[i] -= c[i] * x;
}

INLINE float product(int64_t n, const float *c, const float *own) {
    float sums[LANES] = {0}, total = 0.0F;
    int64_t i = 0;
    for (; i + LANES <= n; i += LANES)
        for (int l = 0; l < LANES; l++)
            sums[l] += c[i + l] * own[i + l];
    for (; i < n; i++)
        total += c[i] * own[i];
    for (int l = 0; l < LANES; l++)
        total += sums[l];
    return total;
}

FOR_PROCESSORS
void aom_supernodes_forward(const aom_supernodes *L, float *x, float *own) {
    for (int64_t s = 0; s < L->n_supernodes; s++) {
        const int64_t *rows = L->rows + L->row[s];
        int64_t height = L->row[s + 1] - L->row[s], width = L->start[s + 1] - L->start[s];
        const float *column = L->values + L->value[s];
        for (int64_t i = 0; i < width; i++)
            own[i] = x[L->start[s] + i];
        memset(own + width, 0, (size_t)(height - width) * sizeof *own);
        for (int64_t j = 0; j < width; j++, column += height) {
            own[j] /= column[j];
            subtract(height - j - 1, column + j + 1, own[j], own + j + 1);
        }
        for (int64_t i = 0; i < width; i++)
            x[rows[i]] = own[i];
        for (int64_t i = width; i < height; i++)
            x[rows[i]] += own[i];
    }
}

FOR_PROCESSORS
void aom_supernodes_backward(const aom_supernodes *L, float *x, float *own) {
    for (int64_t s = L->n_supernodes - 1; s >= 0; s--) {
        const int64_t *rows = L->rows + L->row[s];
        int64_t height = L->row[s + 1] - L->row[s], width = L->start[s + 1] - L->start[s];
        const float *column = L->values + L->value[s] + width * height;
        for (int64_t i = 0; i < height; i++)
            own[i] = x[rows[i]];
        for (int64_t j = width - 1; j >= 0; j--) {
            column -= height;
            own[j] -= product(height - j - 1, column + j + 1, own + j + 1);
            own[j] /= column[j];
        }
        for (int64_t i = 0; i < width; i++)
            x[rows[i]] = own[i];
    }
}
