// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How the lips of a wound open around what is put in, and close; see wound.h.
 */
#include <math.h>
#include "wound_line.h"

/* In so deep, it opens the cut by all of its width. */
#define INSERTED_MM 1.5
/* How far along the cut it opens it, in halves of the tool; the lips are that stiff. */
#define SHOULDER_HALVES 4.5
/* They stay wider by this part of how far they were opened. */
#define WIDER 0.12f
/* Parts of the way that they go in a step: 60 ms to open; to close, the last 2 % at 1 s. */
#define OPENING 0.15f
#define CLOSING 0.036f
#define AT_REST_MM 0.004f

/* Half of the width that the tool asks of a point, this far from it and from the ends. */
static float asked_mm(const struct wound *wound, const struct wound_point *p,
		      float end_mm)
{
	double off, ends, in;

	if (!wound->inserted)
		return 0;
	off = ground_length_mm(&p->metric, p->px[0] - wound->tool_px[0],
			       p->px[1] - wound->tool_px[1]) /
	      (wound->tool_half_mm * SHOULDER_HALVES);
	if (!(off < 1))
		return 0;
	/* The corners of a slit stay where they are. */
	ends = fmin(fmax(fmin(p->arc_mm, end_mm - p->arc_mm) / (2 * LINE_TAPER_MM), 0),
		    1);
	in = fmin(wound->tool_depth_mm / INSERTED_MM, 1);
	off = 1 - off * off;
	return (float)(wound->tool_half_mm * in * off * off * ends);
}

/* The stretches on both sides of a point. */
static void stretches_at(struct wound *wound, uint64_t number, bool at_rest)
{
	for (uint64_t i = number; i <= number + 1 && i < wound->settled; i++) {
		struct field_stretch stretch;

		if (i > number && !line_point(wound, i)->joined)
			break;
		if (!line_stretch(wound, line_before(wound, i), line_point(wound, i), 0,
				  &stretch))
			continue;
		if (at_rest)
			line_raise(wound, &stretch);
		line_mark(wound, &stretch);
	}
}

static void step_point(struct wound *wound, uint64_t number, float end_mm)
{
	struct wound_point *p = line_point(wound, number);
	float to = fmaxf(asked_mm(wound, p, end_mm) - p->half_mm, 0), was = p->open_mm;
	bool was_open = line_open(p);

	if (to == was)
		return;
	if (was_open)
		stretches_at(wound, number, false);
	p->open_mm += (to - was) * (to > was ? OPENING : CLOSING);
	if (fabsf(to - p->open_mm) < AT_REST_MM)
		p->open_mm = to;
	p->wider_mm = fmaxf(p->wider_mm, WIDER * p->open_mm);
	if (was_open || line_open(p))
		stretches_at(wound, number, !line_open(p));
}

void wound_step(struct wound *wound)
{
	float end_mm = 0;

	if (!wound->inserted && !wound->moving)
		return;
	wound->moving = false;
	for (uint64_t i = wound->settled; i-- > wound->first;) {
		const struct wound_point *p = line_point(wound, i);

		if (i + 1 == wound->settled || !line_point(wound, i + 1)->joined)
			end_mm = p->arc_mm;
		step_point(wound, i, end_mm);
		wound->moving = wound->moving || p->open_mm > 0;
	}
}
