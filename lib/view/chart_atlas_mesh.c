// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The triangles of an atlas: the mesh's own. Where texture coordinates part, at the seams,
 * a corner of the mesh is several vertices.
 */
#include <errno.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../surface/surface.h"
#include "chart_kind.h"

/* So many vertices of one place are compared; beyond, equal ones may stand twice. */
#define COMPARED_MAX 16

struct weld {
	uint32_t *last;	  /* vertex made of a mesh's, or MESH_NONE */
	uint32_t *before; /* vertex made of the same one before, or MESH_NONE */
	uint32_t *corner; /* 3 triangle + corner that a vertex was made of first */
};

static const float *uv_of(const struct mesh *mesh, uint32_t corner)
{
	return mesh->uv[corner / 3][corner % 3];
}

static uint32_t weld_corner(struct weld *weld, const struct mesh *mesh, uint32_t corner,
			    int *n)
{
	uint32_t point = mesh->corner[corner / 3][corner % 3];
	uint32_t vertex = weld->last[point];

	for (int k = 0; k < COMPARED_MAX && vertex != MESH_NONE; k++) {
		const float *a = uv_of(mesh, corner);
		const float *b = uv_of(mesh, weld->corner[vertex]);

		if (a[0] == b[0] && a[1] == b[1])
			return vertex;
		vertex = weld->before[vertex];
	}
	vertex = (uint32_t)(*n)++;
	weld->corner[vertex] = corner;
	weld->before[vertex] = weld->last[point];
	weld->last[point] = vertex;
	return vertex;
}

/* The way of +px[0] and +px[1] over each triangle, summed up at its corners. */
static void add_directions(struct incise_chart *chart, double (*right)[3],
			   double (*down)[3])
{
	for (int i = 0; i < chart->n_indices; i += 3) {
		const struct incise_chart_vertex *v[3];
		double e1[3], e2[3], f1[2], f2[2], turn;

		for (int k = 0; k < 3; k++)
			v[k] = chart->vertices + chart->indices[i + k];
		for (int k = 0; k < 3; k++) {
			e1[k] = (double)v[1]->position_mm[k] - v[0]->position_mm[k];
			e2[k] = (double)v[2]->position_mm[k] - v[0]->position_mm[k];
		}
		for (int k = 0; k < 2; k++) {
			f1[k] = (double)v[1]->px[k] - v[0]->px[k];
			f2[k] = (double)v[2]->px[k] - v[0]->px[k];
		}
		turn = f1[0] * f2[1] - f1[1] * f2[0] < 0 ? -1 : 1;
		for (int k = 0; k < 3; k++) {
			double *r = right[chart->indices[i + k]];
			double *d = down[chart->indices[i + k]];

			v3_add(r, r, turn * f2[1], e1);
			v3_add(r, r, -turn * f1[1], e2);
			v3_add(d, d, turn * f1[0], e2);
			v3_add(d, d, -turn * f2[0], e1);
		}
	}
}

static void set_tangent(struct incise_chart_vertex *vertex, const double right[3],
			const double down[3])
{
	double normal[3], side[3], tangent[3] = {1, 0, 0}, out[3];

	for (int k = 0; k < 3; k++)
		normal[k] = vertex->normal[k];
	if (fabs(normal[0]) > 0.9) {
		tangent[0] = 0;
		tangent[1] = 1;
	}
	v3_add(side, right, -v3_dot(right, normal), normal);
	/* Without texture coordinates any tangent will do. */
	if (!v3_unit(tangent, side, 0)) {
		v3_add(side, tangent, -v3_dot(tangent, normal), normal);
		v3_unit(tangent, side, 0);
	}
	v3_cross(out, normal, tangent);
	for (int k = 0; k < 3; k++)
		vertex->tangent[k] = (float)tangent[k];
	vertex->tangent[3] = v3_dot(out, down) > 0 ? 1 : -1;
}

static int write_vertices(struct incise_chart *chart, const struct weld *weld)
{
	const struct mesh *mesh = chart->surface->mesh;
	size_t n = (size_t)chart->n_vertices;
	double(*right)[3] = calloc(n, sizeof(*right));
	double(*down)[3] = calloc(n, sizeof(*down));
	int rc = right && down ? 0 : -ENOMEM;

	chart->vertices = calloc(n, sizeof(*chart->vertices));
	if (!chart->vertices)
		rc = -ENOMEM;
	for (size_t i = 0; i < n && !rc; i++) {
		struct incise_chart_vertex *to = chart->vertices + i;
		uint32_t corner = weld->corner[i];
		uint32_t point = mesh->corner[corner / 3][corner % 3];
		const float *uv = uv_of(mesh, corner);

		for (int k = 0; k < 3; k++) {
			to->position_mm[k] = (float)mesh->vertex[point][k];
			to->normal[k] = (float)mesh->normal[point][k];
		}
		to->px[0] = uv[0] * (float)chart->size;
		to->px[1] = (float)((1 - (double)uv[1]) * chart->size);
	}
	if (!rc)
		add_directions(chart, right, down);
	for (size_t i = 0; i < n && !rc; i++)
		set_tangent(chart->vertices + i, right[i], down[i]);
	free(right);
	free(down);
	return rc;
}

int chart_atlas_mesh(struct incise_chart *chart)
{
	const struct mesh *mesh = chart->surface->mesh;
	size_t n = 3 * (size_t)mesh->n_triangles;
	struct weld weld = {0};
	int rc = -ENOMEM;

	chart->indices = calloc(n, sizeof(*chart->indices));
	weld.last = malloc(mesh->n_vertices * sizeof(*weld.last));
	weld.before = malloc(n * sizeof(*weld.before));
	weld.corner = malloc(n * sizeof(*weld.corner));
	if (chart->indices && weld.last && weld.before && weld.corner) {
		for (uint32_t i = 0; i < mesh->n_vertices; i++)
			weld.last[i] = MESH_NONE;
		for (size_t i = 0; i < n; i++)
			chart->indices[i] =
				weld_corner(&weld, mesh, (uint32_t)i, &chart->n_vertices);
		chart->n_indices = (int)n;
		rc = write_vertices(chart, &weld);
	}
	free(weld.last);
	free(weld.before);
	free(weld.corner);
	return rc;
}
