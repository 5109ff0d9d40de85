// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The wound in the texture; see wound.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "wound_line.h"

/* Less deep the blade touches the skin but does not cut it. */
#define CUTS_FROM_MM 0.05
#define DEPTH_MAX_MM 15.0
/* A hand is not faster; what is, or was not seen for so long, is no way but a leap. */
#define SPEED_MAX_MM_S 5000.0
#define GAP_MAX_NS 500000000
#define LEAP_MIN_MM 1.0
/* A way between two ticks is cut into pieces no longer than this, mm, if not too many. */
#define WAY_MM 0.6
#define WAYS_MAX 500
/* A prick without length bleeds like this much of a cut. */
#define PRICK_MM 0.3

/* Half of what is put in: a scalpel's handle, a tube. */
#define HANDLE_HALF_MM 1.5
#define TUBE_HALF_MM 2.0

struct wound *wound_new(const struct incise_chart *chart, struct incise_error *err)
{
	double middle[2] = {chart->size * 0.5, chart->size * 0.5};
	struct wound *wound = calloc(1, sizeof(*wound));
	struct ground_metric metric;

	if (!wound)
		goto no_memory;
	wound->chart = chart;
	wound->size = chart->size;
	wound->tiles = chart->size / CANVAS_TILE;
	wound->texel_mm = 0.1f;
	if (ground_metric(chart, middle, &metric))
		wound->texel_mm = sqrtf(metric.a * metric.c);
	/* From calloc: pages that nobody writes are not there. */
	wound->field = calloc((size_t)chart->size * chart->size, sizeof(*wound->field));
	wound->dirty = calloc((size_t)wound->tiles * wound->tiles, 1);
	wound->points = calloc(WOUND_POINTS, sizeof(*wound->points));
	wound->over = calloc(WOUND_POINTS + 1, sizeof(*wound->over));
	if (wound->field && wound->dirty && wound->points && wound->over)
		return wound;
no_memory:
	wound_free(wound);
	incise_error_set(err, ENOMEM, "view: no memory for the wound");
	return NULL;
}

void wound_free(struct wound *wound)
{
	if (!wound)
		return;
	free(wound->field);
	free(wound->dirty);
	free(wound->points);
	free(wound->over);
	free(wound);
}

/* What was there before of the depth, halfway along a stretch. */
static double cut_before_mm(const struct wound *wound, const struct wound_point *a,
			    const struct wound_point *b)
{
	int x = (int)((a->px[0] + b->px[0]) / 2), y = (int)((a->px[1] + b->px[1]) / 2);
	const struct field_texel *tile;

	if (x < 0 || y < 0 || x >= wound->size || y >= wound->size)
		return 0;
	tile = wound->field +
	       ((size_t)(y / CANVAS_TILE) * wound->tiles + x / CANVAS_TILE) *
		       FIELD_TEXELS;
	return tile[y % CANVAS_TILE * CANVAS_TILE + x % CANVAS_TILE].depth /
	       (double)FIELD_STEPS_MM;
}

/* The tip becomes a point of the line. */
static void push(struct wound *wound, struct wound_stroke *stroke)
{
	const struct wound_point *last = NULL;

	if (wound->tip.joined)
		last = line_point(wound, wound->end - 1);
	*stroke = (struct wound_stroke){
		.from_px = {wound->tip.px[0], wound->tip.px[1]},
		.to_px = {wound->tip.px[0], wound->tip.px[1]},
	};
	if (last) {
		stroke->begins = !last->joined;
		stroke->from_px[0] = last->px[0];
		stroke->from_px[1] = last->px[1];
		stroke->length_mm = wound->tip.arc_mm - last->arc_mm;
	}
	stroke->fresh_mm =
		fmax(wound->tip.depth_mm -
			     cut_before_mm(wound, last ? last : &wound->tip, &wound->tip),
		     0);
	if (wound->end - wound->first == WOUND_POINTS) {
		wound->first++;
		if (wound->settled < wound->first)
			wound->settled = wound->first;
	}
	*line_point(wound, wound->end++) = wound->tip;
	wound->tip.joined = true;
	wound->tip.depth_mm = 0;
	wound->stamps++;
	line_settle(wound, INFINITY, wound->tip.arc_mm - LINE_TAPER_MM);
}

/* The stretches that are not in the fields yet have changed. */
static void mark_tail(struct wound *wound)
{
	struct field_stretch stretch;

	for (uint64_t i = wound->settled; i < wound->end; i++)
		if (line_stretch(wound, line_before(wound, i), line_point(wound, i),
				 wound->tip.arc_mm, &stretch))
			line_mark(wound, &stretch);
	if (wound->cutting && line_stretch(wound, line_before(wound, wound->end),
					   &wound->tip, wound->tip.arc_mm, &stretch))
		line_mark(wound, &stretch);
}

static bool lift(struct wound *wound, struct wound_stroke *stroke)
{
	bool added = false;

	if (!wound->cutting)
		return false;
	mark_tail(wound);
	/* What is left of the way since the last point, or a prick. */
	if (wound->tip.depth_mm > 0) {
		bool prick = wound->tip.arc_mm < PRICK_MM;

		push(wound, stroke);
		if (prick)
			stroke->length_mm = PRICK_MM;
		added = true;
	}
	wound->cutting = false;
	line_settle(wound, wound->tip.arc_mm, INFINITY);
	return added;
}

static float half_mm(double depth_mm)
{
	return (float)(0.20 + 0.13 * depth_mm);
}

/* The blade is in the tissue at this place. */
struct blade {
	double px[2], point_mm[3], depth_mm;
	int64_t t_ns;
	struct ground_metric metric;
};

/* Whether the blade cannot have gone there through the tissue. */
static bool leaps(const struct wound *wound, const struct blade *blade, double *way_mm)
{
	double off[3], dt_s, along_mm;
	int64_t dt_ns;

	if (__builtin_sub_overflow(blade->t_ns, wound->tip_ns, &dt_ns) ||
	    dt_ns > GAP_MAX_NS || dt_ns < 0)
		return true;
	dt_s = (double)dt_ns * 1e-9;
	v3_sub(off, blade->point_mm, wound->tip_mm);
	*way_mm = v3_length(off);
	if (!(*way_mm <= LEAP_MIN_MM + SPEED_MAX_MM_S * dt_s))
		return true;
	/* Over a seam of the texture a short way is a long one in texels. */
	along_mm = ground_length_mm(&blade->metric, blade->px[0] - wound->tip.px[0],
				    blade->px[1] - wound->tip.px[1]);
	return along_mm > LEAP_MIN_MM + 3 * *way_mm;
}

static void place(struct wound *wound, const struct blade *blade)
{
	struct wound_point *tip = &wound->tip;

	tip->px[0] = (float)blade->px[0];
	tip->px[1] = (float)blade->px[1];
	tip->metric = blade->metric;
	tip->depth_mm = fmaxf(tip->depth_mm, (float)blade->depth_mm);
	tip->half_mm = half_mm(tip->depth_mm);
	v3_copy(wound->tip_mm, blade->point_mm);
	wound->tip_ns = blade->t_ns;
}

static void begin(struct wound *wound, const struct blade *blade)
{
	struct wound_stroke none;

	wound->cutting = true;
	wound->tip = (struct wound_point){0};
	place(wound, blade);
	push(wound, &none);
}

/* The tip as a point of the line; or several when it is far, as the taper needs them. */
static void push_way(struct wound *wound, double since_mm, struct wound_stroke *stroke)
{
	const struct wound_point from = *line_point(wound, wound->end - 1),
				 to = wound->tip;
	int n = 1 + (int)fmin(since_mm / WAY_MM, WAYS_MAX);
	struct wound_stroke all = {0};

	for (int i = 1; i <= n; i++) {
		float t = (float)i / (float)n;

		wound->tip = to;
		wound->tip.joined = true;
		for (int k = 0; k < 2; k++)
			wound->tip.px[k] = from.px[k] + t * (to.px[k] - from.px[k]);
		wound->tip.depth_mm = from.depth_mm + t * (to.depth_mm - from.depth_mm);
		wound->tip.half_mm = half_mm(wound->tip.depth_mm);
		wound->tip.arc_mm = from.arc_mm + t * (to.arc_mm - from.arc_mm);
		/* Of a point that is thinned already the depth is less than it was. */
		if (i == n || from.settled) {
			wound->tip.depth_mm = to.depth_mm;
			wound->tip.half_mm = to.half_mm;
		}
		push(wound, stroke);
		if (i == 1)
			all = *stroke;
		else
			all.length_mm += stroke->length_mm;
		all.fresh_mm += (stroke->fresh_mm - all.fresh_mm) / i;
	}
	all.to_px[0] = to.px[0];
	all.to_px[1] = to.px[1];
	*stroke = all;
}

static bool cut(struct wound *wound, const struct blade *blade,
		struct wound_stroke *stroke)
{
	const struct wound_point *last;
	double way_mm = 0, since_mm;
	bool added = false;

	if (!wound->cutting || leaps(wound, blade, &way_mm)) {
		added = lift(wound, stroke);
		begin(wound, blade);
		mark_tail(wound);
		return added;
	}
	wound->cut_mm += way_mm;
	mark_tail(wound);
	place(wound, blade);
	last = line_point(wound, wound->end - 1);
	since_mm = ground_length_mm(&wound->tip.metric, wound->tip.px[0] - last->px[0],
				    wound->tip.px[1] - last->px[1]);
	wound->tip.arc_mm = last->arc_mm + (float)since_mm;
	if (since_mm >= WOUND_SPACING_MM) {
		push_way(wound, since_mm, stroke);
		added = true;
	}
	mark_tail(wound);
	return added;
}

static bool read_blade(const struct wound *wound, const struct incise_tick *tick,
		       struct blade *blade)
{
	if (!(tick->depth_mm >= CUTS_FROM_MM) || !isfinite(tick->depth_mm) ||
	    !v3_finite(tick->proxy_mm) ||
	    !incise_chart_px(wound->chart, tick->proxy_mm, blade->px) ||
	    !ground_metric(wound->chart, blade->px, &blade->metric))
		return false;
	v3_copy(blade->point_mm, tick->proxy_mm);
	blade->depth_mm = fmin(tick->depth_mm, DEPTH_MAX_MM);
	blade->t_ns = tick->t_ns;
	return true;
}

static void insert(struct wound *wound, const struct incise_tick *tick)
{
	wound->inserted = v3_finite(tick->proxy_mm) && isfinite(tick->depth_mm) &&
			  incise_chart_px(wound->chart, tick->proxy_mm, wound->tool_px);
	wound->tool_half_mm =
		tick->tool == INCISE_TOOL_TUBE ? TUBE_HALF_MM : HANDLE_HALF_MM;
	wound->tool_depth_mm = fmin(fmax(tick->depth_mm, 0), DEPTH_MAX_MM);
}

bool wound_tick(struct wound *wound, const struct incise_tick *tick,
		struct wound_stroke *stroke)
{
	bool in = (tick->flags & INCISE_TICK_CONTACT) &&
		  !(tick->flags & (INCISE_TICK_STALE | INCISE_TICK_FAULT));
	struct blade blade;

	wound->inserted = false;
	if (in && tick->phase == INCISE_PHASE_INSERTION)
		insert(wound, tick);
	if (in && tick->phase == INCISE_PHASE_CUTTING &&
	    tick->tool == INCISE_TOOL_BLADE && read_blade(wound, tick, &blade))
		return cut(wound, &blade, stroke);
	return lift(wound, stroke);
}

bool wound_inserted(const struct wound *wound, double px[2], double *depth_mm)
{
	if (!wound->inserted)
		return false;
	px[0] = wound->tool_px[0];
	px[1] = wound->tool_px[1];
	*depth_mm = wound->tool_depth_mm;
	return true;
}

double wound_inside_mm(const struct wound *wound, int x, int y)
{
	const struct field_texel *tile;

	if (x < 0 || y < 0 || x >= wound->size || y >= wound->size)
		return -FIELD_BIAS_MM;
	tile = wound->field +
	       ((size_t)(y / CANVAS_TILE) * wound->tiles + x / CANVAS_TILE) *
		       FIELD_TEXELS;
	return field_inside_mm(&tile[y % CANVAS_TILE * CANVAS_TILE + x % CANVAS_TILE]);
}

double wound_cut_mm(const struct wound *wound)
{
	return wound->cut_mm;
}

uint64_t wound_stamps(const struct wound *wound)
{
	return wound->stamps;
}

int wound_points(const struct wound *wound)
{
	return (int)(wound->end - wound->first);
}

size_t wound_memory(const struct wound *wound)
{
	return sizeof(*wound) +
	       (size_t)wound->size * wound->size * sizeof(*wound->field) +
	       (size_t)wound->tiles * wound->tiles +
	       WOUND_POINTS * (sizeof(*wound->points) + sizeof(*wound->over));
}
