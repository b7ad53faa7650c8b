/* antiosc_fem.h - loops of finite elements that Python is too slow for: sums and products over the cells
 * of a mesh.
 *
 * No function keeps anything, allocates anything or fails; memory is the caller's. Arrays are row-major. It is C99 with vectors of gcc and clang: compile antiosc_fem.c, which
 * includes the other files. */
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

/* ---- Cells of a mesh ------------------------------------------------------------------------- */

/* `tabulate_tensor` of UFCx 0.5 and later; before 0.10 it takes no `custom`. */
typedef void (*afe_kernel)(double *out, const double *w, const double *c, const double *x,
                           const int *entity, const uint8_t *permutation, void *custom);

/* A form, and the vectors that one of its coefficients is in turn. */
typedef struct afe_cells {
    afe_kernel kernel;
    int n_nodes, n_coefficients; /* of a cell */
    int first, n_dofs;           /* place of that coefficient among those of the cell; its size */
    int n_vectors;
    const int32_t *nodes;        /* [cells][n_nodes] */
    const double *points;        /* [nodes][3] */
    const double *coefficients;  /* [cells][n_coefficients], numbers of dofs in place of the vectors */
    const double *constants;
    const double *vectors;       /* [dofs][n_vectors], for afe_cell_sums */
    const double *weights;       /* [n_vectors] */
} afe_cells;

/* Of the cells begin to end - 1 the weighted sums over the vectors, into out [cells]; `memory` holds
 * n_coefficients + 3 n_nodes + n_vectors n_dofs numbers. */
AFE_API void afe_cell_sums(const afe_cells *of, int64_t begin, int64_t end, double *memory,
                           double *out);

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
