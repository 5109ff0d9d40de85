// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The cuts of an incision; see incise/incision.h. All memory is allocated at the start.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "incision.h"

/* Half the length of a cut: a longer one goes on as another that is joined. */
#define HALF_MM (INCISE_CUT_PLACES * INCISE_CUT_SPACING_MM / 2)

/* The blade returns to a cut within this angle of its direction: cos 30°. */
#define ALONG 0.866

/* The skin may curve so far away from the line of a cut, and turn so much: cos 60°. */
#define ABOVE_MM 5.0
#define FACING 0.5

/* Two ticks farther apart are no motion of a blade: 10 m/s at 1 kHz. */
#define LEAP_MM 10.0

/* Values beyond are no place and no depth. */
#define PLACE_MOST_MM 1e6
#define DEPTH_MOST_MM 1e3

/* Beyond the tool that opens it, a cut closes by so much for each mm along. */
#define TAPER 0.5

struct incise_incision {
	struct incise_incision_setup setup;
	/* The blade is in a cut: */
	bool cutting;
	int current;
	double at_mm[3], depth_mm; /* of the last tick */
	double checked_mm[3];	   /* up to here, for other cuts that it meets */
	double behind_mm[3];	   /* the place before that: a way that is no noise */
	struct incise_opening met; /* of handle or tube at this tick */
	int n;
	struct incise_cut cut[]; /* setup.cuts_most */
};

/* A place of the surface in the frame of a cut. */
struct local {
	double along_mm, across_mm, above_mm;
};

struct incise_incision *incise_incision_make(const struct incise_incision_setup *setup,
					     struct incise_error *err)
{
	size_t cuts = (size_t)setup->cuts_most * sizeof(struct incise_cut);
	struct incise_incision *incision = calloc(1, sizeof(*incision) + cuts);

	if (!incision) {
		incise_error_set(err, ENOMEM, "no memory for an incision of %d cuts",
				 setup->cuts_most);
		return NULL;
	}
	incision->setup = *setup;
	return incision;
}

void incise_incision_free(struct incise_incision *incision)
{
	free(incision);
}

void incise_incision_clear(struct incise_incision *incision)
{
	incision->n = 0;
	incision->cutting = incision->met.in = false;
}

bool incise_incision_add(struct incise_incision *incision, const struct incise_cut *cut)
{
	if (incision->n >= incision->setup.cuts_most)
		return false;
	incision->cut[incision->n++] = *cut;
	return true;
}

size_t incise_incision_memory(const struct incise_incision *incision)
{
	return sizeof(*incision) +
	       (size_t)incision->setup.cuts_most * sizeof(*incision->cut);
}

int incise_incision_cuts(const struct incise_incision *incision)
{
	return incision->n;
}

const struct incise_cut *incise_incision_cut(const struct incise_incision *incision,
					     int i)
{
	return i >= 0 && i < incision->n ? &incision->cut[i] : NULL;
}

int incise_cut_place(double at_mm)
{
	double place = floor((at_mm + HALF_MM) / INCISE_CUT_SPACING_MM);

	return (int)fmin(fmax(place, 0), INCISE_CUT_PLACES - 1);
}

double incise_incision_length_mm(const struct incise_incision *incision, int number)
{
	double length_mm = 0;

	for (int i = 0; i < incision->n; i++)
		if (incision->cut[i].incision == number)
			length_mm += incision->cut[i].to_mm - incision->cut[i].from_mm;
	return length_mm;
}

static struct local localize(const struct incise_cut *cut, const double at_mm[3])
{
	double off[3];

	v3_sub(off, at_mm, cut->at_mm);
	return (struct local){v3_dot(off, cut->along), v3_dot(off, cut->side),
			      v3_dot(off, cut->normal)};
}

static double across(const struct incise_cut *cut, const double at_mm[3])
{
	double off[3];

	v3_sub(off, at_mm, cut->at_mm);
	return v3_dot(off, cut->side);
}

/* Whether a place is within @reach_mm of the cut, as seen along its normal. */
static bool reaches(const struct incise_cut *cut, const struct local *at, double reach_mm)
{
	return fabs(at->across_mm) <= reach_mm && fabs(at->above_mm) <= ABOVE_MM &&
	       at->along_mm >= cut->from_mm - reach_mm &&
	       at->along_mm <= cut->to_mm + reach_mm;
}

static void join(struct incise_incision *incision, int a, int b)
{
	int x = incision->cut[a].incision, y = incision->cut[b].incision;
	int low = x < y ? x : y, high = x < y ? y : x;

	for (int i = 0; i < incision->n && low != high; i++)
		if (incision->cut[i].incision == high)
			incision->cut[i].incision = low;
}

/* Whether the way between two places comes near the cut, or crosses it. */
static bool meets(const struct incise_cut *cut, const double from_mm[3],
		  const double to_mm[3])
{
	struct local a = localize(cut, from_mm), b = localize(cut, to_mm), at = b;
	double share;

	if (reaches(cut, &a, INCISE_CUT_BESIDE_MM) ||
	    reaches(cut, &b, INCISE_CUT_BESIDE_MM))
		return true;
	if (a.across_mm * b.across_mm >= 0)
		return false;
	share = a.across_mm / (a.across_mm - b.across_mm);
	at = (struct local){a.along_mm + share * (b.along_mm - a.along_mm), 0,
			    a.above_mm + share * (b.above_mm - a.above_mm)};
	return reaches(cut, &at, INCISE_CUT_BESIDE_MM);
}

/* Join the cut that is being made with those that its newest part meets. */
static void check_others(struct incise_incision *incision, const double to_mm[3])
{
	int own = incision->current;

	for (int i = 0; i < incision->n; i++)
		if (incision->cut[i].incision != incision->cut[own].incision &&
		    meets(&incision->cut[i], incision->checked_mm, to_mm))
			join(incision, own, i);
	v3_copy(incision->behind_mm, incision->checked_mm);
	v3_copy(incision->checked_mm, to_mm);
}

/* The part of @way in the surface; else any direction there. Never fails for a unit normal. */
static void set_frame(struct incise_cut *cut, const double way[3], const double normal[3])
{
	double along[3];

	v3_copy(cut->normal, normal);
	v3_add(along, way, -v3_dot(way, normal), normal);
	if (!v3_unit(cut->along, along, 1e-3))
		v3_any_across(cut->along, normal);
	v3_cross(cut->side, normal, cut->along);
}

/* Start a cut. @way: its direction. Returns whether there is one more. */
static bool begin(struct incise_incision *incision, const double at_mm[3],
		  const double way[3], const double normal[3])
{
	struct incise_cut *cut = &incision->cut[incision->n];

	if (incision->n >= incision->setup.cuts_most)
		return false;
	*cut = (struct incise_cut){.incision = incision->n};
	v3_copy(cut->at_mm, at_mm);
	set_frame(cut, way, normal);
	incision->current = incision->n++;
	v3_copy(incision->at_mm, at_mm);
	v3_copy(incision->checked_mm, at_mm);
	v3_copy(incision->behind_mm, at_mm);
	return true;
}

/* The cut to which a blade of this direction returns; -1: none. */
static int find(const struct incise_incision *incision, const double at_mm[3],
		const double way[3], const double normal[3])
{
	for (int i = 0; i < incision->n; i++) {
		const struct incise_cut *cut = &incision->cut[i];
		struct local at = localize(cut, at_mm);

		if (reaches(cut, &at, INCISE_CUT_BESIDE_MM) &&
		    fabs(at.along_mm) < HALF_MM && v3_dot(normal, cut->normal) > FACING &&
		    fabs(v3_dot(way, cut->along)) > ALONG * v3_length(way))
			return i;
	}
	return -1;
}

/* The blade is in the current cut: deepen and lengthen it from the last tick's place on. */
static void deepen(struct incise_incision *incision, const double at_mm[3],
		   double depth_mm)
{
	struct incise_cut *cut = &incision->cut[incision->current];
	double from = localize(cut, incision->at_mm).along_mm;
	double to = localize(cut, at_mm).along_mm, way = to - from;
	int first = incise_cut_place(fmin(from, to));
	int last = incise_cut_place(fmax(from, to));

	for (int i = first; i <= last; i++) {
		double middle = (i + 0.5) * INCISE_CUT_SPACING_MM - HALF_MM;
		double share = way != 0 ? fmax(0, fmin((middle - from) / way, 1)) : 1;
		double here_mm =
			incision->depth_mm + share * (depth_mm - incision->depth_mm);

		cut->place[i].depth_mm = fmaxf(cut->place[i].depth_mm, (float)here_mm);
	}
	cut->from_mm = fmin(cut->from_mm, fmax(fmin(from, to), -HALF_MM));
	cut->to_mm = fmax(cut->to_mm, fmin(fmax(from, to), HALF_MM));
}

static bool is_on(const struct incise_cut *cut, const double at_mm[3],
		  const double normal[3])
{
	struct local at = localize(cut, at_mm);

	return fabs(at.across_mm) <= INCISE_CUT_BESIDE_MM &&
	       fabs(at.along_mm) < HALF_MM && fabs(at.above_mm) <= ABOVE_MM &&
	       v3_dot(normal, cut->normal) > FACING;
}

/* The blade enters: the cut that it returns to, or a new one. */
static bool enter(struct incise_incision *incision, const double at_mm[3],
		  const double way[3], const double normal[3], double depth_mm)
{
	int there = find(incision, at_mm, way, normal);

	if (there >= 0)
		incision->current = there;
	else if (!begin(incision, at_mm, way, normal))
		return false;
	v3_copy(incision->at_mm, at_mm);
	v3_copy(incision->checked_mm, at_mm);
	v3_copy(incision->behind_mm, at_mm);
	incision->depth_mm = depth_mm;
	incision->cutting = true;
	if (there < 0)
		check_others(incision, at_mm);
	return true;
}

/* The blade left the line of its cut: another one goes on from the last place. */
static bool turn(struct incise_incision *incision, const double at_mm[3],
		 const double normal[3])
{
	int before = incision->current;
	double way[3], from_mm[3];
	int there;

	v3_copy(from_mm, incision->at_mm);
	/* Since the last tick it went less than what a tracker's noise is. */
	v3_sub(way, at_mm, incision->behind_mm);
	there = find(incision, at_mm, way, normal);
	if (there >= 0)
		incision->current = there;
	else if (!begin(incision, from_mm, way, normal))
		return false;
	join(incision, incision->current, before);
	return true;
}

/*
 * Once for each place on the way: join cuts that are met. One that runs along the same line is gone
 * on with, so that no line is there twice.
 */
static void check_at_places(struct incise_incision *incision, const double at_mm[3],
			    const double normal[3])
{
	int before = incision->current, there;
	double way[3];

	v3_sub(way, at_mm, incision->checked_mm);
	if (v3_length(way) < INCISE_CUT_SPACING_MM)
		return;
	check_others(incision, at_mm);
	there = find(incision, at_mm, incision->cut[before].along, normal);
	if (there >= 0 && there < before) {
		incision->current = there;
		join(incision, there, before);
	}
}

static bool cut_to(struct incise_incision *incision, const struct incise_tick *tick)
{
	const double *at_mm = tick->proxy_mm, *normal = tick->normal;
	double side[3], way[3], leap[3];

	v3_sub(leap, at_mm, incision->at_mm);
	if (incision->cutting && v3_length(leap) > LEAP_MM)
		incision->cutting = false;
	if (!incision->cutting) {
		v3_rotate(side, tick->quaternion, incision->setup.side);
		v3_cross(way, side, normal);
		if (!enter(incision, at_mm, way, normal, tick->depth_mm))
			return false;
	} else if (!is_on(&incision->cut[incision->current], at_mm, normal) &&
		   !turn(incision, at_mm, normal)) {
		incision->cutting = false;
		return false;
	}
	deepen(incision, at_mm, tick->depth_mm);
	check_at_places(incision, at_mm, normal);
	v3_copy(incision->at_mm, at_mm);
	incision->depth_mm = tick->depth_mm;
	return true;
}

/* --- handle and tube ------------------------------------------------------------------- */

/* Extent across a line, mm. @turned: 1 where the handle's flat side lies across it. */
static double extent_across_mm(const struct incise_incision *incision,
			       enum incise_tool tool, double turned)
{
	const struct incise_incision_setup *setup = &incision->setup;

	if (tool == INCISE_TOOL_TUBE)
		return setup->tube_mm;
	return setup->handle_thickness_mm +
	       turned * (setup->handle_width_mm - setup->handle_thickness_mm);
}

double incise_incision_tightness(const struct incise_incision *incision,
				 const struct incise_opening *opening,
				 enum incise_tool tool)
{
	double size_mm = extent_across_mm(incision, tool, 1);
	double to_open_mm = size_mm - incision->setup.stretch_mm;
	double left_mm = fmax(to_open_mm - opening->open_mm, 0);

	if (!(to_open_mm > 0))
		return 0;
	return left_mm / (tool == INCISE_TOOL_TUBE ? size_mm : to_open_mm);
}

/*
 * Length that a cut needs for a tool: its two lips, stretched, go round it. A tube is round, a
 * handle a rectangle.
 */
static double needed_mm(const struct incise_incision *incision, enum incise_tool tool)
{
	const struct incise_incision_setup *setup = &incision->setup;

	return (tool == INCISE_TOOL_TUBE
			? M_PI / 2 * setup->tube_mm
			: setup->handle_width_mm + setup->handle_thickness_mm) -
	       setup->stretch_mm;
}

/* Distance aside of the nearest cut within reach; infinite: there is none. */
static double nearest_mm(const struct incise_incision *incision, const double at_mm[3],
			 double reach_mm)
{
	double best_mm = INFINITY;

	for (int i = 0; i < incision->n; i++) {
		double aside_mm = fabs(across(&incision->cut[i], at_mm));
		struct local at;

		/* Most are far aside: the rest is not looked at. */
		if (aside_mm > reach_mm)
			continue;
		at = localize(&incision->cut[i], at_mm);
		if (!reaches(&incision->cut[i], &at, reach_mm))
			continue;
		best_mm = fmin(best_mm, aside_mm);
	}
	return best_mm;
}

static double place_along(const struct incise_cut *cut, const double at_mm[3])
{
	return fmax(cut->from_mm, fmin(localize(cut, at_mm).along_mm, cut->to_mm));
}

/* Of those that are as near, within the width of a line: where cuts cross, a tool goes into it. */
static int deepest(const struct incise_incision *incision, const double at_mm[3],
		   double reach_mm)
{
	double most_mm = nearest_mm(incision, at_mm, reach_mm);
	float depth_mm = -1;
	int best = -1;

	for (int i = 0; isfinite(most_mm) && i < incision->n; i++) {
		const struct incise_cut *cut = &incision->cut[i];
		struct local at;
		float here_mm;

		if (fabs(across(cut, at_mm)) > most_mm + INCISE_CUT_BESIDE_MM)
			continue;
		at = localize(cut, at_mm);
		if (!reaches(cut, &at, reach_mm))
			continue;
		here_mm = cut->place[incise_cut_place(place_along(cut, at_mm))].depth_mm;
		if (here_mm > depth_mm) {
			best = i;
			depth_mm = here_mm;
		}
	}
	return best;
}

void incise_incision_opening(const struct incise_incision *incision,
			     enum incise_tool tool, const double at_mm[3],
			     struct incise_opening *opening)
{
	const struct incise_incision_setup *setup = &incision->setup;
	double width_mm =
		tool == INCISE_TOOL_TUBE ? setup->tube_mm : setup->handle_width_mm;
	int in = deepest(incision, at_mm, width_mm / 2), place;

	*opening = (struct incise_opening){0};
	if (in < 0)
		return;
	opening->length_mm =
		incise_incision_length_mm(incision, incision->cut[in].incision);
	opening->in = opening->length_mm >= needed_mm(incision, tool);
	if (!opening->in)
		return;
	opening->cut = in;
	opening->at_mm = place_along(&incision->cut[in], at_mm);
	place = incise_cut_place(opening->at_mm);
	opening->depth_mm = incision->cut[in].place[place].depth_mm;
	opening->open_mm = incision->cut[in].place[place].open_mm;
	v3_copy(opening->along, incision->cut[in].along);
}

/* A handle or tube at this tick opens the cut that it is in. */
static void widen(struct incise_incision *incision, const struct incise_tick *tick)
{
	const struct incise_incision_setup *setup = &incision->setup;
	const struct incise_opening *met = &incision->met;
	double flat[3], turned, extent_mm, along_mm, made_mm;
	struct incise_cut *cut;

	incise_incision_opening(incision, tick->tool, tick->proxy_mm, &incision->met);
	if (!met->in)
		return;
	cut = &incision->cut[met->cut];
	v3_rotate(flat, tick->quaternion, setup->side);
	turned = fmin(fabs(v3_dot(flat, cut->along)), 1);
	extent_mm = extent_across_mm(incision, tick->tool, turned);
	along_mm = extent_across_mm(incision, tick->tool, 1 - turned);
	made_mm = fmin(tick->depth_mm, extent_mm) - setup->stretch_mm;
	if (!(made_mm > met->open_mm))
		return;
	for (int i = incise_cut_place(cut->from_mm); i <= incise_cut_place(cut->to_mm);
	     i++) {
		double middle = (i + 0.5) * INCISE_CUT_SPACING_MM - HALF_MM;
		double beyond = fabs(middle - met->at_mm) - along_mm / 2;
		double open_mm = made_mm - TAPER * fmax(beyond, 0);

		cut->place[i].open_mm = fmaxf(cut->place[i].open_mm, (float)open_mm);
	}
}

/* In the tissue with numbers that a hand can have. */
static bool counts(const struct incise_tick *tick)
{
	double turned = 0;

	for (int i = 0; i < 3; i++)
		if (!(fabs(tick->proxy_mm[i]) <= PLACE_MOST_MM))
			return false;
	for (int i = 0; i < 4; i++)
		turned += tick->quaternion[i] * tick->quaternion[i];
	/* Unit vectors, but for rounding. */
	return fabs(turned - 1) < 1e-3 &&
	       fabs(v3_dot(tick->normal, tick->normal) - 1) < 1e-3 &&
	       tick->depth_mm >= 0 && tick->depth_mm <= DEPTH_MOST_MM;
}

const struct incise_opening *incise_incision_met(const struct incise_incision *incision)
{
	return &incision->met;
}

bool incise_incision_tick(struct incise_incision *incision,
			  const struct incise_tick *tick)
{
	bool cuts = tick->phase == INCISE_PHASE_CUTTING && counts(tick) &&
		    tick->depth_mm > incision->setup.cut_from_mm;

	incision->met.in = false;
	if (!cuts)
		incision->cutting = false;
	if (cuts)
		return cut_to(incision, tick);
	if (tick->phase == INCISE_PHASE_INSERTION && counts(tick))
		widen(incision, tick);
	return true;
}
