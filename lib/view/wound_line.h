/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A wound's inside: the line of its points, and the stretches between them; see wound.h.
 */
#ifndef INCISE_VIEW_WOUND_LINE_H
#define INCISE_VIEW_WOUND_LINE_H

#include "wound.h"
#include "wound_field.h"

/* A cut runs out into a point over this length at either end. */
#define LINE_TAPER_MM 1.6f

struct wound {
	const struct incise_chart *chart;
	int size, tiles; /* texels, tiles along a side */
	float texel_mm;
	struct field_texel *field; /* tile after tile */
	uint8_t *dirty;		   /* tiles² */
	int n_dirty;

	/* Points have numbers; those from @first to before @end are there. */
	uint64_t first, end;
	uint64_t settled; /* those before are settled */
	struct wound_point *points;

	bool cutting; /* and @tip is the blade, joined to the last point */
	struct wound_point tip;
	double tip_mm[3]; /* on the surface */
	int64_t tip_ns;

	bool inserted, moving; /* lips are not at rest */
	double tool_px[2], tool_half_mm, tool_depth_mm;

	double cut_mm;
	uint64_t stamps;
	struct field_stretch *over; /* room to paint: WOUND_POINTS and the blade's */
};

struct wound_point *line_point(const struct wound *wound, uint64_t number);

/* The one before it, or NULL. */
const struct wound_point *line_before(const struct wound *wound, uint64_t number);

/* The lips are farther apart there than they will stay. */
bool line_open(const struct wound_point *p);

/*
 * The stretch that ends at a point, as it is to be drawn when the cut ends at this arc;
 * returns false when it touches nothing of the texture.
 */
bool line_stretch(const struct wound *wound, const struct wound_point *before,
		  const struct wound_point *p, float end_mm,
		  struct field_stretch *stretch);

/* What a stretch touches is to be painted; and raise the fields there. */
void line_mark(struct wound *wound, const struct field_stretch *s);
void line_raise(struct wound *wound, const struct field_stretch *s);

/* Points up to an arc are final, in a cut that ends at one. */
void line_settle(struct wound *wound, float end_mm, float until_mm);

#endif
