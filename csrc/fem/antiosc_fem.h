/* antiosc_fem.h - loops of finite elements that Python is too slow for: sums and products over the cells
 * of a mesh, and Cholesky factors in low precision.
 *
 * No function keeps anything, allocates anything or fails but afe_supernodes_factor; memory is the
 * caller's. Arrays are row-major. It is C99 with vectors of gcc and clang: compile antiosc_fem.c, which
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

/* The kernel is the action of a bilinear form A on a function u with three components a node, the
 * coefficient of which `coefficients` has the dofs; `memory` holds n_coefficients + 3 n_nodes + n_dofs
 * numbers. Of the cells begin to end - 1: out += factor A u, and the diagonal blocks of the nodes,
 * out [dofs][3]. */
AFE_API void afe_cell_products(const afe_cells *of, int64_t begin, int64_t end, double factor,
                               double *memory, const double *u, double *out);
AFE_API void afe_cell_blocks(const afe_cells *of, int64_t begin, int64_t end, double factor,
                             double *memory, double *out);

/* ---- Cholesky factors --------------------------------------------------------------------------- */

/* A Cholesky factor as CHOLMOD holds it, its values in single precision or in 16 bits. */
typedef struct afe_supernodes {
    int64_t n_supernodes;
    const int64_t *start; /* [n_supernodes + 1] first column of each */
    const int64_t *row;   /* [n_supernodes + 1] its first row among `rows` */
    const int64_t *rows;  /* those of its columns come first */
    const int64_t *value; /* [n_supernodes] its first value */
    const void *values;   /* of each supernode, column by column, over `scale` of their column */
    const float *scale;   /* [columns] */
} afe_supernodes;

/* x = L⁻¹x and x = L⁻ᵀx in the order of L; `own` holds as many numbers as a supernode has rows. */
AFE_API void afe_supernodes_forward_float(const afe_supernodes *L, float *x, float *own);
AFE_API void afe_supernodes_backward_float(const afe_supernodes *L, float *x, float *own);
AFE_API void afe_supernodes_forward_int16_t(const afe_supernodes *L, float *x, float *own);
AFE_API void afe_supernodes_backward_int16_t(const afe_supernodes *L, float *x, float *own);

/* The lower triangle of a matrix column by column, its rows in the order of L. */
typedef struct afe_lower {
    const int64_t *start; /* [columns + 1] */
    const int32_t *rows;
    const float *values;
} afe_lower;

/* Functions of BLAS and LAPACK in single precision, as Fortran has them. */
typedef struct afe_blas {
    void (*potrf)(const char *, const int *, float *, const int *, int *);
    void (*trsm)(const char *, const char *, const char *, const char *, const int *, const int *,
                 const float *, const float *, const int *, float *, const int *);
    void (*syrk)(const char *, const char *, const int *, const int *, const float *, const float *,
                 const int *, const float *, float *, const int *);
    void (*gemm)(const char *, const char *, const int *, const int *, const int *, const float *,
                 const float *, const int *, const float *, const int *, const float *, float *, const int *);
} afe_blas;

/* The values of L in single precision, of which all else is known; 0 where A is not positive definite.
 * `work` holds 2 columns + 3 n_supernodes numbers, `update` the largest product of rows of a supernode
 * with those of them that are columns of one other. */
AFE_API int afe_supernodes_factor(const afe_supernodes *L, const afe_lower *A, const afe_blas *blas,
                                  int64_t *work, float *update);

/* The values of L become 16 bits in place of single precision; `scale` is that of each column. */
AFE_API void afe_supernodes_to_16_bits(const afe_supernodes *L, float *scale);

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
