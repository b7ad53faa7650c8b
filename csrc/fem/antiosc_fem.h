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

/* out += (k K + m M) u, both [nodes][3] and AFE_BEYOND numbers more, which stay */
#define AFE_BEYOND 5
AFE_API void afe_tetra_product_double(const afe_tetra *of, double k, double m, const double *u,
                                      double *out);
AFE_API void afe_tetra_product_float(const afe_tetra *of, float k, float m, const float *u, float *out);

#endif
