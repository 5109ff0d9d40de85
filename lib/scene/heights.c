// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Heights of a surface with a certified bound; see heights.h. All in mm, in the frame of the grid.
 *
 * Notation: f is the surface's height, with gradient ∇f and normal n; g the grid's; γ the grid's
 * slope, and ñ the normal of it, which the search uses. All are functions of a place seen from above.
 *
 *   ε   |f - g|                     κ   of ñ's horizontal part: change per mm
 *   δ   |n - ñ|, at the same place  κ₃  of all of ñ
 *   μ   |∇g - γ|                    σ   length of ñ's horizontal part, at most
 *
 * The search ends at x with tool + d ñ(x) + t = (x, g(x)), where t, along the surface there, is what
 * was left of the last step, ρ seen from above. A step r changes the next one by
 *
 *   |r'| ≤ r [d κ + σ (μ + 3/2 w κ₃ r + d κ₃² r/2)],   w = √(1 + |γ|²)
 *
 * With q the surface's nearest point, at y, and D its depth, tool + D n = q. The place
 * (y, g(y)) - D ñ(y) is at most η = ε + D δ + |t| from the tool's (x, g(x)) - d ñ(x). For d κ < 1 such
 * places are different ones for different (x, d): layers at all depths lie one below the other, no
 * nearer than their difference of depth, and as steep as the grid. So there is a first bound of
 * e = |D - d| and s = |x - y|, and from that a better one, as the way from one point to the other is
 * at right angles to n all along:
 *
 *   s ≤ (d δ + σ e + ρ) / (1 - d κ)
 *   e ≤ (ε + w s (3/2 δ + κ₃ s/2) + |t| Θ/2) / (1 - Θ²/4),   Θ = |n(q) - ñ(x)| ≤ δ + κ₃ s
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "../fixed/vector.h"
#include "../surface/surface.h"
#include "heights.h"

#define ONE 65536.0
#define UNIT 1073741824.0
#define LSB (1 / ONE)

/* Rounding of a step, of depth and point, and of the frame's axes along 4 m. */
#define ROUNDING_MM (6 * LSB)

/* The steepest cell, less rounding. */
#define SLOPE_MOST (INCISE_FIXED_GRID_SLOPE_MAX - 0.02)

#define SHIFT_MIN 8
#define SHIFT_MAX 18
#define PLANE_MM 500 /* to either side */
#define HEIGHT_MOST_MM 4000
#define LOOKS 8 /* along a side of a cell that is smooth */
#define CORNERS_MAX 12

/* sin 45° / √2: a square has that slope at its corners. */
#define UPPER 0.5

/* For areas and places: far above the rounding of doubles. */
#define NEARLY 1e-6

struct shares {
	double epsilon, delta, mu, kappa, kappa3, sigma, w, slope;
};

struct heights {
	const struct incise_surface *surface;
	struct incise_error *err;
	double leave_mm, reach_mm, wanted_mm;
	double axis[3][3];
	double low[3], high[3]; /* seen along the axes from the world's origin */
	double (*vertex)[3];	/* of a mesh, along the axes */
	/* With cells of one size: */
	struct incise_fixed_grid_frame frame;
	double cell, from[3]; /* the frame's origin, along the axes */
	int32_t *height;
	double (*slope)[2]; /* γ of knots */
	double *area;	    /* of cells that is covered, in cells */
	uint8_t *border;
	struct shares shares;
	int rc;
};

/* --- frame and region ------------------------------------------------------------------- */

static void set_axis(struct heights *h, int k, const double unit[3])
{
	int64_t wide[3];

	for (int i = 0; i < 3; i++)
		wide[i] = llrint(unit[i] * UNIT);
	incise_fx_unit(h->frame.axis[k], wide, 3, 0);
	for (int i = 0; i < 3; i++)
		h->axis[k][i] = h->frame.axis[k][i] / UNIT;
}

/* u: as far as it can along @along, or any. */
static void set_axes(struct heights *h, const double up[3], const double along[3])
{
	const double tries[3][3] = {{along[0], along[1], along[2]}, {1, 0, 0}, {0, 1, 0}};
	double u[3] = {0}, v[3];

	for (int i = 0; i < 3; i++) {
		v3_add(u, tries[i], -v3_dot(tries[i], up), up);
		if (v3_unit(u, u, 1e-3 * v3_length(tries[i]) + 1e-9))
			break;
	}
	v3_cross(v, up, u);
	set_axis(h, 0, u);
	set_axis(h, 1, v);
	set_axis(h, 2, up);
}

static void along_axes(const struct heights *h, const double p[3], double to[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = v3_dot(p, h->axis[i]);
}

static void to_world(const struct heights *h, const double p[3], double to[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = p[0] * h->axis[0][i] + p[1] * h->axis[1][i] +
			p[2] * h->axis[2][i];
}

static void extend(struct heights *h, const double p[3], double by)
{
	for (int i = 0; i < 3; i++) {
		h->low[i] = fmin(h->low[i], p[i] - by);
		h->high[i] = fmax(h->high[i], p[i] + by);
	}
}

/* @p along the axes. */
static int overhang(struct heights *h, const double p[3])
{
	double at[3];

	to_world(h, p, at);
	return incise_error_set(
		h->err, ERANGE,
		"the surface has an overhang, or is steeper than 76°, at (%.1f, %.1f, "
		"%.1f) mm: a plan in the kernel needs one height at each point; remove "
		"--in-kernel",
		at[0], at[1], at[2]);
}

/* Twice the area, seen from above; > 0 where the face looks up. */
static double gradient(const struct heights *h, uint32_t face, double slope[2])
{
	const uint32_t *c = h->surface->mesh->corner[face];
	double n[3];

	triangle_area_normal(n, h->vertex[c[0]], h->vertex[c[1]], h->vertex[c[2]]);
	for (int i = 0; i < 2; i++)
		slope[i] = -n[i] / n[2];
	return n[2];
}

static int begin_mesh(struct heights *h)
{
	const struct mesh *mesh = h->surface->mesh;
	double slope[2], middle[3];

	h->vertex = calloc(mesh->n_vertices, sizeof(*h->vertex));
	if (!h->vertex)
		return incise_error_set(h->err, ENOMEM, "no memory for heights");
	for (uint32_t i = 0; i < mesh->n_vertices; i++) {
		along_axes(h, mesh->vertex[i], h->vertex[i]);
		extend(h, h->vertex[i], 0);
	}
	for (uint32_t face = 0; face < mesh->n_triangles; face++) {
		const uint32_t *c = mesh->corner[face];

		if (gradient(h, face, slope) > 0 && fabs(slope[0]) <= SLOPE_MOST &&
		    fabs(slope[1]) <= SLOPE_MOST)
			continue;
		for (int i = 0; i < 3; i++)
			middle[i] = (h->vertex[c[0]][i] + h->vertex[c[1]][i] +
				     h->vertex[c[2]][i]) /
				    3;
		return overhang(h, middle);
	}
	return 0;
}

static int begin_heights(struct heights *h, const double up[3])
{
	const struct incise_surface *surface = h->surface;
	const struct capsule *capsule = &surface->capsule;
	double axis[3] = {1, 0, 0}, p[3];
	int rc = 0;

	for (int i = 0; i < 3; i++) {
		h->low[i] = DBL_MAX;
		h->high[i] = -DBL_MAX;
	}
	if (!surface->mesh && surface->kind != INCISE_SURFACE_PLANE)
		v3_sub(axis, capsule->b, capsule->a);
	set_axes(h, up, axis);
	if (surface->mesh) {
		rc = begin_mesh(h);
	} else if (surface->kind == INCISE_SURFACE_PLANE) {
		along_axes(h, surface->plane.point, p);
		extend(h, p, PLANE_MM);
	} else {
		along_axes(h, capsule->a, p);
		extend(h, p, UPPER * capsule->radius);
		along_axes(h, capsule->b, p);
		extend(h, p, UPPER * capsule->radius);
	}
	for (int i = 0; i < 3 && !rc; i++)
		if (h->high[i] - h->low[i] > 2 * HEIGHT_MOST_MM ||
		    fmax(fabs(h->low[i]), fabs(h->high[i])) > HEIGHT_MOST_MM)
			rc = incise_error_set(
				h->err, ERANGE,
				"the surface extends from %.0f to %.0f mm: heights are "
				"limited to %d mm; remove --in-kernel",
				h->low[i], h->high[i], HEIGHT_MOST_MM);
	return rc;
}

/* --- cells of a mesh -------------------------------------------------------------------- */

struct polygon {
	int n;
	double at[CORNERS_MAX][2];
};

/* The part of a convex polygon where sign × at[axis] ≤ sign × bound. */
static void cut_heights_polygon(const struct polygon *from, struct polygon *to, int axis,
				double sign, double bound)
{
	to->n = 0;
	for (int i = 0; i < from->n; i++) {
		const double *a = from->at[i], *b = from->at[(i + 1) % from->n];
		double below = sign * (bound - a[axis]), next = sign * (bound - b[axis]);

		if (below >= 0 && to->n < CORNERS_MAX)
			memcpy(to->at[to->n++], a, sizeof(to->at[0]));
		if ((below > 0 && next < 0) || (below < 0 && next > 0)) {
			double share = below / (below - next);

			if (to->n >= CORNERS_MAX)
				continue;
			to->at[to->n][axis] = bound;
			to->at[to->n][!axis] = a[!axis] + share * (b[!axis] - a[!axis]);
			to->n++;
		}
	}
}

static void band(const struct polygon *from, struct polygon *to, int axis, double least,
		 double most)
{
	struct polygon half;

	cut_heights_polygon(from, &half, axis, -1, least);
	cut_heights_polygon(&half, to, axis, 1, most);
}

/* The cells that a polygon touches along an axis. */
static void cells_of(const struct heights *h, const struct polygon *p, int axis,
		     int *first, int *last)
{
	int cells = (axis ? h->frame.rows : h->frame.columns) - 1;
	double least = DBL_MAX, most = -DBL_MAX;

	for (int i = 0; i < p->n; i++) {
		least = fmin(least, p->at[i][axis]);
		most = fmax(most, p->at[i][axis]);
	}
	*first = (int)fmin(fmax(floor(least / h->cell - NEARLY), 0), cells);
	*last = (int)fmax(fmin(floor(most / h->cell + NEARLY), cells - 1), -1);
	if (!p->n)
		*last = *first - 1;
}

typedef void cell_fn(struct heights *h, uint32_t face, int i, int j,
		     const struct polygon *p);

/* For each cell the part of the polygon in it; @inset of its sides, in cells. */
static void each_cell(struct heights *h, uint32_t face, const struct polygon *whole,
		      double inset, cell_fn *fn)
{
	int first_row, last_row, first, last;

	cells_of(h, whole, 1, &first_row, &last_row);
	for (int j = first_row; j <= last_row; j++) {
		struct polygon row, part;

		band(whole, &row, 1, (j + inset) * h->cell, (j + 1 - inset) * h->cell);
		cells_of(h, &row, 0, &first, &last);
		for (int i = first; i <= last; i++) {
			band(&row, &part, 0, (i + inset) * h->cell,
			     (i + 1 - inset) * h->cell);
			if (part.n)
				fn(h, face, i, j, &part);
		}
	}
}

static size_t cell_of(const struct heights *h, int i, int j)
{
	return (size_t)j * (size_t)(h->frame.columns - 1) + (size_t)i;
}

static size_t knot_of(const struct heights *h, int i, int j)
{
	return (size_t)j * (size_t)h->frame.columns + (size_t)i;
}

static double height_on(const struct heights *h, uint32_t face, const double at[2])
{
	const double *a = h->vertex[h->surface->mesh->corner[face][0]];
	double slope[2];

	gradient(h, face, slope);
	return a[2] - h->from[2] + slope[0] * (at[0] + h->from[0] - a[0]) +
	       slope[1] * (at[1] + h->from[1] - a[1]);
}

static void outline(const struct heights *h, uint32_t face, struct polygon *p)
{
	const uint32_t *c = h->surface->mesh->corner[face];

	p->n = 3;
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 2; k++)
			p->at[i][k] = h->vertex[c[i]][k] - h->from[k];
}

/* Area and knots: a corner of the cell that is also a corner of the polygon. */
static void cover(struct heights *h, uint32_t face, int i, int j, const struct polygon *p)
{
	double area = 0;

	for (int k = 0; k < p->n; k++) {
		const double *a = p->at[k], *b = p->at[(k + 1) % p->n];
		long u = lrint(a[0] / h->cell), v = lrint(a[1] / h->cell);
		const double knot[2] = {(double)u * h->cell, (double)v * h->cell};

		area += (a[0] - p->at[0][0]) * (b[1] - p->at[0][1]) -
			(b[0] - p->at[0][0]) * (a[1] - p->at[0][1]);
		if (fabs(a[0] - knot[0]) < 1e-9 && fabs(a[1] - knot[1]) < 1e-9)
			h->height[knot_of(h, (int)u, (int)v)] =
				(int32_t)lrint(height_on(h, face, knot) * ONE);
	}
	h->area[cell_of(h, i, j)] += area / 2 / (h->cell * h->cell);
}

static void mark(struct heights *h, uint32_t face, int i, int j, const struct polygon *p)
{
	(void)face;
	(void)p;
	h->border[cell_of(h, i, j)] = 1;
}

static bool is_covered(const struct heights *h, int i, int j)
{
	return i >= 0 && j >= 0 && i < h->frame.columns - 1 && j < h->frame.rows - 1 &&
	       !h->border[cell_of(h, i, j)] &&
	       fabs(h->area[cell_of(h, i, j)] - 1) < NEARLY;
}

static bool has_height(const struct heights *h, int i, int j)
{
	return i >= 0 && j >= 0 && i < h->frame.columns && j < h->frame.rows &&
	       h->height[knot_of(h, i, j)] != INCISE_FIXED_GRID_NONE;
}

static bool is_cell(const struct heights *h, int i, int j)
{
	return has_height(h, i, j) && has_height(h, i + 1, j) &&
	       has_height(h, i, j + 1) && has_height(h, i + 1, j + 1);
}

/* All slopes of its knots are over two cells. Others are too near to the border: see heights.h. */
static bool is_inner(const struct heights *h, int i, int j)
{
	return is_cell(h, i, j) && has_height(h, i - 1, j) &&
	       has_height(h, i - 1, j + 1) && has_height(h, i + 2, j) &&
	       has_height(h, i + 2, j + 1) && has_height(h, i, j - 1) &&
	       has_height(h, i + 1, j - 1) && has_height(h, i, j + 2) &&
	       has_height(h, i + 1, j + 2);
}

/* Only cells that the mesh covers in full have heights at all their knots. */
static int leave_heights_out(struct heights *h)
{
	for (int j = 0; j < h->frame.rows; j++)
		for (int i = 0; i < h->frame.columns; i++)
			if (!is_covered(h, i, j) && !is_covered(h, i - 1, j) &&
			    !is_covered(h, i, j - 1) && !is_covered(h, i - 1, j - 1))
				h->height[knot_of(h, i, j)] = INCISE_FIXED_GRID_NONE;
	for (int j = 0; j < h->frame.rows - 1; j++)
		for (int i = 0; i < h->frame.columns - 1; i++) {
			double at[3] = {h->from[0] + (i + 0.5) * h->cell,
					h->from[1] + (j + 0.5) * h->cell, h->from[2]};

			/* Between borders the number of layers is the same all over a cell. */
			if (h->area[cell_of(h, i, j)] > 1 + NEARLY)
				return overhang(h, at);
			if (is_cell(h, i, j) && !is_covered(h, i, j))
				h->height[knot_of(h, i, j)] = INCISE_FIXED_GRID_NONE;
		}
	return 0;
}

static int fill_mesh(struct heights *h)
{
	const struct mesh *mesh = h->surface->mesh;
	struct polygon whole;

	for (uint32_t face = 0; face < mesh->n_triangles; face++) {
		outline(h, face, &whole);
		each_cell(h, face, &whole, 0, cover);
		for (int i = 0; i < 3; i++) {
			struct polygon edge = {.n = 2};

			if (mesh->neighbour[face][i] != MESH_NONE)
				continue;
			memcpy(edge.at[0], whole.at[i], sizeof(edge.at[0]));
			memcpy(edge.at[1], whole.at[(i + 1) % 3], sizeof(edge.at[0]));
			/* A border on the side of a cell takes nothing away from it. */
			each_cell(h, face, &edge, NEARLY, mark);
		}
	}
	return leave_heights_out(h);
}

/* --- plane and capsule ------------------------------------------------------------------ */

/* Height and slope of a smooth surface. */
static bool look_heights(const struct heights *h, const double at[2], double *height,
			 double slope[2])
{
	double far = h->high[2] - h->low[2] + 4 * PLANE_MM;
	double p[3] = {h->from[0] + at[0], h->from[1] + at[1], h->high[2] + far};
	double from[3], to[3], n[3], point[3];
	struct incise_touch touch;

	to_world(h, p, from);
	p[2] = h->low[2] - far;
	to_world(h, p, to);
	if (!incise_surface_enters(h->surface, from, to, &touch))
		return false;
	along_axes(h, touch.point_mm, point);
	along_axes(h, touch.normal, n);
	*height = point[2] - h->from[2];
	for (int i = 0; i < 2; i++)
		slope[i] = -n[i] / n[2];
	return n[2] > 0 && fabs(slope[0]) <= SLOPE_MOST && fabs(slope[1]) <= SLOPE_MOST;
}

static int fill_smooth(struct heights *h)
{
	for (int j = 0; j < h->frame.rows; j++)
		for (int i = 0; i < h->frame.columns; i++) {
			double at[3] = {i * h->cell, j * h->cell, 0}, height, slope[2];

			if (!look_heights(h, at, &height, slope)) {
				v3_add(at, at, 1, h->from);
				return overhang(h, at);
			}
			h->height[knot_of(h, i, j)] = (int32_t)lrint(height * ONE);
		}
	memset(h->border, 0,
	       (size_t)(h->frame.columns - 1) * (size_t)(h->frame.rows - 1));
	for (int j = 0; j < h->frame.rows - 1; j++)
		for (int i = 0; i < h->frame.columns - 1; i++)
			h->area[cell_of(h, i, j)] = 1;
	return 0;
}

/* --- shares of the error ---------------------------------------------------------------- */

/* One cell: heights of its knots in mm, and their slopes. */
struct cell {
	double z[2][2], slope[2][2][2]; /* by v, then u */
};

static struct cell cell_at(const struct heights *h, int i, int j)
{
	struct cell c;

	for (int b = 0; b < 2; b++)
		for (int a = 0; a < 2; a++) {
			size_t k = knot_of(h, i + a, j + b);

			c.z[b][a] = h->height[k] / ONE;
			memcpy(c.slope[b][a], h->slope[k], sizeof(c.slope[b][a]));
		}
	return c;
}

static double bilinear(double z00, double z10, double z01, double z11, double u, double v)
{
	return (z00 * (1 - u) + z10 * u) * (1 - v) + (z01 * (1 - u) + z11 * u) * v;
}

static double height_in(const struct cell *c, double u, double v)
{
	return bilinear(c->z[0][0], c->z[0][1], c->z[1][0], c->z[1][1], u, v);
}

static void slope_in(const struct cell *c, double u, double v, double slope[2])
{
	for (int k = 0; k < 2; k++)
		slope[k] = bilinear(c->slope[0][0][k], c->slope[0][1][k],
				    c->slope[1][0][k], c->slope[1][1][k], u, v);
}

/* Part of a bilinear function that is not linear. */
static double twist(double z00, double z10, double z01, double z11)
{
	return fabs(z11 - z10 - z01 + z00);
}

static double slope_twist(const struct cell *c)
{
	double twists[2];

	for (int k = 0; k < 2; k++)
		twists[k] = twist(c->slope[0][0][k], c->slope[0][1][k], c->slope[1][0][k],
				  c->slope[1][1][k]);
	return hypot(twists[0], twists[1]);
}

static void normal_of(const double slope[2], double n[3])
{
	double w = sqrt(1 + slope[0] * slope[0] + slope[1] * slope[1]);

	n[0] = -slope[0] / w;
	n[1] = -slope[1] / w;
	n[2] = 1 / w;
}

static double between_heights(const double a[2], const double b[2])
{
	double n[3], m[3];

	normal_of(a, n);
	normal_of(b, m);
	return sqrt(v3_distance2(n, m));
}

static void most(double *share, double value)
{
	*share = fmax(*share, value);
}

static double norm2(double a, double b, double c, double d)
{
	/* The larger singular value of (a b; c d). */
	double sum = a * a + b * b + c * c + d * d, det = a * d - b * c;

	return sqrt((sum + sqrt(fmax(sum * sum - 4 * det * det, 0))) / 2);
}

/* The derivative of a normal's part by the slope: so long across the slope, and so along it. */
static void derivative(const double slope[2], double across, double along, double d[2][2])
{
	double size2 = slope[0] * slope[0] + slope[1] * slope[1];

	for (int r = 0; r < 2; r++)
		for (int k = 0; k < 2; k++)
			d[r][k] = (r == k) * across +
				  (size2 > 0 ? (along - across) * slope[r] * slope[k] /
						       size2
					     : 0);
}

static double product_norm(double a[2][2], double b[2][2])
{
	return norm2(a[0][0] * b[0][0] + a[0][1] * b[1][0],
		     a[0][0] * b[0][1] + a[0][1] * b[1][1],
		     a[1][0] * b[0][0] + a[1][1] * b[1][0],
		     a[1][0] * b[0][1] + a[1][1] * b[1][1]);
}

/*
 * κ and κ₃ of a cell. ñ's horizontal part is -γ/w: it changes with γ by 1/w across the slope and by
 * 1/w³ along it, all of ñ by 1/w and 1/w². These change by at most 2 for each unit of γ.
 * γ changes with the place by Γ, of which each column is on a line between two.
 */
static void add_curvature(struct heights *h, const struct cell *c)
{
	double middle[2], w, flat[2][2], all[2][2], off = 0, kappa = 0, kappa3 = 0,
						    largest = 0;

	slope_in(c, 0.5, 0.5, middle);
	w = sqrt(1 + middle[0] * middle[0] + middle[1] * middle[1]);
	derivative(middle, 1 / w, 1 / (w * w * w), flat);
	derivative(middle, 1 / w, 1 / (w * w), all);
	for (int k = 0; k < 4; k++) {
		const double *corner = c->slope[k >> 1][k & 1];

		off = fmax(off, hypot(corner[0] - middle[0], corner[1] - middle[1]));
	}
	for (int k = 0; k < 4; k++) {
		double d[2][2]; /* Γ, by component and direction */

		for (int r = 0; r < 2; r++) {
			d[r][0] =
				(c->slope[k & 1][1][r] - c->slope[k & 1][0][r]) / h->cell;
			d[r][1] = (c->slope[1][k >> 1][r] - c->slope[0][k >> 1][r]) /
				  h->cell;
		}
		largest = fmax(largest, norm2(d[0][0], d[0][1], d[1][0], d[1][1]));
		kappa = fmax(kappa, product_norm(flat, d));
		kappa3 = fmax(kappa3, product_norm(all, d));
	}
	most(&h->shares.kappa, kappa + 2 * off * largest);
	most(&h->shares.kappa3, kappa3 + 2 * off * largest);
}

/* μ, σ and w: the differences are bilinear too, and their largest is at a corner. */
static void add_slopes(struct heights *h, const struct cell *c)
{
	for (int k = 0; k < 4; k++) {
		int a = k & 1, b = k >> 1;
		const double g[2] = {(c->z[b][1] - c->z[b][0]) / h->cell,
				     (c->z[1][a] - c->z[0][a]) / h->cell};
		const double *slope = c->slope[b][a];
		double size = hypot(slope[0], slope[1]);

		most(&h->shares.mu, hypot(g[0] - slope[0], g[1] - slope[1]));
		most(&h->shares.sigma, size / sqrt(1 + size * size));
		most(&h->shares.slope, fmax(size, hypot(g[0], g[1])));
	}
}

/*
 * ε and δ of a face in a cell. A bilinear function is a linear one and up to a quarter of its twist in
 * the polygon's box, so that within it is beyond what it is at the corners by twice that at most.
 * Angles from one normal are convex.
 */
static void add_face(struct heights *h, uint32_t face, int i, int j,
		     const struct polygon *p)
{
	double slope[2], low[2] = {1, 1}, high[2] = {0, 0}, bulge, epsilon = 0, delta = 0;
	struct cell c;

	if (!is_inner(h, i, j))
		return;
	c = cell_at(h, i, j);
	gradient(h, face, slope);
	for (int k = 0; k < p->n; k++) {
		double at[2] = {p->at[k][0] / h->cell - i, p->at[k][1] / h->cell - j},
		       own[2];

		slope_in(&c, at[0], at[1], own);
		delta = fmax(delta, between_heights(own, slope));
		epsilon = fmax(epsilon, fabs(height_on(h, face, p->at[k]) -
					     height_in(&c, at[0], at[1])));
		for (int axis = 0; axis < 2; axis++) {
			low[axis] = fmin(low[axis], at[axis]);
			high[axis] = fmax(high[axis], at[axis]);
		}
	}
	bulge = (high[0] - low[0]) * (high[1] - low[1]) / 2;
	most(&h->shares.epsilon,
	     epsilon + bulge * twist(c.z[0][0], c.z[0][1], c.z[1][0], c.z[1][1]));
	most(&h->shares.delta, delta + bulge * slope_twist(&c));
	most(&h->shares.slope, hypot(slope[0], slope[1]));
}

/* The same of a smooth surface: looked at in places, and between them its curvature. */
static int add_smooth(struct heights *h, int i, int j)
{
	const struct incise_surface *surface = h->surface;
	double curvature = 0, step = h->cell / LOOKS, aside = step / sqrt(2), height;
	double epsilon = 0, delta = 0, steepest = 0, apart = 0, bend, turn;
	struct cell c = cell_at(h, i, j);

	if (surface->kind != INCISE_SURFACE_PLANE)
		curvature = 1 / surface->capsule.radius;
	for (int k = 0; k < (LOOKS + 1) * (LOOKS + 1); k++) {
		double u = (double)(k % (LOOKS + 1)) / LOOKS;
		double v = (double)(k / (LOOKS + 1)) / LOOKS;
		double at[3] = {(i + u) * h->cell, (j + v) * h->cell, 0};
		double slope[2], own[2];

		if (!look_heights(h, at, &height, slope)) {
			v3_add(at, at, 1, h->from);
			return overhang(h, at);
		}
		slope_in(&c, u, v, own);
		delta = fmax(delta, between_heights(own, slope));
		epsilon = fmax(epsilon, fabs(height - height_in(&c, u, v)));
		steepest = fmax(steepest, hypot(slope[0], slope[1]));
		apart = fmax(apart, hypot(own[0] - slope[0], own[1] - slope[1]));
	}
	/* The slope's change per mm, (1 + slope²)^3/2 / R; below twice that until the next look. */
	bend = 2 * pow(1 + steepest * steepest, 1.5) * curvature;
	steepest += bend * aside;
	if (pow(1 + steepest * steepest, 1.5) * curvature > bend)
		return overhang(h,
				(const double[3]){i * h->cell + h->from[0],
						  j * h->cell + h->from[1], h->from[2]});
	bend = pow(1 + steepest * steepest, 1.5) * curvature;
	turn = sqrt(1 + steepest * steepest) * curvature + h->shares.kappa3;
	most(&h->shares.delta, delta + aside * turn);
	most(&h->shares.epsilon,
	     epsilon + aside * (apart + h->shares.mu +
				aside * (bend + twist(c.z[0][0], c.z[0][1], c.z[1][0],
						      c.z[1][1]) /
							(h->cell * h->cell))));
	most(&h->shares.slope, steepest);
	return 0;
}

/* γ: over two cells, as far as there are two. */
static void set_slopes(struct heights *h)
{
	for (int j = 0; j < h->frame.rows; j++)
		for (int i = 0; i < h->frame.columns; i++)
			for (int k = 0; k < 2; k++) {
				int back_i = i - !k, back_j = j - k, on_i = i + !k,
				    on_j = j + k;
				double *slope = &h->slope[knot_of(h, i, j)][k];

				if (!has_height(h, back_i, back_j)) {
					back_i = i;
					back_j = j;
				}
				if (!has_height(h, on_i, on_j)) {
					on_i = i;
					on_j = j;
				}
				*slope = 0;
				if (back_i != on_i || back_j != on_j)
					*slope =
						(h->height[knot_of(h, on_i, on_j)] / ONE -
						 h->height[knot_of(h, back_i, back_j)] /
							 ONE) /
						(h->cell *
						 (on_i - back_i + on_j - back_j));
			}
}

static int add_shares(struct heights *h)
{
	const struct mesh *mesh = h->surface->mesh;
	struct polygon whole;
	bool any = false;

	set_slopes(h);
	h->shares = (struct shares){0};
	for (int j = 0; j < h->frame.rows - 1; j++)
		for (int i = 0; i < h->frame.columns - 1; i++) {
			struct cell c;

			if (!is_inner(h, i, j))
				continue;
			c = cell_at(h, i, j);
			add_curvature(h, &c);
			add_slopes(h, &c);
			any = true;
		}
	if (!any)
		h->shares.epsilon = HUGE_VAL;
	for (uint32_t face = 0; mesh && face < mesh->n_triangles; face++) {
		outline(h, face, &whole);
		each_cell(h, face, &whole, 0, add_face);
	}
	for (int j = 0; !mesh && j < h->frame.rows - 1; j++)
		for (int i = 0; i < h->frame.columns - 1; i++) {
			int rc = is_inner(h, i, j) ? add_smooth(h, i, j) : 0;

			if (rc)
				return rc;
		}
	h->shares.w = sqrt(1 + h->shares.slope * h->shares.slope);
	return 0;
}

/* --- the bound -------------------------------------------------------------------------- */

struct bounds {
	double depth_mm, point_mm, normal_rad;
};

/* ρ: the rest of the search's last step; HUGE_VAL where steps need not become smaller. */
static double last_step(const struct shares *s, double reach)
{
	double r = reach * s->sigma;

	for (int k = 0; k < INCISE_FIXED_GRID_STEPS; k++) {
		double part = reach * s->kappa +
			      s->sigma * (s->mu + 1.5 * s->w * s->kappa3 * r +
					  reach * s->kappa3 * s->kappa3 * r / 2);

		if (!(part < 1))
			return HUGE_VAL;
		r = r * part + ROUNDING_MM;
	}
	/* It also ends with a step that is rounding. */
	return fmax(r, ROUNDING_MM);
}

/* Over all places no deeper, and no farther outside, than @reach. */
static struct bounds bound(const struct shares *s, double reach)
{
	struct bounds bounds = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
	/* The search holds its steps to 5/4 of the reach. */
	double rho = last_step(s, reach * 1.25), t = s->w * rho;
	double deepest = reach + t + s->epsilon, rest = 1 - deepest * s->kappa;
	double eta = s->epsilon + deepest * s->delta + t, steep, e, aside, theta;

	if (!(rest > 0) || !(eta < HUGE_VAL))
		return bounds;
	steep = s->slope + s->mu * s->w / rest;
	e = eta * (1 + steep);
	aside = (eta + s->sigma * e) / rest;
	for (int k = 0; k < 100; k++) {
		double share;

		theta = s->delta + s->kappa3 * aside;
		if (!(theta < 1.4))
			return bounds;
		share = s->epsilon +
			s->w * aside * (1.5 * s->delta + s->kappa3 * aside / 2) +
			t * theta / 2;
		e = fmin(e, share / (1 - theta * theta / 4));
		aside = fmin(aside, (reach * s->delta + s->sigma * e + rho) / rest);
	}
	theta = s->delta + s->kappa3 * aside;
	bounds.depth_mm = e + ROUNDING_MM;
	bounds.point_mm = s->epsilon + s->w * aside + ROUNDING_MM;
	/* And the rounding of Q2.30. */
	bounds.normal_rad = 2 * asin(theta / 2) + 1e-7;
	return bounds;
}

/* The largest reach up to @most whose depth is within @wanted; below 0 where not even @least is. */
static double find_reach(const struct shares *s, double least, double reach,
			 double wanted)
{
	double low = least, high = reach;

	if (bound(s, reach).depth_mm <= wanted)
		return reach;
	if (!(bound(s, least).depth_mm <= wanted))
		return -1;
	for (int k = 0; k < 40; k++) {
		double middle = low + (high - low) / 2;

		if (bound(s, middle).depth_mm <= wanted)
			low = middle;
		else
			high = middle;
	}
	return low;
}

/* --- cells of one size, and the best of them -------------------------------------------- */

static void free_cells(struct heights *h)
{
	free(h->height);
	free(h->slope);
	free(h->area);
	free(h->border);
	h->height = NULL;
	h->slope = NULL;
	h->area = NULL;
	h->border = NULL;
}

static int new_cells(struct heights *h)
{
	size_t knots = (size_t)h->frame.columns * (size_t)h->frame.rows;

	free_cells(h);
	h->height = malloc(knots * sizeof(*h->height));
	h->slope = calloc(knots, sizeof(*h->slope));
	h->area = calloc(knots, sizeof(*h->area));
	h->border = calloc(knots, sizeof(*h->border));
	if (!h->height || !h->slope || !h->area || !h->border)
		return incise_error_set(h->err, ENOMEM, "no memory for heights");
	for (size_t k = 0; k < knots; k++)
		h->height[k] = INCISE_FIXED_GRID_NONE;
	return 0;
}

/* As many cells as fit, in the middle. Returns whether a grid may have so many. */
static bool place_cells(struct heights *h, int shift)
{
	double middle[3], origin[3], size[2];

	h->frame.cell_shift = shift;
	h->cell = ldexp(LSB, shift);
	for (int k = 0; k < 2; k++) {
		size[k] = floor((h->high[k] - h->low[k]) / h->cell + NEARLY);
		if (size[k] < 1 || size[k] >= INCISE_FIXED_GRID_KNOTS_MAX)
			return false;
	}
	h->frame.columns = (int32_t)size[0] + 1;
	h->frame.rows = (int32_t)size[1] + 1;
	for (int k = 0; k < 3; k++)
		middle[k] = (h->low[k] + h->high[k]) / 2 -
			    (k < 2 ? size[k] * h->cell / 2 : 0);
	to_world(h, middle, origin);
	for (int i = 0; i < 3; i++) {
		h->frame.origin[i] = (int32_t)lrint(origin[i] * ONE);
		origin[i] = h->frame.origin[i] / ONE;
	}
	along_axes(h, origin, h->from);
	return true;
}

static int fill_heights(struct heights *h)
{
	int rc = new_cells(h);

	if (!rc)
		rc = h->surface->mesh ? fill_mesh(h) : fill_smooth(h);
	return rc ? rc : add_shares(h);
}

static void keep_heights(struct heights *h, struct incise_heights *heights, double reach)
{
	struct bounds bounds = bound(&h->shares, reach);

	free(heights->height);
	h->frame.reach = (int32_t)floor(reach * ONE);
	*heights = (struct incise_heights){
		.frame = h->frame,
		.height = h->height,
		.depth_bound_mm = bounds.depth_mm,
		.point_bound_mm = bounds.point_mm,
		.normal_bound_rad = bounds.normal_rad,
	};
	h->height = NULL;
}

/* From large cells to small ones, until the wanted bound is reached. */
static int choose_heights(struct heights *h, struct incise_heights *heights)
{
	double best = -1, least = fmax(h->leave_mm, fmin(1, h->reach_mm));
	double whole = fmax(h->reach_mm, h->leave_mm);

	for (int shift = SHIFT_MAX; shift >= SHIFT_MIN && best < whole; shift--) {
		double reach;
		int rc;

		if (!place_cells(h, shift))
			continue;
		rc = fill_heights(h);
		if (rc)
			return rc;
		reach = find_reach(&h->shares, least, whole, h->wanted_mm);
		/* Finer cells only make the kinks between triangles sharper from here on. */
		if (reach < best)
			break;
		/* No cell was within it so far: take the nearest. */
		if (reach < 0 && best < 0 &&
		    bound(&h->shares, least).depth_mm < HUGE_VAL &&
		    (!heights->height ||
		     bound(&h->shares, least).depth_mm < heights->depth_bound_mm))
			keep_heights(h, heights, least);
		if (reach > best) {
			best = reach;
			keep_heights(h, heights, reach);
		}
	}
	if (heights->height)
		return 0;
	return incise_error_set(
		h->err, ERANGE,
		"the surface, %.0f × %.0f mm, is too curved for heights; smooth it, or "
		"remove --in-kernel",
		h->high[0] - h->low[0], h->high[1] - h->low[1]);
}

int incise_heights_make(const struct incise_surface *surface, const double up[3],
			double leave_mm, double reach_mm, double wanted_mm,
			struct incise_heights *heights, struct incise_error *err)
{
	struct heights h = {
		.surface = surface,
		.err = err,
		.leave_mm = fmax(leave_mm, 0),
		.reach_mm = fmin(fmax(reach_mm, 0), HEIGHT_MOST_MM),
		.wanted_mm = wanted_mm,
	};
	int rc;

	*heights = (struct incise_heights){0};
	rc = begin_heights(&h, up);
	if (!rc)
		rc = choose_heights(&h, heights);
	if (rc)
		incise_heights_free(heights);
	free_cells(&h);
	free(h.vertex);
	return rc;
}

void incise_heights_free(struct incise_heights *heights)
{
	free(heights->height);
	*heights = (struct incise_heights){0};
}
