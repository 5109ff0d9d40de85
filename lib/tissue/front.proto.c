// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The front of a cut: tissue that takes work and does not give more of it back. Cutting force laws such
 * as Song et al.'s, F(depth, speed), describe a blade that advances. This adds the way back.
 *
 *   force                        c  the model's force: the blade cuts, the front moves with it
 *     |          ____c           u  elastic: the tissue unloads with the stiffness K over
 *     |     _,-'    /               (c + f)/K, and loads again along the same line
 *     |  ,-'      u/         /   f  friction of the open cut, against the motion
 *     | /         /        u/    e  elastic again, from the front on
 *   0 |/________ /___f____,/___▶ depth
 *     |         ´‾‾‾‾‾‾‾‾‾  f
 *
 * In the terms of plasticity it is a stop: force = K (depth - rest), held to -f … upper by moving
 * `rest`; upper is the model's force c at the front, f in the open cut, and rises with K in between.
 * Work is only lost where rest moves, so that any closed motion takes work. Fracture on the way in,
 * small elastic unloading and friction on the way out: Mahvash and Hayward, Haptic rendering of
 * cutting, Haptics-e 2(3), 2001; Okamura, Simone and O'Leary, Force modeling for needle insertion, IEEE
 * Trans. Biomed. Eng. 51(10), 2004; Chanthasopeephan, Desai and Lau, Modeling soft-tissue deformation
 * prior to cutting, IEEE Trans. Biomed. Eng. 54(3), 2007.
 *
 * A blade that moves along the skin meets new tissue at each mm, which the front has not reached: front
 * and rest come up by as much, as long as the elastic energy stays below the work that was put in since
 * the blade entered, a sixteenth of which is never given back. So they do where a texture lets the model's force
 * rise on the way of the front, to all of that force at once. Back within its own cut it meets nothing
 * new. The cuts that it left before stay as well: as deep as the front was when it left them.
 */

/* Below this the blade lies flat on the surface, and its cut has no direction. */
#define FLAT D_OF(1, 1000)

/* A blade so far beside the line of its cut is in new tissue: half the width of a blade. */
#define BESIDE N(1)

/* A force of this share of the model's follows a rise of its texture. */
#define NEAR N_OF(3, 4)

/* Share of the shorter of two ways across each other in their length: to 8 %. */
#define ASIDE N_OF(53, 128)

/* --- line --- */

void T(line_along)(dir along[3], const dir normal[3], const dir side[3])
{
	dir across[3], axis[3] = {0};
	int least = 0;

	d_cross(across, side, normal);
	if (d_unit(along, across, FLAT))
		return;
	/* Any direction in the surface: across the axis that is least along the normal. */
	for (int i = 1; i < 3; i++)
		if (d_below(d_abs(normal[i]), d_abs(normal[least])))
			least = i;
	axis[least] = D_ONE;
	d_cross(across, axis, normal);
	for (int i = 0; i < 3; i++)
		along[i] = i ? 0 : D_ONE;
	d_unit(along, across, FLAT);
}

static void begin_line(struct T(line) *line, const num at[3], const dir normal[3],
		       const dir side[3])
{
	*line = (struct T(line)){.there = true};
	v_copy(line->at, at);
	d_copy(line->side, side);
	T(line_along)(line->along, normal, side);
}

static num place_along(const struct T(line) *line, const num at[3])
{
	num off[3];

	v_sub(off, at, line->at);
	return v_along(off, line->along);
}

static void off_line(num off[3], const struct T(line) *line, const num at[3])
{
	num s = n_within(place_along(line, at), line->from, line->to);

	v_sub(off, at, line->at);
	v_add(off, off, n_neg(s), line->along);
}

/* Whether a point of the surface lies beside the line, or nearer. */
static bool holds(const struct T(line) *line, const num at[3])
{
	num off[3];

	if (!line->there)
		return false;
	off_line(off, line, at);
	return v_is_short(off, BESIDE);
}

static bool is_nearer(const struct T(line) *a, const struct T(line) *b, const num at[3])
{
	num from_a[3], from_b[3];

	off_line(from_a, a, at);
	off_line(from_b, b, at);
	return n_below(v_length(from_a), v_length(from_b));
}

/* --- front --- */

/* The cut that the front leaves stays as it is. */
static void keep(struct T(front) *front)
{
	if (!front->line.there)
		return;
	front->n = front->n ? front->n : 1;
	front->kept[front->in].line = front->line;
	front->kept[front->in].cut = front->cut;
	front->kept[front->in].way = front->way;
}

static void begin_cut_of(struct T(front) *front, const num at[3], const dir normal[3],
			 const dir side[3])
{
	front->newest =
		front->n < T_FRONT_CUTS ? front->n : (front->newest + 1) % T_FRONT_CUTS;
	front->n = front->n < T_FRONT_CUTS ? front->n + 1 : front->n;
	front->in = front->newest;
	begin_line(&front->line, at, normal, side);
}

bool T(front_enter)(struct T(front) *front, const num at[3], const dir normal[3],
		    const dir side[3])
{
	int there = -1;

	keep(front);
	for (int i = 0; i < front->n; i++) {
		const struct T(line) *line = &front->kept[i].line;

		if (holds(line, at) &&
		    (there < 0 || is_nearer(line, &front->kept[there].line, at)))
			there = i;
	}
	/* The work of an earlier visit pays for nothing now. */
	front->depth = front->force = front->rest = front->cut = 0;
	front->work2 = front->most2 = 0;
	front->rises = front->climbs = false;
	if (there < 0) {
		begin_cut_of(front, at, normal, side);
		front->way = (struct T(way)){.number = front->begun++};
		return true;
	}
	front->in = there;
	front->line = front->kept[there].line;
	front->cut = front->kept[there].cut;
	front->way = front->kept[there].way;
	return false;
}

/* Length of the line with the way to its side, which add up from line to line of a straight way. */
static inline num length_of(const struct T(front) *front)
{
	const struct T(line) *line = &front->line;
	num along = n_sub(line->to, line->from),
	    aside = n_abs(v_along(front->off, line->side));

	return n_add(n_max(along, aside), n_times(ASIDE, n_min(along, aside)));
}

num T(front_advance)(struct T(front) *front, const num at[3], const dir normal[3],
		     const dir side[3])
{
	struct T(line) *line = &front->line;
	num length = n_sub(line->to, line->from), s = place_along(line, at);

	line->from = n_min(line->from, s);
	line->to = n_max(line->to, s);
	off_line(front->off, line, at);
	if (line->there && v_is_short(front->off, BESIDE))
		return n_sub(n_sub(line->to, line->from), length);
	/* It left the line sideways; a curved skin does that too. The cut goes on from here. */
	keep(front);
	front->way.before += w_of(length_of(front));
	begin_cut_of(front, at, normal, side);
	front->off[0] = front->off[1] = front->off[2] = 0;
	return BESIDE;
}

bool T(front_way)(struct T(front) *front, num depth)
{
	wide way = front->way.before + w_of(n_add(length_of(front), n_max(depth, 0)));

	if (!(front->way.most < way))
		return false;
	front->way.most = way;
	return true;
}

num T(front_force)(struct T(front) *front, num unloading, num friction, num depth,
		   num advance, num cutting)
{
	num K = n_max(unloading, LEAST), rubs, upper, elastic, trial, force, way;
	bool climbs = front->rises && front->climbs;

	depth = n_max(depth, 0);
	advance = n_max(advance, 0);
	cutting = n_max(cutting, 0);
	rubs = n_times(n_within(friction, 0, N(1)), cutting);
	way = n_sub(depth, front->depth);
	front->cut = n_max(n_sub(front->cut, advance), 0);
	elastic = n_times(K, n_sub(depth, front->rest));
	front->rest = n_sub(front->rest, advance);
	trial = force = n_times(K, n_sub(depth, front->rest));
	upper = n_max(rubs, n_times(K, n_sub(depth, front->cut)));
	if (climbs || n_below(0, advance)) {
		wide work2 = w_work(front->work2, front->force,
				    n_max(elastic, n_neg(rubs)), way);
		/* Elastic energy is F²/2K. Nothing pulls with more than the friction. */
		num most = n_max(elastic, w_paid(K, work2, front->most2));

		force = climbs ? most : n_min(trial, most);
		upper = climbs ? cutting : upper;
	}
	force = n_max(n_neg(rubs), n_min(force, n_min(upper, cutting)));
	/* Else the line stays to the bit, and no rounding adds up. */
	if (n_below(force, trial) || n_below(trial, force))
		front->rest = n_sub(depth, n_over(force, K));
	/* The blade cuts where all of the model's force acts. */
	if (!n_below(force, cutting))
		front->cut = n_max(front->cut, n_sub(depth, n_over(cutting, K)));
	if (climbs)
		front->cut = n_min(front->cut, n_max(n_sub(depth, n_over(force, K)), 0));
	front->climbs = climbs || !n_below(force, n_times(NEAR, cutting));
	front->work2 = w_work(front->work2, front->force, force, way);
	front->most2 = front->work2 > front->most2 ? front->work2 : front->most2;
	front->depth = depth;
	front->force = force;
	return force;
}
