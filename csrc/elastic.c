/* Products with K and M of quadratic tetrahedra, eight cells at a time.
 *
 * Strains are linear in a straight cell: their values at the corners v give its stresses σ_v, and
 * ∫ σ:δε = V/20 Σ_v (σ_v + Σ_w σ_w):δε_v. With λ_i the barycentric coordinates and u_ij the value in
 * the middle of an edge, grad u at corner v is Σ_i c_vi ⊗ grad λ_i, c_vv = 3 u_v, c_vi = 4 u_vi - u_i.
 */
#include "internal.h"

#define CORNERS 4
#define NODES 10

/* nodes between the corners, in dolfinx's order */
static const int BETWEEN[CORNERS][CORNERS] = {{-1, 9, 8, 7}, {9, -1, 6, 5}, {8, 6, -1, 4}, {7, 5, 4, -1}};

/* names of functions and types in each precision */
#define JOINED(name, real) name##_##real
#define NAMED(name, real) JOINED(name, real)
#define wide NAMED(wide, REAL)
#define slopes NAMED(slopes, REAL)
#define forces NAMED(forces, REAL)
#define stiffness NAMED(stiffness, REAL)
#define inertia NAMED(inertia, REAL)

#define REAL double
#include "elastic_cells.h"
#undef REAL
#define REAL float
#include "elastic_cells.h"
#undef REAL

#undef wide
#undef slopes
#undef forces
#undef stiffness
#undef inertia
