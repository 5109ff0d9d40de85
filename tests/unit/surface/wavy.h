/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A square sheet with waves along x and y, around the origin: n × n cells of two
 * triangles, and its height by a formula of its own, without any tree or neighbour.
 */
#ifndef INCISE_TEST_WAVY_H
#define INCISE_TEST_WAVY_H

#include <math.h>
#include <stdlib.h>
#include "../../../lib/surface/surface.h"

struct wavy {
	int n;
	double size, amplitude, wavelength; /* mm */
};

static inline double wavy_knot(const struct wavy *w, int i)
{
	return w->size * i / w->n - w->size / 2;
}

static inline double wavy_smooth(const struct wavy *w, double x, double y)
{
	double k = 2 * M_PI / w->wavelength;

	return w->amplitude * sin(k * x) * sin(k * y);
}

/* Of the mesh: linear on the triangle of the cell that x, y lie in. */
static inline double wavy_height(const struct wavy *w, double x, double y)
{
	double u = (x + w->size / 2) / w->size * w->n,
	       v = (y + w->size / 2) / w->size * w->n;
	int i = (int)fmin(fmax(floor(u), 0), w->n - 1);
	int j = (int)fmin(fmax(floor(v), 0), w->n - 1);
	double z[2][2];

	u -= i;
	v -= j;
	for (int a = 0; a < 2; a++)
		for (int b = 0; b < 2; b++)
			z[a][b] =
				wavy_smooth(w, wavy_knot(w, i + a), wavy_knot(w, j + b));
	/* The cell is cut from its lower left to its upper right corner. */
	if (u > v)
		return z[0][0] + u * (z[1][0] - z[0][0]) + v * (z[1][1] - z[1][0]);
	return z[0][0] + v * (z[0][1] - z[0][0]) + u * (z[1][1] - z[0][1]);
}

/* Built in memory: writing and reading 40 MB of text is another test's matter. */
static inline struct incise_surface *wavy_surface(const struct wavy *w)
{
	struct incise_surface *surface = calloc(1, sizeof(*surface));
	size_t side = (size_t)w->n + 1, cells = (size_t)w->n * w->n;
	struct mesh_draft draft = {.path = "wavy"};

	draft.point = malloc(side * side * sizeof(*draft.point));
	draft.corner = malloc(2 * cells * sizeof(*draft.corner));
	if (!surface || !draft.point || !draft.corner)
		abort();
	for (size_t k = 0; k < side * side; k++) {
		double x = wavy_knot(w, (int)(k % side));
		double y = wavy_knot(w, (int)(k / side));

		draft.point[k][0] = x;
		draft.point[k][1] = y;
		draft.point[k][2] = wavy_smooth(w, x, y);
	}
	for (size_t k = 0; k < cells; k++) {
		uint32_t a = (uint32_t)(k / w->n * side + k % w->n);
		uint32_t c = a + (uint32_t)side;

		draft.corner[2 * k][0] = draft.corner[2 * k + 1][0] = a;
		draft.corner[2 * k][1] = a + 1;
		draft.corner[2 * k][2] = draft.corner[2 * k + 1][1] = c + 1;
		draft.corner[2 * k + 1][2] = c;
	}
	draft.n_points = side * side;
	draft.n_triangles = 2 * cells;
	surface->kind = INCISE_SURFACE_MESH;
	surface->mesh = mesh_new(&draft, NULL);
	free(draft.point);
	free(draft.corner);
	if (!surface->mesh)
		abort();
	return surface;
}

#endif
