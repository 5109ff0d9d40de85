/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What each kind of chart does: setting it up, and its map both ways. See chart.h.
 *
 * _px() and _point() return false outside; _metric() writes what it finds, or returns
 * false and nothing. Places are finite and, of texels, on the texture.
 */
#ifndef INCISE_CHART_KIND_H
#define INCISE_CHART_KIND_H

#include "chart.h"

/* Seen from above: any surface. */
void chart_above_init(struct incise_chart *chart);
bool chart_above_px(const struct incise_chart *chart, const double point_mm[3],
		    double px[2]);
bool chart_above_point(const struct incise_chart *chart, const double px[2],
		       double point_mm[3], double normal[3]);
bool chart_above_metric(const struct incise_chart *chart, const double px[2],
			double right_mm[3], double down_mm[3]);

/* Unrolled: false where that is no way to look at the surface. */
bool chart_unrolled_init(struct incise_chart *chart);
bool chart_unrolled_px(const struct incise_chart *chart, const double point_mm[3],
		       double px[2]);
void chart_unrolled_point(const struct incise_chart *chart, const double px[2],
			  double point_mm[3], double normal[3]);
void chart_unrolled_metric(const struct incise_chart *chart, const double px[2],
			   double right_mm[3], double down_mm[3]);

/*
 * An atlas: a mesh's own texture coordinates. 0 or -ENOMEM; where no texel is on the mesh
 * the chart is not made an atlas.
 */
int chart_atlas_init(struct incise_chart *chart);
void chart_atlas_free(struct chart_atlas *atlas);
bool chart_atlas_px(const struct incise_chart *chart, const double point_mm[3],
		    double px[2]);
bool chart_atlas_point(const struct incise_chart *chart, const double px[2],
		       double point_mm[3], double normal[3]);
bool chart_atlas_metric(const struct incise_chart *chart, const double px[2],
			double right_mm[3], double down_mm[3]);

/* The triangles that are drawn: of an atlas, and of all others. 0 or -ENOMEM. */
int chart_atlas_mesh(struct incise_chart *chart);
int chart_grid_init(struct incise_chart *chart);

#endif
