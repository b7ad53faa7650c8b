/* What the march takes from math.h, for WebAssembly without a C library: the functions that are no
 * instructions there are those of JavaScript's Math, which whoever loads the engine gives it. */
#define INFINITY __builtin_inff()
#define NAN __builtin_nanf("")
#define isfinite(x) (__builtin_fabs(x) < (double)INFINITY)
#define fabs __builtin_fabs
#define sqrt __builtin_sqrt
#define floor __builtin_floor
#define ceil __builtin_ceil
#define ldexp(x, n) ((x) * pow(2.0, (double)(n)))
#define exp2(x) pow(2.0, x)
#define lround(x) ((long)floor((x) + 0.5))
double cbrt(double x), cos(double x), sin(double x), exp(double x), expm1(double x), log(double x), log2(double x),
    pow(double x, double y);
