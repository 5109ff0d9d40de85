// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Meshes of scalpel and tube; see instrument_shape.h. Each is a skin around rings:
 *
 *      ring 3  ○───○───○      a ring: a point, two directions across, a half-width for each
 *      ring 2  ○───○───○      side, its squareness, its taper to an edge
 *      ring 1  ○───○───○
 *
 * Faces that meet at less than 40° are smooth, others have an edge between them. A mesh may have
 * several such parts.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "instrument_shape.h"

#define AROUND 20
#define RINGS_MAX 32

struct ring {
	double centre[3], across[3], over[3]; /* of the ellipse's two axes */
	double left, right, thick; /* mm along them: -across, +across, ±over */
	double round;		   /* 1 an ellipse … 0 a box */
	double edge;		   /* 1: no thickness at the right end */
	float rgb[3], metal;
	bool starts; /* a part: there are no faces between it and the ring before */
};

static double power(double x, double e)
{
	return copysign(pow(fabs(x), e), x);
}

static void ring_point(const struct ring *ring, int i, double p[3])
{
	double at = 2 * M_PI * i / AROUND, u = power(cos(at), ring->round);
	double across = u < 0 ? u * ring->left : u * ring->right;
	double over = ring->thick * power(sin(at), ring->round) *
		      (1 - ring->edge * (0.5 + 0.5 * u));

	v3_add(p, ring->centre, across, ring->across);
	v3_add(p, p, over, ring->over);
}

/* Normal of the face between rings r, r + 1 and points i, i + 1; its length is its area. */
static void face_normal(double (*points)[AROUND][3], int r, int i, double normal[3])
{
	const double *a = points[r][i], *b = points[r][(i + 1) % AROUND];
	const double *c = points[r + 1][(i + 1) % AROUND], *d = points[r + 1][i];
	double one[3], two[3];

	v3_sub(one, c, a);
	v3_sub(two, d, b);
	v3_cross(normal, one, two);
}

/* The normal at a corner of a face: the sum of those around it that are close to its own. */
static void corner_normal(const struct ring *all, double (*points)[AROUND][3], int rings,
			  int r, int i, int corner, float to[3])
{
	int ring = r + (corner > 1), point = i + (corner == 1 || corner == 2);
	double own[3], own_unit[3] = {0}, sum[3] = {0}, unit[3] = {0, 0, 1};

	face_normal(points, r, i, own);
	v3_unit(own_unit, own, 1e-12);
	for (int k = 0; k < 4; k++) {
		int fr = ring - (k & 1), fi = (point - (k >> 1) + AROUND) % AROUND;
		double other[3], other_unit[3];

		if (fr < 0 || fr >= rings - 1 || all[fr + 1].starts)
			continue;
		face_normal(points, fr, fi, other);
		if (v3_unit(other_unit, other, 1e-12) &&
		    v3_dot(own_unit, other_unit) > 0.766)
			v3_add(sum, sum, 1, other);
	}
	if (!v3_unit(unit, sum, 1e-12))
		v3_unit(unit, own, 1e-12);
	for (int k = 0; k < 3; k++)
		to[k] = (float)unit[k];
}

static void put_instrument_shape(struct instrument_mesh *mesh, const struct ring *ring,
				 const double p[3], const float normal[3])
{
	struct instrument_vertex *v = &mesh->vertices[mesh->n_vertices++];

	for (int k = 0; k < 3; k++) {
		v->position_mm[k] = (float)p[k];
		v->rgb[k] = ring->rgb[k];
	}
	/*
	 * Polished steel is never flat: it is ground hollow, and reflects a band of the room.
	 */
	for (int k = 0; k < 3; k++) {
		double lean = 0.09 * (p[0] + 0.3) * ring->across[k];

		lean += k == 2 ? 0.25 - 0.02 * p[2] : 0;
		v->normal[k] = normal[k] + ring->metal * (float)lean;
	}
	v->metal = ring->metal;
}

static int skin(const struct ring *ring, int rings, struct instrument_mesh *mesh)
{
	static const int order[6] = {0, 1, 2, 0, 2, 3};
	double points[RINGS_MAX][AROUND][3];
	int faces = (rings - 1) * AROUND;

	mesh->n_vertices = mesh->n_indices = 0;
	mesh->vertices = calloc(faces * 4, sizeof(*mesh->vertices));
	mesh->indices = calloc(faces * 6, sizeof(*mesh->indices));
	if (!mesh->vertices || !mesh->indices) {
		instrument_free(mesh);
		return -ENOMEM;
	}
	for (int r = 0; r < rings; r++)
		for (int i = 0; i < AROUND; i++)
			ring_point(&ring[r], i, points[r][i]);
	for (int r = 0; r < rings - 1; r++)
		for (int i = 0; i < AROUND && !ring[r + 1].starts; i++) {
			for (int k = 0; k < 6; k++)
				mesh->indices[mesh->n_indices++] =
					(uint32_t)(mesh->n_vertices + order[k]);
			for (int k = 0; k < 4; k++) {
				int rr = r + (k > 1),
				    ii = (i + (k == 1 || k == 2)) % AROUND;
				float normal[3];

				corner_normal(ring, points, rings, r, i, k, normal);
				put_instrument_shape(mesh, &ring[rr], points[rr][ii],
						     normal);
			}
		}
	return 0;
}

static const float steel[3] = {0.86f, 0.88f, 0.90f};
static const float handle[3] = {0.86f, 0.87f, 0.83f};
static const float plastic[3] = {0.88f, 0.90f, 0.86f};
static const float clear[3] = {0.80f, 0.84f, 0.82f};
static const float blue[3] = {0.34f, 0.60f, 0.80f};
static const float bore[3] = {0.16f, 0.18f, 0.19f};

static void paint(struct ring *ring, const float rgb[3], float metal)
{
	memcpy(ring->rgb, rgb, sizeof(ring->rgb));
	ring->metal = metal;
}

int instrument_scalpel(const struct incise_scene_scalpel *scalpel,
		       struct instrument_mesh *mesh)
{
	/*
	 * A blade with a belly in a handle, mm for a scalpel 120 mm long: height, left
	 * (back), right (edge), half of the thickness, roundness, edge, steel.
	 */
	static const double shape[][7] = {
		{0, 0.02, 0.02, 0.02, 0.5, 1, 1},   {0.7, 0.6, 0.9, 0.12, 0.5, 1, 1},
		{2, 1.1, 2.0, 0.2, 0.5, 1, 1},	    {4, 1.6, 3.0, 0.22, 0.5, 1, 1},
		{7, 2.1, 3.6, 0.22, 0.5, 1, 1},	    {12, 2.6, 3.8, 0.22, 0.5, 1, 1},
		{24, 3.2, 3.4, 0.22, 0.5, 1, 1},    {27, 3.2, 2.6, 0.25, 0.5, 0.6, 1},
		{29, 2.2, 2.2, 0.3, 0.5, 0, 1},	    {33, 2.2, 2.2, 0.3, 0.5, 0, 1},
		{33, 2.4, 2.4, 1.0, 0.5, 0, 0},	    {36, 3.4, 3.4, 1.9, 0.5, 0, 0},
		{42, 4.2, 4.2, 2.3, 0.5, 0, 0},	    {60, 3.8, 3.8, 2.2, 0.5, 0, 0},
		{100, 4.4, 4.4, 2.2, 0.5, 0, 0},    {114, 4.6, 4.6, 2.0, 0.5, 0, 0},
		{118.5, 3.9, 3.9, 1.3, 0.6, 0, 0},  {120, 1.6, 1.6, 0.4, 0.8, 0, 0},
		{120, 0.01, 0.01, 0.01, 0.8, 0, 0},
	};
	enum { RINGS = sizeof(shape) / sizeof(shape[0]) };
	struct ring ring[RINGS] = {0};
	const double handle_mm = scalpel->handle_mm;
	/* The flat end is as wide and thick as the scene says; the table's is 9.2 by 4.4. */
	const double wide = scalpel->handle_width_mm / 9.2;
	const double thick = scalpel->handle_thickness_mm / 4.4;
	/* A longer scalpel has a longer handle; a shorter one is scaled down. */
	double small = fmin(handle_mm / 120, 1), longer = fmax(handle_mm - 120, 0);

	for (int i = 0; i < RINGS; i++) {
		const double *s = shape[i];

		ring[i].centre[2] = s[0] * small + (s[0] > 50 ? longer : 0);
		ring[i].across[0] = ring[i].over[1] = 1;
		ring[i].left = s[1] * (s[0] > 50 ? wide : small);
		ring[i].right = s[2] * (s[0] > 50 ? wide : small);
		ring[i].thick = s[3] * (s[0] > 50 ? thick : small);
		ring[i].round = s[4];
		ring[i].edge = s[5];
		paint(&ring[i], s[6] > 0 ? steel : handle, (float)s[6]);
	}
	return skin(ring, RINGS, mesh);
}

/* The flange: a plate along y that is bent down to the neck, from one end to the other. */
static void flange(struct ring *ring, int rings)
{
	const double half_mm = 30, bend_mm = 60;

	for (int i = 0; i < rings; i++) {
		double y = half_mm * fmax(fmin(2.0 * (i - 1) / (rings - 3) - 1, 1), -1);
		double wide = 10 - 0.0055 * y * y, flat = hypot(1, y / bend_mm);
		/* Both ends are closed. */
		double there = i == 0 || i == rings - 1 ? 0.02 : 1;

		ring[i].centre[1] = y;
		ring[i].centre[2] = INSTRUMENT_FLANGE_MM + 0.9 - y * y / (2 * bend_mm);
		ring[i].across[0] = 1;
		ring[i].over[1] = -y / bend_mm / flat;
		ring[i].over[2] = -1 / flat;
		ring[i].left = ring[i].right = wide * there;
		ring[i].thick = 0.9 * there;
		ring[i].round = 0.45;
		ring[i].starts = i == 0;
		paint(&ring[i], plastic, 0);
	}
}

int instrument_tube(double tube_mm, struct instrument_mesh *mesh)
{
	/* Rings of the tube: height, from the flange where it is above 0, and radius. */
	const double r = fmax(fmin(tube_mm / 2, 7), 1), up = INSTRUMENT_FLANGE_MM;
	const double shape[][2] = {
		{14, r * 0.72}, {0.4, r * 0.76}, {0, r * 0.88},	  {0.7, r},
		{up, r},	{up + 1.8, r},	 {up + 1.8, 7.2}, {up + 4, 6.6},
		{up + 8, 6.2},	{up + 8, 7.5},	 {up + 23, 7.7},  {up + 23, 6.1},
		{up + 14, 5.6}, {up + 14, 0.01},
	};
	enum { TUBE = sizeof(shape) / sizeof(shape[0]), FLANGE = 11 };
	enum { RINGS = TUBE + FLANGE };
	struct ring ring[RINGS] = {0};

	for (int i = 0; i < TUBE; i++) {
		ring[i].centre[2] = shape[i][0];
		ring[i].across[0] = ring[i].over[1] = 1;
		ring[i].left = ring[i].right = ring[i].thick = shape[i][1];
		ring[i].round = 1;
		paint(&ring[i],
		      i < 2 || i > 11 ? bore
		      : i < 6	      ? clear
		      : i < 9	      ? plastic
				      : blue,
		      0);
	}
	flange(ring + TUBE, FLANGE);
	return skin(ring, RINGS, mesh);
}

void instrument_free(struct instrument_mesh *mesh)
{
	free(mesh->vertices);
	free(mesh->indices);
	memset(mesh, 0, sizeof(*mesh));
}

bool instrument_place(const struct incise_scene_scalpel *scalpel,
		      const struct incise_tick *tick, struct instrument_place *place)
{
	const double *origin;
	double q[4], axis[3], side[3], z[3], x[3], size = 0;

	place->tube = tick->tool == INCISE_TOOL_TUBE;
	origin = place->tube ? tick->tool_mm : tick->position_mm;
	for (int i = 0; i < 4; i++)
		size += tick->quaternion[i] * tick->quaternion[i];
	if (!v3_finite(origin) || v3_length(origin) > 1e6 || !(size > 0.25 && size < 4))
		return false;
	for (int i = 0; i < 4; i++)
		q[i] = tick->quaternion[i] / sqrt(size);
	v3_rotate(axis, q, scalpel->axis);
	v3_rotate(side, q, scalpel->side);
	if (!v3_unit(z, axis, 1e-9))
		return false;
	v3_cross(x, side, z);
	if (!v3_unit(place->x, x, 1e-6)) {
		/* The side is along the axis: use any direction across. */
		const double any[3] = {fabs(z[0]) < 0.7, fabs(z[0]) >= 0.7, 0};

		v3_cross(x, any, z);
		v3_unit(place->x, x, 0);
	}
	v3_copy(place->z, z);
	v3_cross(place->y, z, place->x);
	v3_copy(place->origin_mm, origin);
	return true;
}
