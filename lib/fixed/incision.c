// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The cuts of an incision in integers; see incision.h and lib/tissue/incision.c, whose steps these
 * are.
 */
#include "incision.h"
#include "line.h"
#include "vector.h"

#define MM (1 << 16)

/* Half the length of a cut: a longer one goes on as another that is joined. */
#define HALF (INCISE_FIXED_CUT_PLACES * INCISE_FIXED_CUT_SPACING / 2)

/* The blade returns to a cut within this angle of its direction: cos 30°, Q30. */
#define ALONG 929887697

/* The skin may curve so far away from the line of a cut, and turn so much: cos 60°. */
#define ABOVE (5 * MM)
#define FACING (INCISE_FIXED_UNIT / 2)

/* Two ticks farther apart are no motion of a blade. */
#define LEAP (10 * MM)

/* π/2, Q16. */
#define HALF_ROUND 102944

/* A place of the surface in the frame of a cut. */
struct local {
	int32_t along, across, above;
};

bool incise_fixed_incision_good(const struct incise_fixed_incision_setup *setup)
{
	const int32_t *length = &setup->cut_from;

	for (int i = 0; i < 5; i++)
		if (length[i] < 0 || length[i] > INCISE_FIXED_DEPTH_MAX)
			return false;
	return setup->cuts_most >= 0 && setup->cuts_most <= INCISE_FIXED_CUTS_MAX;
}

static int32_t size(int32_t v)
{
	return v < 0 ? -v : v;
}

static int place_of(int32_t at)
{
	return (int)incise_fx_within(((int64_t)at + HALF) / INCISE_FIXED_CUT_SPACING -
					     (at + (int64_t)HALF < 0),
				     0, INCISE_FIXED_CUT_PLACES - 1);
}

static int64_t middle_of(int place)
{
	return (2 * place + 1) * (INCISE_FIXED_CUT_SPACING / 2) - (int64_t)HALF;
}

static struct local localize(const struct incise_fixed_cut *cut, const int32_t at[3])
{
	int32_t off[3];

	incise_fx_sub(off, at, cut->at);
	return (struct local){incise_fx_along(off, cut->along),
			      incise_fx_along(off, cut->side),
			      incise_fx_along(off, cut->normal)};
}

/* Whether a place is within @reach of the cut, as seen along its normal. */
static bool reaches(const struct incise_fixed_cut *cut, const struct local *at,
		    int32_t reach)
{
	return size(at->across) <= reach && size(at->above) <= ABOVE &&
	       at->along >= (int64_t)cut->from - reach &&
	       at->along <= (int64_t)cut->to + reach;
}

static void join(struct incise_fixed_incision *incision, int a, int b)
{
	int32_t x = incision->cut[a].incision, y = incision->cut[b].incision;
	int32_t low = x < y ? x : y, high = x < y ? y : x;

	for (int i = 0; i < incision->n && low != high; i++)
		if (incision->cut[i].incision == high)
			incision->cut[i].incision = low;
}

/* a + share × (b - a), share = part / whole in 0 … 1. */
static int32_t between(int32_t a, int32_t b, int64_t part, int64_t whole)
{
	/* 2^32 · 2^16, with a share of 16 bits: of places a blade's width apart */
	int64_t share = div64_s64(part * (1 << 16), whole);

	return incise_fx_hold32(a + incise_fx_rounded(((int64_t)b - a) * share, 16));
}

/* Whether the way between two places comes near the cut, or crosses it. */
static bool meets(const struct incise_fixed_cut *cut, const int32_t from[3],
		  const int32_t to[3])
{
	struct local a = localize(cut, from), b = localize(cut, to), at;
	int64_t whole = (int64_t)a.across - b.across;

	if (reaches(cut, &a, INCISE_FIXED_BESIDE) ||
	    reaches(cut, &b, INCISE_FIXED_BESIDE))
		return true;
	if ((a.across >= 0 && b.across >= 0) || (a.across <= 0 && b.across <= 0))
		return false;
	at = (struct local){between(a.along, b.along, a.across, whole), 0,
			    between(a.above, b.above, a.across, whole)};
	return reaches(cut, &at, INCISE_FIXED_BESIDE);
}

/* Join the cut that is being made with those that its newest part meets. */
static void check_others(struct incise_fixed_incision *incision, const int32_t to[3])
{
	int own = incision->growing;

	for (int i = 0; i < incision->n; i++)
		if (incision->cut[i].incision != incision->cut[own].incision &&
		    meets(&incision->cut[i], incision->checked, to))
			join(incision, own, i);
	incise_fx_copy(incision->behind, incision->checked);
	incise_fx_copy(incision->checked, to);
}

/* Start a cut along a direction in the surface. Returns whether there is one more. */
static bool begin(struct incise_fixed_incision *incision,
		  const struct incise_fixed_incision_setup *setup, const int32_t at[3],
		  const int32_t along[3], const int32_t normal[3])
{
	struct incise_fixed_cut *cut = &incision->cut[incision->n];

	if (incision->n >= setup->cuts_most)
		return false;
	*cut = (struct incise_fixed_cut){.incision = incision->n};
	incise_fx_copy(cut->at, at);
	incise_fx_copy(cut->normal, normal);
	incise_fx_copy(cut->along, along);
	incise_fx_cross(cut->side, normal, cut->along);
	incision->growing = incision->n++;
	incise_fx_copy(incision->at, at);
	incise_fx_copy(incision->checked, at);
	incise_fx_copy(incision->behind, at);
	return true;
}

/* The cut to which a blade of this direction (unit) returns; -1: none. */
static int find(const struct incise_fixed_incision *incision, const int32_t at[3],
		const int32_t way[3], const int32_t normal[3])
{
	for (int i = 0; i < incision->n; i++) {
		const struct incise_fixed_cut *cut = &incision->cut[i];
		struct local here = localize(cut, at);

		if (reaches(cut, &here, INCISE_FIXED_BESIDE) && size(here.along) < HALF &&
		    incise_fx_dot(normal, cut->normal) > FACING &&
		    size(incise_fx_dot(way, cut->along)) > ALONG)
			return i;
	}
	return -1;
}

/* The blade is in the current cut: deepen and lengthen it from the last tick's place on. */
static void deepen(struct incise_fixed_incision *incision, const int32_t at[3],
		   int32_t depth)
{
	struct incise_fixed_cut *cut = &incision->cut[incision->growing];
	int32_t from = localize(cut, incision->at).along;
	int32_t to = localize(cut, at).along;
	int32_t low = from < to ? from : to, high = from < to ? to : from;

	for (int i = place_of(low); i <= place_of(high); i++) {
		int64_t way = (int64_t)high - low;
		int64_t gone = incise_fx_within(middle_of(i) - low, 0, way);
		int32_t here = depth;

		if (from < to)
			here = between(incision->depth, depth, gone, way);
		else if (from > to)
			here = between(depth, incision->depth, gone, way);
		if (here > cut->place[i].depth)
			cut->place[i].depth = here;
	}
	low = low < -HALF ? -HALF : low;
	high = high > HALF ? HALF : high;
	cut->from = low < cut->from ? low : cut->from;
	cut->to = high > cut->to ? high : cut->to;
}

static bool is_on(const struct incise_fixed_cut *cut, const int32_t at[3],
		  const int32_t normal[3])
{
	struct local here = localize(cut, at);

	return size(here.across) <= INCISE_FIXED_BESIDE && size(here.along) < HALF &&
	       size(here.above) <= ABOVE && incise_fx_dot(normal, cut->normal) > FACING;
}

/* The direction in a surface of a way between two places; any there for none. */
static void way_along(int32_t along[3], const int32_t from[3], const int32_t to[3],
		      const int32_t normal[3])
{
	int32_t off[3], across[3], side[3] = {0};
	int64_t wide[3];

	incise_fx_sub(off, to, from);
	for (int i = 0; i < 3; i++)
		wide[i] = off[i];
	/* Its side is normal × way; along is side × normal again. */
	if (incise_fx_unit(across, wide, 3, 0))
		incise_fx_cross(side, normal, across);
	incise_fixed_line_along(along, normal, side);
}

/* The blade enters: the cut that it returns to, or a new one. */
static bool enter(struct incise_fixed_incision *incision,
		  const struct incise_fixed_incision_setup *setup, const int32_t at[3],
		  const int32_t side[3], const int32_t normal[3], int32_t depth)
{
	int32_t along[3];
	int there;

	incise_fixed_line_along(along, normal, side);
	there = find(incision, at, along, normal);
	if (there >= 0)
		incision->growing = there;
	else if (!begin(incision, setup, at, along, normal))
		return false;
	incise_fx_copy(incision->at, at);
	incise_fx_copy(incision->checked, at);
	incise_fx_copy(incision->behind, at);
	incision->depth = depth;
	incision->cutting = true;
	if (there < 0)
		check_others(incision, at);
	return true;
}

/* The blade left the line of its cut: another one goes on from the last place. */
static bool turn(struct incise_fixed_incision *incision,
		 const struct incise_fixed_incision_setup *setup, const int32_t at[3],
		 const int32_t normal[3])
{
	int before = incision->growing, there;
	int32_t along[3], from[3];

	incise_fx_copy(from, incision->at);
	/* Since the last tick it went less than what a tracker's noise is. */
	way_along(along, incision->behind, at, normal);
	there = find(incision, at, along, normal);
	if (there >= 0)
		incision->growing = there;
	else if (!begin(incision, setup, from, along, normal))
		return false;
	join(incision, incision->growing, before);
	return true;
}

/*
 * Once for each place on the way: join cuts that are met. One that runs along the same line is gone
 * on with, so that no line is there twice.
 */
static void check_at_places(struct incise_fixed_incision *incision, const int32_t at[3],
			    const int32_t normal[3])
{
	int before = incision->growing, there;
	int32_t way[3];

	incise_fx_sub(way, at, incision->checked);
	if (incise_fx_length(way) < INCISE_FIXED_CUT_SPACING)
		return;
	check_others(incision, at);
	there = find(incision, at, incision->cut[before].along, normal);
	if (there >= 0 && there < before) {
		incision->growing = there;
		join(incision, there, before);
	}
}

bool incise_fixed_incision_cut(struct incise_fixed_incision *incision,
			       const struct incise_fixed_incision_setup *setup,
			       const int32_t proxy[3], const int32_t normal[3],
			       const int32_t side[3], int32_t depth)
{
	int32_t leap[3];

	incision->met.in = false;
	if (depth <= setup->cut_from || depth > INCISE_FIXED_DEPTH_MAX) {
		incision->cutting = false;
		return true;
	}
	incise_fx_sub(leap, proxy, incision->at);
	if (incision->cutting && incise_fx_length(leap) > LEAP)
		incision->cutting = false;
	if (!incision->cutting) {
		if (!enter(incision, setup, proxy, side, normal, depth))
			return false;
	} else if (!is_on(&incision->cut[incision->growing], proxy, normal) &&
		   !turn(incision, setup, proxy, normal)) {
		incision->cutting = false;
		return false;
	}
	deepen(incision, proxy, depth);
	check_at_places(incision, proxy, normal);
	incise_fx_copy(incision->at, proxy);
	incision->depth = depth;
	return true;
}

/* --- handle and tube ------------------------------------------------------------------- */

/* Extent across a line. @turned, Q16: 1 where the handle's flat side lies across it. */
static int32_t extent_across(const struct incise_fixed_incision_setup *setup,
			     enum incise_tool tool, int32_t turned)
{
	if (tool == INCISE_TOOL_TUBE)
		return setup->tube;
	return setup->handle_thickness +
	       incise_fx_times(turned,
			       (int64_t)setup->handle_width - setup->handle_thickness);
}

int32_t incise_fixed_incision_tightness(const struct incise_fixed_incision_setup *setup,
					const struct incise_fixed_opening *opening,
					enum incise_tool tool)
{
	int32_t whole = extent_across(setup, tool, MM);
	int32_t to_open = whole - setup->stretch;
	int64_t left = (int64_t)to_open - opening->open;

	if (to_open <= 0 || left <= 0)
		return 0;
	whole = tool == INCISE_TOOL_TUBE ? whole : to_open;
	return (int32_t)incise_fx_within(incise_fx_quotient((int32_t)left, whole), 0, MM);
}

/* Length that a cut needs for a tool: its two lips, stretched, go round it. */
static int32_t needed(const struct incise_fixed_incision_setup *setup,
		      enum incise_tool tool)
{
	return (tool == INCISE_TOOL_TUBE
			? incise_fx_times(HALF_ROUND, setup->tube)
			: setup->handle_width + setup->handle_thickness) -
	       setup->stretch;
}

static int64_t length_of(const struct incise_fixed_incision *incision, int32_t number)
{
	int64_t length = 0;

	for (int i = 0; i < incision->n; i++)
		if (incision->cut[i].incision == number)
			length += (int64_t)incision->cut[i].to - incision->cut[i].from;
	return length;
}

/* Distance aside of the nearest cut within reach; above @reach: there is none. */
static int64_t nearest(const struct incise_fixed_incision *incision, const int32_t at[3],
		       int32_t reach)
{
	int64_t best = (int64_t)reach + 1;

	for (int i = 0; i < incision->n; i++) {
		struct local here = localize(&incision->cut[i], at);

		if (reaches(&incision->cut[i], &here, reach) && size(here.across) < best)
			best = size(here.across);
	}
	return best;
}

static int32_t along_of(const struct incise_fixed_cut *cut, const int32_t at[3])
{
	return (int32_t)incise_fx_within(localize(cut, at).along, cut->from, cut->to);
}

/* Of those that are as near, within the width of a line: where cuts cross, a tool goes into it. */
static int deepest(const struct incise_fixed_incision *incision, const int32_t at[3],
		   int32_t reach)
{
	int64_t most = nearest(incision, at, reach);
	int32_t depth = -1;
	int best = -1;

	for (int i = 0; most <= reach && i < incision->n; i++) {
		const struct incise_fixed_cut *cut = &incision->cut[i];
		struct local here = localize(cut, at);
		int32_t deep;

		if (size(here.across) > most + INCISE_FIXED_BESIDE ||
		    !reaches(cut, &here, reach))
			continue;
		deep = cut->place[place_of(along_of(cut, at))].depth;
		if (deep > depth) {
			best = i;
			depth = deep;
		}
	}
	return best;
}

static void find_opening(const struct incise_fixed_incision *incision,
			 const struct incise_fixed_incision_setup *setup,
			 enum incise_tool tool, const int32_t at[3],
			 struct incise_fixed_opening *opening)
{
	int32_t width = tool == INCISE_TOOL_TUBE ? setup->tube : setup->handle_width;
	int in = deepest(incision, at, width / 2), place;
	const struct incise_fixed_cut *cut;

	*opening = (struct incise_fixed_opening){0};
	if (in < 0)
		return;
	cut = &incision->cut[in];
	if (length_of(incision, cut->incision) < needed(setup, tool))
		return;
	opening->in = true;
	opening->cut = in;
	opening->at = along_of(cut, at);
	place = place_of(opening->at);
	opening->depth = cut->place[place].depth;
	opening->open = cut->place[place].open;
	incise_fx_copy(opening->along, cut->along);
}

void incise_fixed_incision_open(struct incise_fixed_incision *incision,
				const struct incise_fixed_incision_setup *setup,
				enum incise_tool tool, const int32_t proxy[3],
				const int32_t flat[3], int32_t depth)
{
	struct incise_fixed_opening *met = &incision->met;
	int32_t turned, extent, length, made;
	struct incise_fixed_cut *cut;

	incision->cutting = false;
	met->in = false;
	if (depth < 0 || depth > INCISE_FIXED_DEPTH_MAX)
		return;
	find_opening(incision, setup, tool, proxy, met);
	if (!met->in)
		return;
	cut = &incision->cut[met->cut];
	turned = (int32_t)incise_fx_within(
		incise_fx_rounded(size(incise_fx_dot(flat, cut->along)), 14), 0, MM);
	extent = extent_across(setup, tool, turned);
	length = extent_across(setup, tool, MM - turned);
	made = (depth < extent ? depth : extent) - setup->stretch;
	if (made <= met->open)
		return;
	for (int i = place_of(cut->from); i <= place_of(cut->to); i++) {
		int64_t beyond = middle_of(i) - met->at, open;

		beyond = (beyond < 0 ? -beyond : beyond) - length / 2;
		/* Beyond the tool a cut closes by half a millimetre for each along. */
		open = made - (beyond > 0 ? beyond / 2 : 0);
		if (open > cut->place[i].open)
			cut->place[i].open = (int32_t)open;
	}
}

void incise_fixed_incision_leave(struct incise_fixed_incision *incision)
{
	incision->cutting = false;
	incision->met.in = false;
}
