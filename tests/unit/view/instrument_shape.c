// SPDX-License-Identifier: GPL-2.0-or-later
/* Meshes of instruments, and their frames from ticks. */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/view/instrument_shape.h"

static const struct incise_scene_scalpel scalpel = {{0, 0, 1}, {0, 1, 0}, 120, 10, 3, 7};

static double signed_volume(const struct instrument_mesh *mesh)
{
	double volume = 0;

	for (int i = 0; i < mesh->n_indices; i += 3) {
		double p[3][3], c[3];

		for (int j = 0; j < 3; j++)
			for (int k = 0; k < 3; k++)
				p[j][k] = mesh->vertices[mesh->indices[i + j]]
						  .position_mm[k];
		v3_cross(c, p[1], p[2]);
		volume += v3_dot(p[0], c) / 6;
	}
	return volume;
}

static void check(const struct instrument_mesh *mesh, double low[3], double high[3])
{
	assert_in_range(mesh->n_indices / 3, 100, 999);
	assert_int_equal(mesh->n_indices % 3, 0);
	for (int k = 0; k < 3; k++) {
		low[k] = INFINITY;
		high[k] = -INFINITY;
	}
	for (int i = 0; i < mesh->n_vertices; i++) {
		const struct instrument_vertex *v = &mesh->vertices[i];
		double n = 0;

		for (int k = 0; k < 3; k++) {
			assert_true(isfinite(v->position_mm[k]));
			low[k] = fmin(low[k], v->position_mm[k]);
			high[k] = fmax(high[k], v->position_mm[k]);
			n += v->normal[k] * v->normal[k];
			assert_true(v->rgb[k] >= 0 && v->rgb[k] <= 1);
		}
		/* The shader normalizes it; steel's normals lean on purpose. */
		assert_true(n > 0.2 && n < 4);
	}
	for (int i = 0; i < mesh->n_indices; i++)
		assert_true(mesh->indices[i] < (uint32_t)mesh->n_vertices);
}

TEST(test_scalpel)
{
	static const double lengths[] = {1, 40, 120, 1000};
	struct instrument_mesh mesh;
	double low[3], high[3];

	for (int i = 0; i < 4; i++) {
		struct incise_scene_scalpel tool = scalpel;
		double h = lengths[i];

		tool.handle_mm = h;
		assert_int_equal(instrument_scalpel(&tool, &mesh), 0);
		check(&mesh, low, high);
		/* From the tip to the handle's end; floats. */
		assert_true(fabs(low[2]) < 1e-5 && fabs(high[2] - h) < 1e-3);
		/* Flat side to y. */
		assert_true(high[0] - low[0] > 1.5 * (high[1] - low[1]));
		/* Turned outwards: a volume, of about 8 × 4 × 90 mm for the usual one. */
		assert_true(signed_volume(&mesh) > 0);
		if (h == 120)
			assert_true(signed_volume(&mesh) > 1500 &&
				    signed_volume(&mesh) < 4500);
		instrument_free(&mesh);
		assert_null(mesh.vertices);
	}
}

TEST(test_tube)
{
	struct instrument_mesh mesh;
	double low[3], high[3];

	assert_int_equal(instrument_tube(7, &mesh), 0);
	check(&mesh, low, high);
	assert_true(fabs(low[2]) < 1e-5);
	assert_true(signed_volume(&mesh) > 0);
	/* The flange is wider than the neck's larynx, across it; the connector is above. */
	assert_true(high[1] > 25 && fabs(high[1] + low[1]) < 1e-3);
	assert_true(high[0] > 8 && high[0] < 12 && fabs(high[0] + low[0]) < 1e-3);
	assert_true(high[2] > INSTRUMENT_FLANGE_MM + 15);
	/* An inserted tool is as thick as it is said; floats. */
	for (int i = 0; i < mesh.n_vertices; i++) {
		const float *p = mesh.vertices[i].position_mm;

		if (p[2] < INSTRUMENT_FLANGE_MM - 10 && fabs(p[1]) < 8)
			assert_true(hypot(p[0], p[1]) < 3.5 + 1e-5);
	}
	instrument_free(&mesh);
}

static void expect(const struct instrument_place *place, const double x[3],
		   const double z[3])
{
	double y[3];

	for (int k = 0; k < 3; k++) {
		assert_true(fabs(place->x[k] - x[k]) < 1e-12);
		assert_true(fabs(place->z[k] - z[k]) < 1e-12);
	}
	v3_cross(y, place->z, place->x);
	for (int k = 0; k < 3; k++)
		assert_true(fabs(place->y[k] - y[k]) < 1e-12);
}

TEST(test_place)
{
	struct instrument_place place;
	struct incise_tick tick = {.position_mm = {1, 2, 3},
				   .tool_mm = {4, 5, 6},
				   .quaternion = {1, 0, 0, 0},
				   .tool = INCISE_TOOL_BLADE};

	assert_true(instrument_place(&scalpel, &tick, &place));
	expect(&place, (double[]){1, 0, 0}, (double[]){0, 0, 1});
	assert_true(!place.tube && place.origin_mm[0] == 1);
	/* A quarter round x: what was up is -y. A handle is the scalpel's, at its tip. */
	tick.quaternion[0] = tick.quaternion[1] = M_SQRT1_2;
	tick.tool = INCISE_TOOL_HANDLE;
	assert_true(instrument_place(&scalpel, &tick, &place));
	expect(&place, (double[]){1, 0, 0}, (double[]){0, -1, 0});
	assert_true(!place.tube && place.origin_mm[2] == 3);
	tick.tool = INCISE_TOOL_TUBE;
	assert_true(instrument_place(&scalpel, &tick, &place));
	assert_true(place.tube && place.origin_mm[0] == 4);
}

TEST(test_nowhere)
{
	static const struct incise_scene_scalpel odd = {{0, 0, 1}, {0, 0, 1}, 120,
							10,	   3,	      7};
	const struct incise_tick good = {.quaternion = {1, 0, 0, 0},
					 .tool = INCISE_TOOL_BLADE};
	struct instrument_place place;
	struct incise_tick tick = good;

	/* Side along the axis: some frame, a right one. */
	assert_true(instrument_place(&odd, &tick, &place));
	assert_true(fabs(v3_length(place.x) - 1) < 1e-12);
	assert_true(fabs(v3_dot(place.x, place.z)) < 1e-12);

	tick.quaternion[0] = 0;
	assert_false(instrument_place(&scalpel, &tick, &place));
	tick.quaternion[2] = NAN;
	assert_false(instrument_place(&scalpel, &tick, &place));
	tick = good;
	tick.position_mm[1] = INFINITY;
	assert_false(instrument_place(&scalpel, &tick, &place));
	tick.position_mm[1] = 1e7;
	assert_false(instrument_place(&scalpel, &tick, &place));
}
