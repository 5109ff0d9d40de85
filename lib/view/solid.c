// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Triangles in the graphics' memory; see solid.h.
 */
#include <epoxy/gl.h>
#include <stddef.h>
#include "../base/vector.h"
#include "solid.h"

static void attribute(int index, int n, size_t stride, size_t offset)
{
	glEnableVertexAttribArray(index);
	glVertexAttribPointer(index, n, GL_FLOAT, GL_FALSE, (int)stride,
			      (const void *)(uintptr_t)offset);
}

static void fill(struct incise_solid *solid, const void *vertices, size_t bytes,
		 const uint32_t *indices, int n_indices)
{
	glGenVertexArrays(1, &solid->array);
	glGenBuffers(1, &solid->vertices);
	glGenBuffers(1, &solid->indices);
	glBindVertexArray(solid->array);
	glBindBuffer(GL_ARRAY_BUFFER, solid->vertices);
	glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)bytes, vertices, GL_STATIC_DRAW);
	glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, solid->indices);
	glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)n_indices * 4, indices,
		     GL_STATIC_DRAW);
	solid->n_indices = n_indices;
}

void incise_solid_draw(const struct incise_solid *solid)
{
	glBindVertexArray(solid->array);
	glDrawElements(GL_TRIANGLES, solid->n_indices, GL_UNSIGNED_INT, NULL);
}

void incise_solid_free(struct incise_solid *solid)
{
	glDeleteVertexArrays(1, &solid->array);
	glDeleteBuffers(1, &solid->vertices);
	glDeleteBuffers(1, &solid->indices);
}

void incise_solid_surface(struct incise_solid *solid, const struct incise_chart *chart,
			  double middle_mm[3], double *reach_mm)
{
	const size_t stride = sizeof(struct incise_chart_vertex);
	double low[3] = {INFINITY, INFINITY, INFINITY};
	double high[3] = {-INFINITY, -INFINITY, -INFINITY}, across[3];

	fill(solid, chart->vertices, chart->n_vertices * stride, chart->indices,
	     chart->n_indices);
	attribute(0, 3, stride, offsetof(struct incise_chart_vertex, position_mm));
	attribute(1, 3, stride, offsetof(struct incise_chart_vertex, normal));
	attribute(2, 4, stride, offsetof(struct incise_chart_vertex, tangent));
	attribute(3, 2, stride, offsetof(struct incise_chart_vertex, px));
	for (int i = 0; i < chart->n_vertices; i++)
		for (int k = 0; k < 3; k++) {
			low[k] = fmin(low[k], chart->vertices[i].position_mm[k]);
			high[k] = fmax(high[k], chart->vertices[i].position_mm[k]);
		}
	for (int k = 0; k < 3 && chart->n_vertices > 0; k++)
		middle_mm[k] = 0.5 * (low[k] + high[k]);
	v3_sub(across, high, low);
	*reach_mm = chart->n_vertices > 0 ? 0.5 * v3_length(across) : 1;
}

void incise_solid_instrument(struct incise_solid *solid,
			     const struct incise_instrument_mesh *mesh)
{
	const size_t stride = sizeof(struct incise_instrument_vertex);

	fill(solid, mesh->vertices, mesh->n_vertices * stride, mesh->indices,
	     mesh->n_indices);
	attribute(0, 3, stride, offsetof(struct incise_instrument_vertex, position_mm));
	attribute(1, 3, stride, offsetof(struct incise_instrument_vertex, normal));
	attribute(2, 4, stride, offsetof(struct incise_instrument_vertex, rgb));
}
