/* antiosc_fem.h - loops of finite elements that Python is too slow for: products over the cells of a mesh.
 *
 * No function keeps anything, allocates anything or fails; memory is the caller's. Arrays are row-major.
 * It is C99 with vectors of gcc and clang: compile antiosc_fem.c, which includes the other files. */
#ifndef ANTIOSC_FEM_H
#define ANTIOSC_FEM_H

#include <stddef.h>
#include <stdint.h>

#ifndef AFE_API
#if defined(_WIN32)
#define AFE_API __declspec(dllexport)
#elif defined(__GNUC__)
#define AFE_API __attribute__((visibility("default")))
#else
#define AFE_API
#endif
#endif

/* ---- Tetrahedra ---------------------------------------------------------------------------------- */

#define AFE_LANES 8       /* cells that are taken at a time */
#define AFE_TETRA_DATA 12 /* numbers of a cell below */

/* Straight quadratic tetrahedra of isotropic material, in groups of AFE_LANES; where the last group is
 * not full its data are zero. Of a cell of volume V: the gradients of its barycentric coordinates 1, 2,
 * 3 and, times V/20, Lamé's constants and, times V/420, the density. */
typedef struct afe_tetra {
    int64_t n_groups;
    const int32_t *nodes; /* [groups][10][AFE_LANES] in dolfinx's order */
    const void *data;     /* [groups][AFE_TETRA_DATA][AFE_LANES] in the precision of the product */
} afe_tetra;

#define AFE_CONSTANTS 3
#define AFE_POINT_DATA 5

/* Curved ones by quadrature, in the same groups; where the last group is not full it repeats a cell
 * without constants. A point has its barycentric coordinates and its weight. */
typedef struct afe_curved {
    int64_t n_groups;
    const int32_t *nodes;       /* as above */
    const void *constants;      /* [groups][AFE_CONSTANTS][AFE_LANES] Lamé's and the density */
    const void *x;              /* [nodes][3] positions, and AFE_BEYOND numbers more */
    int64_t n_points, n_masses; /* of K and of M */
    const void *points, *mass_points; /* [n][AFE_POINT_DATA] */
    const void *values;         /* [n_masses][10] of the shape functions */
} afe_curved;

/* out += (k K + m M) u, both [nodes][3] and AFE_BEYOND numbers more, which stay */
#define AFE_BEYOND 5
AFE_API void afe_tetra_product_double(const afe_tetra *of, double k, double m, const double *u,
                                      double *out);
AFE_API void afe_tetra_product_float(const afe_tetra *of, float k, float m, const float *u, float *out);
/* the same for a u that is linear in each cell, of which its corners alone are read */
AFE_API void afe_tetra_of_linear_double(const afe_tetra *of, double k, double m, const double *u,
                                        double *out);
AFE_API void afe_tetra_of_linear_float(const afe_tetra *of, float k, float m, const float *u, float *out);
AFE_API void afe_linear_product_double(const afe_tetra *of, double k, double m, const double *u,
                                       double *out); /* nodes: the first four, [groups][4][AFE_LANES] */
AFE_API void afe_linear_product_float(const afe_tetra *of, float k, float m, const float *u, float *out);
AFE_API void afe_curved_product_double(const afe_curved *of, double k, double m, const double *u,
                                       double *out);
AFE_API void afe_curved_product_float(const afe_curved *of, float k, float m, const float *u, float *out);

/* ---- Smoothing ----------------------------------------------------------------------------------- */

#define AFE_MOST_BLOCK 6

/* A step of Chebyshev's iteration with the inverse D^-1 [n][b][b] of the diagonal blocks:
 * step = keep step + gain D^-1 residual, sum += step. With keep = 0 it is the first: sum = step. */
AFE_API void afe_smooth_double(int64_t n, int64_t b, const double *inverse, const double *residual, double keep,
                               double gain, double *step, double *sum);
AFE_API void afe_smooth_float(int64_t n, int64_t b, const float *inverse, const float *residual, float keep,
                              float gain, float *step, float *sum);

#endif
