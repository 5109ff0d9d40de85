// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The cuts of an incision; see incise/incision.h for its figure and its rules. A tick takes a bounded
 * time: it looks at each cut a few times, and from each cut that is near at the places along PIECES cuts at most,
 * which a tool of 11 mm makes some 22 places.
 */

#define SPACING N_OF(1, 2) /* of places: INCISE_CUT_SPACING_MM */
#define PLACES 128	   /* INCISE_CUT_PLACES */

/* Half the length of a cut: a longer one goes on as another that is joined. */
#define HALF N(32)

/* The blade returns to a cut within this angle of its direction: cos 30°. */
#define ALONG D_OF(866025404, 1000000000)

/* The skin may curve so far away from the line of a cut, and turn so much: cos 60°. */
#define ABOVE N(5)
#define FACING D_OF(1, 2)

/* A blade farther than this from the line of a cut does not return to it. */
#define BESIDE N(1)

/* Where a cut ends another goes on along its line that turns by less: cos 45°. */
#define GOES_ON D_OF(707106781, 1000000000)

/* A line is followed over so many cuts: along a curve of 5 mm, 11 mm are four. */
#define PIECES 8

/* Two ticks farther apart are no motion of a blade: 10 m/s at 1 kHz. */
#define LEAP N(10)

/* No depth beyond counts. */
#define DEPTH_MOST N(1000)

/* A place of the surface in the frame of a cut. */
struct local {
	num along, across, above;
};

static int place_of(num at)
{
	int64_t place = n_cell(n_add(at, HALF), SPACING);

	return (int)(place < 0 ? 0 : place > PLACES - 1 ? PLACES - 1 : place);
}

static num middle_of(int place)
{
	return n_sub(n_multiple(2 * place + 1, n_half(SPACING)), HALF);
}

static struct local localize(const struct T(cut) *cut, const num at[3])
{
	num off[3];

	v_sub(off, at, cut->at_mm);
	return (struct local){v_along(off, cut->along), v_along(off, cut->side),
			      v_along(off, cut->normal)};
}

static num across_of(const struct T(cut) *cut, const num at[3])
{
	num off[3];

	v_sub(off, at, cut->at_mm);
	return v_along(off, cut->side);
}

/* Whether a place is within @reach of the cut, as seen along its normal. */
static bool reaches(const struct T(cut) *cut, const struct local *at, num reach)
{
	return !n_below(reach, n_abs(at->across)) && !n_below(ABOVE, n_abs(at->above)) &&
	       !n_below(at->along, n_sub(cut->from_mm, reach)) &&
	       !n_below(n_add(cut->to_mm, reach), at->along);
}

static void join(struct T(incision) *incision, int a, int b)
{
	int32_t x = incision->cut[a].incision, y = incision->cut[b].incision;
	int32_t low = x < y ? x : y, high = x < y ? y : x;

	for (int i = 0; i < incision->n && low != high; i++)
		if (incision->cut[i].incision == high)
			incision->cut[i].incision = low;
}

/* Whether the way between two places comes near the cut, or crosses it. */
static bool meets(const struct T(cut) *cut, const num from[3], const num to[3])
{
	num a_across = across_of(cut, from), b_across = across_of(cut, to), part, whole;
	struct local a, b, at;

	/* Most are far to one side: the rest is not looked at. */
	if ((n_below(BESIDE, a_across) && n_below(BESIDE, b_across)) ||
	    (n_below(a_across, -BESIDE) && n_below(b_across, -BESIDE)))
		return false;
	a = localize(cut, from);
	b = localize(cut, to);
	if (reaches(cut, &a, BESIDE) || reaches(cut, &b, BESIDE))
		return true;
	if ((!n_below(a.across, 0) && !n_below(b.across, 0)) ||
	    (!n_below(0, a.across) && !n_below(0, b.across)))
		return false;
	part = n_abs(a.across);
	whole = n_abs(n_sub(a.across, b.across));
	at = (struct local){n_between(a.along, b.along, part, whole), 0,
			    n_between(a.above, b.above, part, whole)};
	return reaches(cut, &at, BESIDE);
}

/* Join the cut that is being made with those that its newest part meets. */
static void check_others(struct T(incision) *incision, const num to[3])
{
	int own = incision->growing;

	for (int i = 0; i < incision->n; i++)
		if (incision->cut[i].incision != incision->cut[own].incision &&
		    meets(&incision->cut[i], incision->checked, to))
			join(incision, own, i);
	v_copy(incision->behind, incision->checked);
	v_copy(incision->checked, to);
}

/* The blade is in this cut from now on; @was keeps the cut as it was before. */
static void come_into(struct T(incision) *incision, int cut)
{
	if (incision->entered && incision->growing == cut)
		return;
	incision->was = incision->cut[cut];
	incision->growing = cut;
	incision->entered = true;
}

/* Start a cut along a direction in the surface. Returns whether there is one more. */
static bool begin_cut(struct T(incision) *incision, const struct T(incision_setup) *setup,
		      const num at[3], const dir along[3], const dir normal[3])
{
	struct T(cut) *cut = &incision->cut[incision->n];

	if (incision->n >= setup->cuts_most)
		return false;
	*cut = (struct T(cut)){.incision = incision->n};
	v_copy(cut->at_mm, at);
	d_copy(cut->normal, normal);
	d_copy(cut->along, along);
	d_cross(cut->side, normal, cut->along);
	/* As many as there are now: it is no earlier one. */
	come_into(incision, incision->n++);
	v_copy(incision->at, at);
	v_copy(incision->checked, at);
	v_copy(incision->behind, at);
	return true;
}

static bool faces(const struct T(cut) *cut, const struct local *here, const dir normal[3])
{
	return n_below(n_abs(here->along), HALF) &&
	       d_below(FACING, d_dot(normal, cut->normal));
}

/* The cut to which a blade of this direction (unit) returns; -1: no cut. */
static int find_cut(const struct T(incision) *incision, const num at[3], const dir way[3],
		    const dir normal[3])
{
	for (int i = 0; i < incision->n; i++) {
		const struct T(cut) *cut = &incision->cut[i];
		struct local here;

		/* Most are far aside: the rest is not looked at. */
		if (n_below(BESIDE, n_abs(across_of(cut, at))))
			continue;
		here = localize(cut, at);
		if (reaches(cut, &here, BESIDE) && faces(cut, &here, normal) &&
		    d_below(ALONG, d_abs(d_dot(way, cut->along))))
			return i;
	}
	return -1;
}

/* The blade is in the current cut: deepen and lengthen it from the last tick's place on. */
static void deepen(struct T(incision) *incision, const num at[3], num depth)
{
	struct T(cut) *cut = &incision->cut[incision->growing];
	num from = localize(cut, incision->at).along, to = localize(cut, at).along;
	num low = n_min(from, to), high = n_max(from, to), way = n_sub(high, low);

	/* A blade that comes back beside an end has cut as far as to it: half of the blade's width. */
	for (int i = place_of(n_min(low, cut->to_mm));
	     i <= place_of(n_max(high, cut->from_mm)); i++) {
		num gone = n_within(n_sub(middle_of(i), low), 0, way), here = depth;

		if (n_below(from, to))
			here = n_between(incision->depth, depth, gone, way);
		else if (n_below(to, from))
			here = n_between(depth, incision->depth, gone, way);
		if (n_below(cut->place[i].depth_mm, n_keep(here)))
			cut->place[i].depth_mm = n_keep(here);
	}
	cut->from_mm = n_min(cut->from_mm, n_max(low, -HALF));
	cut->to_mm = n_max(cut->to_mm, n_min(high, HALF));
}

static bool is_on(const struct T(cut) *cut, const num at[3], const dir normal[3])
{
	struct local here = localize(cut, at);

	return !n_below(BESIDE, n_abs(here.across)) &&
	       !n_below(ABOVE, n_abs(here.above)) && faces(cut, &here, normal);
}

/* The direction in a surface of a way between two places; any direction there if they are equal. */
static void way_along(dir along[3], const num from[3], const num to[3],
		      const dir normal[3])
{
	num off[3];
	dir way[3], side[3] = {0};

	v_sub(off, to, from);
	/* Its side is normal × way; along is side × normal again. */
	if (v_direction(way, off))
		d_cross(side, normal, way);
	T(line_along)(along, normal, side);
}

/* The blade enters: the cut that it returns to, or a new one. */
static bool enter(struct T(incision) *incision, const struct T(incision_setup) *setup,
		  const num at[3], const dir side[3], const dir normal[3], num depth)
{
	dir along[3];
	int there;

	T(line_along)(along, normal, side);
	there = find_cut(incision, at, along, normal);
	if (there >= 0)
		come_into(incision, there);
	else if (!begin_cut(incision, setup, at, along, normal))
		return false;
	v_copy(incision->at, at);
	v_copy(incision->checked, at);
	v_copy(incision->behind, at);
	incision->depth = depth;
	incision->cutting = true;
	if (there < 0)
		check_others(incision, at);
	return true;
}

/* The blade left the line of its cut: another one goes on from the last place. */
static bool turn_away(struct T(incision) *incision, const struct T(incision_setup) *setup,
		      const num at[3], const dir normal[3])
{
	int before = incision->growing, there;
	dir along[3];
	num from[3];

	v_copy(from, incision->at);
	/* Since the last tick the blade went less than a tracker's noise. */
	way_along(along, incision->behind, at, normal);
	there = find_cut(incision, at, along, normal);
	if (there >= 0)
		come_into(incision, there);
	else if (!begin_cut(incision, setup, from, along, normal))
		return false;
	join(incision, incision->growing, before);
	return true;
}

/*
 * Once for each place on the way: join cuts that are met. A cut along the same line goes on, so that no line is there
 * twice.
 */
static void check_at_places(struct T(incision) *incision, const num at[3],
			    const dir normal[3])
{
	int before = incision->growing, there;
	num way[3];

	v_sub(way, at, incision->checked);
	if (n_below(v_length(way), SPACING))
		return;
	check_others(incision, at);
	there = find_cut(incision, at, incision->cut[before].along, normal);
	if (there >= 0 && there < before) {
		come_into(incision, there);
		join(incision, there, before);
	}
}

/*
 * Depth of the cut in which a blade is. Its own cutting does not count before the next contact, or the force of the
 * blade that cuts would be gone.
 */
static num open_depth(const struct T(incision) *incision, const num at[3],
		      const dir normal[3], const dir side[3])
{
	const struct T(cut) *cut;
	struct local here;
	dir along[3];
	int there = incision->growing;

	if (!incision->n)
		return 0;
	T(line_along)(along, normal, side);
	if (!incision->cutting)
		there = find_cut(incision, at, along, normal);
	if (there < 0)
		return 0;
	cut = &incision->cut[there];
	if (incision->entered && there == incision->growing)
		cut = &incision->was;
	here = localize(cut, at);
	if (!reaches(cut, &here, BESIDE) ||
	    !d_below(ALONG, d_abs(d_dot(along, cut->along))))
		return 0;
	return cut->place[place_of(n_within(here.along, cut->from_mm, cut->to_mm))]
		.depth_mm;
}

static bool cut_here(struct T(incision) *incision, const struct T(incision_setup) *setup,
		     const num proxy[3], const dir normal[3], const dir side[3],
		     num depth)
{
	num leap[3];

	if (!n_below(setup->cut_from, depth) || n_below(DEPTH_MOST, depth)) {
		incision->cutting = false;
		return true;
	}
	v_sub(leap, proxy, incision->at);
	if (incision->cutting && n_below(LEAP, v_length(leap)))
		incision->cutting = false;
	if (!incision->cutting) {
		if (!enter(incision, setup, proxy, side, normal, depth))
			return false;
	} else if (!is_on(&incision->cut[incision->growing], proxy, normal) &&
		   !turn_away(incision, setup, proxy, normal)) {
		incision->cutting = false;
		return false;
	}
	deepen(incision, proxy, depth);
	check_at_places(incision, proxy, normal);
	v_copy(incision->at, proxy);
	incision->depth = depth;
	return true;
}

bool T(incision_cut)(struct T(incision) *incision, const struct T(incision_setup) *setup,
		     const num proxy[3], const dir normal[3], const dir side[3],
		     num depth)
{
	bool made = cut_here(incision, setup, proxy, normal, side, depth);

	incision->met.in = false;
	incision->open = open_depth(incision, proxy, normal, side);
	return made;
}

/* --- handle and tube ------------------------------------------------------------------- */

/* Extent across a line. @turned: 1 where the handle's flat side lies across it. */
static num extent_across(const struct T(incision_setup) *setup, enum incise_tool tool,
			 num turned)
{
	if (tool == INCISE_TOOL_TUBE)
		return setup->tube;
	return n_add(setup->handle_thickness,
		     n_times(turned,
			     n_sub(setup->handle_width, setup->handle_thickness)));
}

num T(incision_tightness)(const struct T(incision_setup) *setup,
			  const struct T(opening) *opening, enum incise_tool tool)
{
	num whole = extent_across(setup, tool, N(1));
	num to_open = n_sub(whole, setup->stretch);
	num left = n_sub(to_open, opening->open_mm);

	if (!n_below(0, to_open) || !n_below(0, left))
		return 0;
	return n_within(n_over(left, tool == INCISE_TOOL_TUBE ? whole : to_open), 0,
			N(1));
}

/*
 * Length that a cut needs for a tool: its two lips, stretched, go round it. A tube is round, a handle a
 * rectangle.
 */
static num needed(const struct T(incision_setup) *setup, enum incise_tool tool)
{
	num round = n_add(setup->handle_width, setup->handle_thickness);

	if (tool == INCISE_TOOL_TUBE)
		round = n_times(HALF_PI, setup->tube);
	return n_sub(round, setup->stretch);
}

/*
 * A stretch of a line of cuts, from the tool's place outward: places next to each other, the deeper neighbour
 * first. It is as deep as the shallowest of them, so that no stretch of its length round the tool is deeper.
 *
 *          low ◀─┬──┬──┬──┬──┬──┬──┐            places of one cut
 *      skin ─────┤  │  │  │  │  │  └──┬─▶ high  and, where it ends, of another
 *                └──┤  │  │  │  │  ┌──┘
 *                   └──┤  │  │  ├──┘            depth
 *                      └──┴──┴──┘
 *                         tool
 */
struct end {
	const struct T(cut) *cut;
	int place, step; /* the next one, and the side to which it goes: ±1 */
	num at;		 /* it came so far along the cut */
};

struct stretch {
	struct end end[2];
	int taken[PIECES], n;
	num length, depth;
};

/* Where a place begins along its cut. */
static num edge_of(int place)
{
	return n_sub(n_multiple(place, SPACING), HALF);
}

static bool has_more(const struct end *end)
{
	if (!end->cut)
		return false;
	return end->step < 0 ? end->place >= place_of(end->cut->from_mm)
			     : end->place <= place_of(end->cut->to_mm);
}

/* The length by which a line along @way goes on in a cut, in which it is at @along; @step: to this side. */
static num left_in(const struct T(cut) *cut, const num at[3], const dir way[3],
		   num *along, int *step)
{
	struct local here = localize(cut, at);
	dir turn = d_dot(way, cut->along);

	*along = n_within(here.along, cut->from_mm, cut->to_mm);
	*step = d_below(turn, 0) ? -1 : 1;
	if (!d_below(GOES_ON, d_abs(turn)) || !reaches(cut, &here, BESIDE))
		return 0;
	return *step < 0 ? n_sub(*along, cut->from_mm) : n_sub(cut->to_mm, *along);
}

static bool is_taken(const struct stretch *stretch, int cut)
{
	int i = 0;

	while (i < stretch->n && stretch->taken[i] != cut)
		i++;
	return i < stretch->n;
}

/* Where a cut ends: into the deepest of those that go on along its line. A cut across lends no length. */
static void go_on(const struct T(incision) *incision, struct stretch *stretch,
		  struct end *end)
{
	const struct T(cut) *from = end->cut;
	num at[3], deepest = -N(1);
	dir way[3];

	v_add(at, from->at_mm, end->at, from->along);
	end->cut = NULL;
	for (int i = 0; i < 3; i++)
		way[i] = end->step < 0 ? -from->along[i] : from->along[i];
	for (int i = 0; i < incision->n && stretch->n < PIECES; i++) {
		const struct T(cut) *cut = &incision->cut[i];
		num along, deep;
		int step;

		if (cut->incision != from->incision || is_taken(stretch, i) ||
		    n_below(left_in(cut, at, way, &along, &step), SPACING))
			continue;
		deep = cut->place[place_of(along)].depth_mm;
		if (!n_below(deepest, deep))
			continue;
		deepest = deep;
		*end = (struct end){cut, place_of(along), step, along};
	}
	if (end->cut)
		stretch->taken[stretch->n++] = (int)(end->cut - incision->cut);
}

/* Depth of the next place; below 0: the line ends. */
static num next_depth(const struct T(incision) *incision, struct stretch *stretch,
		      struct end *end)
{
	if (end->cut && !has_more(end))
		go_on(incision, stretch, end);
	return has_more(end) ? (num)end->cut->place[end->place].depth_mm : -N(1);
}

/* Go on by a place as deep as @least; returns whether there is one. */
static bool lengthen(const struct T(incision) *incision, struct stretch *stretch,
		     num least)
{
	num low = next_depth(incision, stretch, &stretch->end[0]);
	num high = next_depth(incision, stretch, &stretch->end[1]), to;
	struct end *end = &stretch->end[n_below(low, high)];

	if (n_below(n_max(low, high), least))
		return false;
	to = n_within(edge_of(end->place + (end->step > 0)), end->cut->from_mm,
		      end->cut->to_mm);
	stretch->length = n_add(stretch->length, n_abs(n_sub(to, end->at)));
	stretch->depth = n_min(stretch->depth, n_max(low, high));
	end->at = to;
	end->place += end->step;
	return true;
}

/* The deepest stretch of a length round a place; whether there is one that is deeper than @least. */
static bool find_stretch(const struct T(incision) *incision, int cut, num along,
			 num length, num least, struct stretch *stretch)
{
	const struct T(cut) *at = &incision->cut[cut];
	int place = place_of(along);
	num low = n_max(edge_of(place), at->from_mm);
	num high = n_min(edge_of(place + 1), at->to_mm);

	*stretch = (struct stretch){
		.end = {{at, place - 1, -1, low}, {at, place + 1, 1, high}},
		.taken = {cut},
		.n = 1,
		.length = n_sub(high, low),
		.depth = at->place[place].depth_mm,
	};
	while (n_below(least, stretch->depth) && n_below(stretch->length, length))
		if (!lengthen(incision, stretch, 0))
			return false;
	return n_below(least, stretch->depth);
}

/* The distance of a place from a cut, beside it or beyond an end. */
static num away_from(const struct T(cut) *cut, const struct local *at)
{
	return n_max(n_abs(at->across),
		     n_max(n_sub(cut->from_mm, at->along), n_sub(at->along, cut->to_mm)));
}

/*
 * The stretch for a tool at a place in a cut that is no farther away than @reach; whether one is deeper than
 * @least.
 */
static bool lets_in(const struct T(incision) *incision, int cut, const num at[3],
		    num reach, num length, num least, struct stretch *stretch)
{
	const struct T(cut) *in = &incision->cut[cut];
	struct local here;

	if (n_below(reach, n_abs(across_of(in, at))))
		return false;
	here = localize(in, at);
	return reaches(in, &here, reach) &&
	       find_stretch(incision, cut, n_within(here.along, in->from_mm, in->to_mm),
			    length, least, stretch);
}

/*
 * The cut that lets a tool in the deepest, among the cuts as near as the nearest that does, within the width of a
 * line: where cuts cross, a tool goes into that. -1: no cut does.
 */
static int deepest_cut(const struct T(incision) *incision, const num at[3], num reach,
		       num length, struct stretch *stretch)
{
	num nearest = reach;
	int best = -1;

	for (int i = 0; i < incision->n; i++) {
		struct local here;

		if (!lets_in(incision, i, at, nearest, length, 0, stretch))
			continue;
		here = localize(&incision->cut[i], at);
		nearest = n_within(away_from(&incision->cut[i], &here), 0, nearest);
	}
	nearest = n_min(n_add(nearest, BESIDE), reach);
	stretch->depth = 0;
	for (int i = 0; i < incision->n; i++) {
		struct stretch here;

		if (!lets_in(incision, i, at, nearest, length, stretch->depth, &here))
			continue;
		best = i;
		*stretch = here;
	}
	return best;
}

void T(incision_find)(const struct T(incision) *incision,
		      const struct T(incision_setup) *setup, enum incise_tool tool,
		      const num at[3], struct T(opening) *opening)
{
	num width = tool == INCISE_TOOL_TUBE ? setup->tube : setup->handle_width;
	struct stretch stretch;
	const struct T(cut) *cut;
	int in = deepest_cut(incision, at, n_half(width), needed(setup, tool), &stretch);

	*opening = (struct T(opening)){0};
	if (in < 0)
		return;
	/* As far as it is so deep. */
	while (lengthen(incision, &stretch, stretch.depth))
		;
	cut = &incision->cut[in];
	opening->in = true;
	opening->cut = in;
	opening->at_mm = n_within(localize(cut, at).along, cut->from_mm, cut->to_mm);
	opening->depth_mm = stretch.depth;
	opening->open_mm = cut->place[place_of(opening->at_mm)].open_mm;
	opening->length_mm = stretch.length;
	d_copy(opening->along, cut->along);
}

void T(incision_open)(struct T(incision) *incision, const struct T(incision_setup) *setup,
		      enum incise_tool tool, const num proxy[3], const dir flat[3],
		      num depth)
{
	struct T(opening) *met = &incision->met;
	num turned, length, made;
	struct T(cut) *cut;

	incision->cutting = false;
	met->in = false;
	if (n_below(depth, 0) || n_below(DEPTH_MOST, depth))
		return;
	T(incision_find)(incision, setup, tool, proxy, met);
	if (!met->in)
		return;
	cut = &incision->cut[met->cut];
	turned = n_share_of(d_dot(flat, cut->along));
	length = extent_across(setup, tool, n_sub(N(1), turned));
	made = n_sub(n_min(depth, extent_across(setup, tool, turned)), setup->stretch);
	if (!n_below(met->open_mm, made))
		return;
	for (int i = place_of(cut->from_mm); i <= place_of(cut->to_mm); i++) {
		num beyond = n_abs(n_sub(middle_of(i), met->at_mm)), open;

		/* Beyond the tool a cut closes by half a millimetre for each along. */
		beyond = n_max(n_sub(beyond, n_half(length)), 0);
		open = n_sub(made, n_half(beyond));
		if (n_below(cut->place[i].open_mm, n_keep(open)))
			cut->place[i].open_mm = n_keep(open);
	}
}

void T(incision_leave)(struct T(incision) *incision)
{
	incision->cutting = false;
	incision->met.in = false;
}
