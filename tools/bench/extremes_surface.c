// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Surfaces of any size and place, meshes with bad triangles, and tools that go anywhere.
 */
#include <stdio.h>
#include <string.h>
#include "../../lib/surface/surface.h"
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"
#include "../cli/file.h"

#define SURFACES 2000
#define MESHES 1200
#define POINTS 60
#define FAR_mm 1e9 /* what is beyond counts as there */

static double length(const double v[3])
{
	return hypot(hypot(v[0], v[1]), v[2]);
}

static bool finite3(const double v[3])
{
	return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

static double any_number(double scale)
{
	switch (below(8)) {
	case 0:
		return special();
	case 1:
		return any_bits();
	default:
		return between(-scale, scale);
	}
}

static void any_point(double p[3], double scale)
{
	for (int i = 0; i < 3; i++)
		p[i] = any_number(scale);
}

static void tell_point(struct extremes_row *row, const char *what, const double p[3],
		       const struct incise_touch *t)
{
	extremes_tell(
		row,
		"%s at (%a, %a, %a): point (%a, %a, %a), normal (%a, %a, %a), depth "
		"%a, case %ld",
		what, p[0], p[1], p[2], t->point_mm[0], t->point_mm[1], t->point_mm[2],
		t->normal[0], t->normal[1], t->normal[2], t->depth_mm, row->tried);
}

static bool is_touch(const struct incise_touch *t)
{
	return finite3(t->point_mm) && finite3(t->normal) && isfinite(t->depth_mm) &&
	       fabs(length(t->normal) - 1) < 1e-9;
}

static void ask_nearest(struct extremes_row *row, const struct incise_surface *surface)
{
	double p[3], off[3], away, size;
	struct incise_touch t;

	do
		any_point(p, 200);
	while (!finite3(p));
	incise_surface_nearest(surface, p, &t);
	for (int i = 0; i < 3; i++)
		off[i] = fmax(-FAR_mm, fmin(FAR_mm, p[i])) - t.point_mm[i];
	away = length(off);
	size = away + length(t.point_mm);
	if (extremes_first_wrong(row, is_touch(&t) && fabs(fabs(t.depth_mm) - away) <=
							      1e-12 * size + 1e-12))
		tell_point(row, "nearest", p, &t);
}

/* A tool that leaps, glides and stands still. */
static void follow(struct extremes_row *row, const struct incise_surface *surface)
{
	struct incise_proxy proxy;
	struct incise_touch top;
	double at[3];

	incise_surface_top(surface, &top);
	memcpy(at, top.point_mm, sizeof(at));
	incise_proxy_init(&proxy, surface, below(2) ? 0 : between(0, 5));
	for (int k = 0; k < POINTS; k++) {
		struct incise_proxy was = proxy;
		double way[3], went[3];

		if (below(4))
			for (int i = 0; i < 3; i++)
				at[i] += between(-2, 2);
		else if (below(2))
			any_point(at, 200);
		else
			memcpy(at, top.point_mm, sizeof(at));
		incise_proxy_move(&proxy, at);
		if (!finite3(at)) {
			/* It changes nothing. */
			if (extremes_first_wrong(
				    row, proxy.touching == was.touching &&
						 !memcmp(proxy.tool_mm, was.tool_mm,
							 sizeof(was.tool_mm))))
				tell_point(row, "moved by no number", at, &proxy.touch);
			memcpy(at, top.point_mm, sizeof(at));
			continue;
		}
		for (int i = 0; i < 3; i++) {
			way[i] = proxy.tool_mm[i] - was.tool_mm[i];
			went[i] = proxy.touch.point_mm[i] - was.touch.point_mm[i];
		}
		if (extremes_first_wrong(
			    row, !proxy.touching ||
					 (is_touch(&proxy.touch) &&
					  (incise_surface_kind(surface) <
						   INCISE_SURFACE_HEIGHTS ||
					   proxy.began || !was.touching ||
					   length(went) <=
						   2 * length(way) * (1 + 1e-9) + 1e-9))))
			tell_point(row, "the proxy of a tool", at, &proxy.touch);
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
		ask_nearest(row, surface);
	follow(row, surface);
	incise_surface_free(surface);
}

static double any_radius(void)
{
	return below(2) ? exp(between(-14, 12)) : any_number(100);
}

static void try_solids(struct extremes *all)
{
	static const struct {
		const char *name, *what;
	} kinds[] = {
		{"plane",
		 "planes of any place and normal; nearest points and a proxy for any tool: "
		 "finite, normals of length 1, the depth is the distance; or refused"},
		{"sphere", "the same of spheres of any radius"},
		{"capsule", "the same of capsules of any ends and radius"},
	};

	for (int kind = 0; kind < 3; kind++) {
		struct extremes_row *row =
			extremes_begin(all, kinds[kind].name, kinds[kind].what);

		rng = extremes_seed(all, row);
		for (long k = extremes_cases(all, SURFACES); k; k--) {
			struct incise_error err = {0};
			double a[3], b[3];

			any_point(a, below(2) ? 100 : 1e5);
			any_point(b, below(2) ? 1 : 1e5);
			try_surface(
				row,
				kind == 0 ? incise_surface_new_plane(a, b, &err)
				: kind == 1
					? incise_surface_new_sphere(a, any_radius(), &err)
					: incise_surface_new_capsule(a, below(4) ? b : a,
								     any_radius(), &err),
				&err);
		}
	}
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
				below(60) ? between(-bend, bend) : any_number(1e5));
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
				below(200) ? between(-high, high) : any_number(1e5),
				i + 1 < n ? ' ' : '\n');
}

static void try_files(struct extremes *all)
{
	static const struct {
		const char *name, *what;
	} kinds[] = {
		{"mesh",
		 "meshes with slivers down to 1e-9 mm, needles, folds, holes and broken faces: "
		 "as above, and a proxy goes at most twice as far as its tool; or refused"},
		{"heights", "the same of height fields of any size and roughness"},
	};

	for (int kind = 0; kind < 2; kind++) {
		struct extremes_row *row =
			extremes_begin(all, kinds[kind].name, kinds[kind].what);

		rng = extremes_seed(all, row);
		for (long k = extremes_cases(all, MESHES); k; k--) {
			struct memory_file file = memory_file_begin("surface");
			double at[3] = {between(-10, 10), 0, 0};
			struct incise_error err = {0};

			(kind ? write_heights : write_mesh)(file.file);
			memory_file_written(&file);
			try_surface(row,
				    kind ? incise_surface_load_heights(file.path, at,
								       &err)
					 : incise_surface_load_mesh(file.path, at, &err),
				    &err);
			fclose(file.file);
		}
	}
}

void extremes_surface(struct extremes *all)
{
	try_solids(all);
	try_files(all);
}
