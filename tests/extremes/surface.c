// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Surfaces of any size and place, meshes with bad triangles, and tools that go anywhere.
 */
#include <stdio.h>
#include <string.h>
#include "../../lib/base/vector.h"
#include "../../lib/surface/surface.h"
#include "../../tools/cli/file.h"
#include "extremes.h"
#include "numbers.h"

#define POINTS 60
#define FAR_mm 1e9 /* the library takes what is beyond as this far */

/* Without overflow. */
static double length(const double v[3])
{
	return hypot(hypot(v[0], v[1]), v[2]);
}

static double number(double scale)
{
	return any_number(8, -scale, scale);
}

static void any_point(double p[3], double scale)
{
	for (int i = 0; i < 3; i++)
		p[i] = number(scale);
}

static void check_touch(struct extremes_row *row, bool held, const char *what,
			const double p[3], const struct incise_touch *t)
{
	extremes_check(row, held, "%s at " V3 ": point " V3 ", normal " V3 ", depth %a",
		       what, V3_OF(p), V3_OF(t->point_mm), V3_OF(t->normal), t->depth_mm);
}

static bool is_touch(const struct incise_touch *t)
{
	return v3_finite(t->point_mm) && v3_finite(t->normal) && isfinite(t->depth_mm) &&
	       fabs(length(t->normal) - 1) < 1e-9;
}

static void find_nearest(struct extremes_row *row, const struct incise_surface *surface)
{
	double p[3], off[3], away, size;
	struct incise_touch t;

	do
		any_point(p, 200);
	while (!v3_finite(p));
	incise_surface_nearest(surface, p, &t);
	for (int i = 0; i < 3; i++)
		off[i] = fmax(-FAR_mm, fmin(FAR_mm, p[i])) - t.point_mm[i];
	away = length(off);
	size = away + length(t.point_mm);
	check_touch(row,
		    is_touch(&t) && fabs(fabs(t.depth_mm) - away) <= 1e-12 * size + 1e-12,
		    "nearest", p, &t);
}

static void move(struct extremes_row *row, const struct incise_surface *surface,
		 struct incise_proxy *proxy, const double at[3])
{
	struct incise_proxy was = *proxy;
	double way[3], went[3];
	bool near;

	incise_proxy_move(proxy, at);
	if (!v3_finite(at)) {
		/* It changes nothing. */
		check_touch(row,
			    proxy->touching == was.touching &&
				    !memcmp(proxy->tool_mm, was.tool_mm,
					    sizeof(was.tool_mm)),
			    "moved by no number", at, &proxy->touch);
		return;
	}
	v3_sub(way, proxy->tool_mm, was.tool_mm);
	v3_sub(went, proxy->touch.point_mm, was.touch.point_mm);
	near = incise_surface_kind(surface) < INCISE_SURFACE_HEIGHTS || proxy->began ||
	       !was.touching || length(went) <= 2 * length(way) * (1 + 1e-9) + 1e-9;
	check_touch(row,
		    isfinite(proxy->clear_mm) &&
			    (proxy->touching ? is_touch(&proxy->touch) && near
					     : !proxy->began),
		    "the proxy of a tool", at, &proxy->touch);
}

/* A tool that jumps, glides and stands still. */
static void follow(struct extremes_row *row, const struct incise_surface *surface)
{
	struct incise_proxy proxy;
	struct incise_touch top;
	double at[3];

	incise_surface_top(surface, &top);
	v3_copy(at, top.point_mm);
	incise_proxy_init(&proxy, surface, below(2) ? 0 : between(0, 5));
	for (int k = 0; k < POINTS; k++) {
		if (below(4))
			for (int i = 0; i < 3; i++)
				at[i] += between(-2, 2);
		else if (below(2))
			any_point(at, 200);
		else
			v3_copy(at, top.point_mm);
		move(row, surface, &proxy, at);
		if (!v3_finite(at))
			v3_copy(at, top.point_mm);
	}
}

static void try_surface(struct extremes_row *row, struct incise_surface *surface,
			const struct incise_error *err)
{
	if (!surface) {
		extremes_refused(row, err);
		return;
	}
	for (int k = 0; k < POINTS; k++)
		find_nearest(row, surface);
	follow(row, surface);
	incise_surface_free(surface);
}

static double any_radius(void)
{
	return below(2) ? exp(between(-14, 12)) : number(100);
}

static void try_solid(struct extremes_row *row, const struct property *property)
{
	struct incise_surface *surface;
	struct incise_error err = {0};
	double a[3], b[3];

	any_point(a, below(2) ? 100 : 1e5);
	any_point(b, below(2) ? 1 : 1e5);
	switch ((enum incise_surface_kind)property->kind) {
	case INCISE_SURFACE_PLANE:
		surface = incise_surface_new_plane(a, b, &err);
		break;
	case INCISE_SURFACE_SPHERE:
		surface = incise_surface_new_sphere(a, any_radius(), &err);
		break;
	default:
		surface = incise_surface_new_capsule(a, below(4) ? b : a, any_radius(),
						     &err);
	}
	try_surface(row, surface, &err);
}

/*
 * A sheet whose corners are moved: slivers, needles, folds, corners on one another, and
 * now and then a face that is none or a number that is too large.
 */
static void write_mesh(FILE *out)
{
	int n = 2 + (int)below(6);
	double flat = below(3) ? 1 : exp(between(-22, 0)), bend = below(3) ? 5 : 80;
	double rough = below(3) ? 0 : exp(between(-20, 0));

	for (int j = 0; j < n; j++)
		for (int i = 0; i < n; i++)
			fprintf(out, "v %.17g %.17g %.17g\n",
				20.0 * i + 20 * rough * between(-1, 1),
				flat * (20.0 * j + 20 * rough * between(-1, 1)),
				below(60) ? between(-bend, bend) : number(1e5));
	for (int j = 0; j + 1 < n; j++)
		for (int i = 0; i + 1 < n; i++) {
			int a = j * n + i + 1;

			if (!below(30))
				continue; /* a hole */
			if (below(2))
				fprintf(out, "f %d %d %d %d\n", a, a + 1, a + n + 1,
					a + n);
			else
				fprintf(out, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + n,
					a + 1, a + n + 1, a + n);
		}
	if (!below(20))
		fprintf(out, "f %d %d %d\n", (int)below(9) - 4, (int)below(40),
			(int)below(40));
}

static void write_heights(FILE *out)
{
	int n = 2 + (int)below(8), m = 2 + (int)below(8);
	double high = below(2) ? 3 : exp(between(-20, 12));

	fprintf(out,
		"ncols %d\nnrows %d\nxllcenter %.17g\nyllcenter %.17g\ncellsize %.17g\n",
		n, m, between(-50, 50), between(-50, 50),
		below(3) ? 5 : exp(between(-22, 12)));
	for (int j = 0; j < m; j++)
		for (int i = 0; i < n; i++)
			fprintf(out, "%.17g%c",
				below(200) ? between(-high, high) : number(1e5),
				i + 1 < n ? ' ' : '\n');
}

static void try_file(struct extremes_row *row, const struct property *property)
{
	bool heights = property->kind == INCISE_SURFACE_HEIGHTS;
	struct memory_file file = memory_file_begin("surface");
	double at[3] = {between(-10, 10), 0, 0};
	struct incise_error err = {0};

	(heights ? write_heights : write_mesh)(file.file);
	memory_file_written(&file);
	try_surface(row,
		    heights ? incise_surface_load_heights(file.path, at, &err)
			    : incise_surface_load_mesh(file.path, at, true, &err),
		    &err);
	fclose(file.file);
}

const struct property surface_properties[] = {
	{"plane",
	 "planes of any place and normal; nearest points and a proxy for any tool: "
	 "finite, normals of length 1, the depth is the distance; or refused",
	 2000, .each = try_solid, .kind = INCISE_SURFACE_PLANE},
	{"sphere", "the same of spheres of any radius", 2000, .each = try_solid,
	 .kind = INCISE_SURFACE_SPHERE},
	{"capsule", "the same of capsules of any ends and radius", 2000,
	 .each = try_solid, .kind = INCISE_SURFACE_CAPSULE},
	{"mesh",
	 "meshes with slivers down to 1e-9 mm, needles, folds, holes and broken faces: "
	 "as above, and a proxy goes at most twice as far as its tool; or refused",
	 1200, .each = try_file, .kind = INCISE_SURFACE_MESH},
	{"heights", "the same of height fields of any size and roughness", 1200,
	 .each = try_file, .kind = INCISE_SURFACE_HEIGHTS},
	{0},
};
