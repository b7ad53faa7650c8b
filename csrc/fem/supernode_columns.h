/* Solves with a factor whose values have the type VALUE.
 *
 * A supernode is a run of columns that meet the same rows below; `own` holds its rows of x. `count`
 * columns are taken at a time, `stride` values apart; c and own begin at the diagonal of the first.
 * Columns are too short for the processor to foresee the next ones, which are fetched meanwhile.
 */
typedef VALUE packed __attribute__((vector_size(RUN * sizeof(VALUE)), may_alias, aligned(sizeof(VALUE))));
#define UNPACKED(at) __builtin_convertvector(*(const packed *)(at), many)

/* own becomes L⁻¹own in the rows of the columns; in the `rows` - count below, their share is subtracted */
INLINE void forward_columns(int count, int64_t rows, int64_t stride, const VALUE *c, const float *scale,
                            float *own) {
    float x[COLUMNS];
    for (int q = 0; q < count; q++) {
        for (int p = 0; p < q; p++)
            own[q] -= (float)c[p * stride + q] * x[p];
        x[q] = own[q] / (float)c[q * stride + q];
        own[q] = x[q] / scale[q];
    }
    int64_t i = count;
    for (; i + RUN <= rows; i += RUN) {
        many *below = (many *)(own + i), sum = *below;
        for (int q = 0; q < count; q++) {
            __builtin_prefetch(c + (q + count) * stride + i);
            sum -= UNPACKED(c + q * stride + i) * x[q];
        }
        *below = sum;
    }
    for (; i < rows; i++)
        for (int q = 0; q < count; q++)
            own[i] -= (float)c[q * stride + i] * x[q];
}

/* own becomes L⁻ᵀ own in the rows of the columns, from the rows below */
INLINE void backward_columns(int count, int64_t rows, int64_t stride, const VALUE *c, const float *scale,
                             float *own) {
    many sums[COLUMNS];
    memset(sums, 0, sizeof sums);
    int64_t end = count;
    for (; end + RUN <= rows; end += RUN) {
        many below = *(const many *)(own + end);
        for (int q = 0; q < count; q++) {
            __builtin_prefetch(c + (q - count) * stride + end);
            sums[q] += UNPACKED(c + q * stride + end) * below;
        }
    }
    for (int q = count - 1; q >= 0; q--) {
        const VALUE *column = c + q * stride;
        float total = 0.0F;
        for (int l = 0; l < RUN; l++)
            total += sums[q][l];
        for (int64_t i = end; i < rows; i++)
            total += (float)column[i] * own[i];
        for (int i = q + 1; i < count; i++)
            total += (float)column[i] * own[i];
        own[q] = (own[q] / scale[q] - total) / (float)column[q];
    }
}

FOR_PROCESSORS
void NAMED(afe_supernodes_forward, VALUE)(const afe_supernodes *L, float *x, float *own) {
    for (int64_t s = 0; s < L->n_supernodes; s++) {
        const int64_t *rows = L->rows + L->row[s];
        int64_t first = L->start[s], width = L->start[s + 1] - first, height = L->row[s + 1] - L->row[s];
        const VALUE *values = (const VALUE *)L->values + L->value[s];
        const float *scale = L->scale + first;
        for (int64_t i = 0; i < width; i++)
            own[i] = x[first + i];
        memset(own + width, 0, (size_t)(height - width) * sizeof *own);
        int64_t j = 0;
        for (; j + COLUMNS <= width; j += COLUMNS)
            forward_columns(COLUMNS, height - j, height, values + j * (height + 1), scale + j, own + j);
        for (; j < width; j++)
            forward_columns(1, height - j, height, values + j * (height + 1), scale + j, own + j);
        for (int64_t i = 0; i < width; i++)
            x[rows[i]] = own[i];
        for (int64_t i = width; i < height; i++)
            x[rows[i]] += own[i];
    }
}

FOR_PROCESSORS
void NAMED(afe_supernodes_backward, VALUE)(const afe_supernodes *L, float *x, float *own) {
    for (int64_t s = L->n_supernodes - 1; s >= 0; s--) {
        const int64_t *rows = L->rows + L->row[s];
        int64_t first = L->start[s], width = L->start[s + 1] - first, height = L->row[s + 1] - L->row[s];
        const VALUE *values = (const VALUE *)L->values + L->value[s];
        const float *scale = L->scale + first;
        for (int64_t i = 0; i < height; i++)
            own[i] = x[rows[i]];
        int64_t j = width;
        for (; j % COLUMNS; j--)
            backward_columns(1, height - j + 1, height, values + (j - 1) * (height + 1), scale + j - 1,
                             own + j - 1);
        for (; j; j -= COLUMNS)
            backward_columns(COLUMNS, height - j + COLUMNS, height,
                             values + (j - COLUMNS) * (height + 1), scale + j - COLUMNS,
                             own + j - COLUMNS);
        for (int64_t i = 0; i < width; i++)
            x[rows[i]] = own[i];
    }
}

#undef UNPACKED
