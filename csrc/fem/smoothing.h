/* Smoothing of multigrid in the precision REAL. */

INLINE void smooth_blocks(int64_t n, int64_t b, const REAL *inverse, const REAL *residual, REAL keep, REAL gain,
                          REAL *step, REAL *sum) {
    for (int64_t i = 0; i < n; i++) {
        REAL own[AFE_MOST_BLOCK];
        for (int64_t r = 0; r < b; r++) {
            own[r] = 0;
            for (int64_t c = 0; c < b; c++)
                own[r] += inverse[(i * b + r) * b + c] * residual[i * b + c];
            own[r] *= gain;
        }
        for (int64_t r = 0; r < b; r++) {
            REAL *s = step + i * b + r;
            *s = keep == 0 ? own[r] : keep * *s + own[r];
            sum[i * b + r] = keep == 0 ? *s : sum[i * b + r] + *s;
        }
    }
}

FOR_PROCESSORS
void NAMED(afe_smooth, REAL)(int64_t n, int64_t b, const REAL *inverse, const REAL *residual, REAL keep, REAL gain,
                             REAL *step, REAL *sum) {
    if (b == 3)
        smooth_blocks(n, 3, inverse, residual, keep, gain, step, sum);
    else
        smooth_blocks(n, b, inverse, residual, keep, gain, step, sum);
}
