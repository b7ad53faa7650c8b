/* Products with K and M of quadratic tetrahedra, four or eight cells at a time.
 *
 * Strains are linear in a straight cell: their values at the corners v give its stresses σ_v, and
 * ∫ σ:δε = V/20 Σ_v (σ_v + Σ_w σ_w):δε_v. With λ_i the barycentric coordinates and u_ij the value in
 * the middle of an edge, grad u at corner v is Σ_i c_vi ⊗ grad λ_i, c_vv = 3 u_v, c_vi = 4 u_vi - u_i.
 * Curved cells are integrated by quadrature: the slopes of u and x along the reference axes are linear
 * in a cell, which their values at the corners give too.
 */
#include "internal.h"

#define CORNERS 4
#define NODES 10

/* nodes between the corners, in dolfinx's order */
static const int BETWEEN[CORNERS][CORNERS] = {{-1, 9, 8, 7}, {9, -1, 6, 5}, {8, 6, -1, 4}, {7, 5, 4, -1}};

/* places of σ_ab among the stresses xx, yy, zz, yz, zx, xy */
static const int PLACE[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};

/* place of the first of `count` numbers of a cell */
#define PLACE_OF(cell, count) ((cell) / AFE_LANES * (count) * AFE_LANES + (cell) % AFE_LANES)

/* numbers of two vectors by their places, those of the second after those of the first */
#if defined(__clang__)
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (picks){__VA_ARGS__})
#endif

/* names of functions and types in each precision */
#define wide NAMED(wide, REAL)
#define quad NAMED(quad, REAL)
#define picks NAMED(picks, REAL)
#define load NAMED(load, REAL)
#define taken NAMED(taken, REAL)
#define gather_node NAMED(gather_node, REAL)
#define scatter_node NAMED(scatter_node, REAL)
#define corner_slopes NAMED(corner_slopes, REAL)
#define node_forces NAMED(node_forces, REAL)
#define slopes NAMED(slopes, REAL)
#define stresses NAMED(stresses, REAL)
#define forces NAMED(forces, REAL)
#define corner_forces NAMED(corner_forces, REAL)
#define inertia NAMED(inertia, REAL)
#define interpolated NAMED(interpolated, REAL)
#define adjugate NAMED(adjugate, REAL)
#define gather_slopes NAMED(gather_slopes, REAL)
#define stiffness_at NAMED(stiffness_at, REAL)
#define inertia_at NAMED(inertia_at, REAL)
#define smooth_blocks NAMED(smooth_blocks, REAL)

/* Vectors of 256 bits: wider ones are taken apart number by number where there is no AVX-512.
 * ALTERNATE: two vectors in turn, their x with their z (BESIDE_X 2) or y; PAIRS: two numbers of each. */
#define REAL double
#define INTEGER int64_t
#define WITHOUT_SIGN INT64_MAX
#define LANES 4
#define BESIDE_X 2
#define ALTERNATE_FIRST 0, 4, 2, 6
#define ALTERNATE_LAST 1, 5, 3, 7
#define PAIRS_FIRST 0, 1, 4, 5
#define PAIRS_LAST 2, 3, 6, 7
#include "elastic_cells.h"
#include "smoothing.h"
#undef REAL
#undef INTEGER
#undef WITHOUT_SIGN
#undef LANES
#undef BESIDE_X
#undef ALTERNATE_FIRST
#undef ALTERNATE_LAST
#undef PAIRS_FIRST
#undef PAIRS_LAST
#define REAL float
#define INTEGER int32_t
#define WITHOUT_SIGN INT32_MAX
#define LANES 8
#define BESIDE_X 1
#define ALTERNATE_FIRST 0, 8, 1, 9, 4, 12, 5, 13
#define ALTERNATE_LAST 2, 10, 3, 11, 6, 14, 7, 15
#define PAIRS_FIRST 0, 1, 8, 9, 4, 5, 12, 13
#define PAIRS_LAST 2, 3, 10, 11, 6, 7, 14, 15
#include "elastic_cells.h"
#include "smoothing.h"
#undef REAL
#undef INTEGER
#undef WITHOUT_SIGN

#undef wide
#undef quad
#undef picks
#undef load
#undef taken
#undef gather_node
#undef scatter_node
#undef corner_slopes
#undef node_forces
#undef slopes
#undef stresses
#undef forces
#undef corner_forces
#undef inertia
#undef interpolated
#undef adjugate
#undef gather_slopes
#undef stiffness_at
#undef inertia_at
#undef smooth_blocks
