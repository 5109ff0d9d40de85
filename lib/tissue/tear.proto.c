// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Tissue that a blade tears as it is drawn along its edge: a spring K holds the edge at the tip of the cut until it
 * pulls with J, work of fracture per area, times the depth that is uncut there; then the tip goes with the blade. So
 * a cut takes J for each area of it, and gives back the work of the spring.
 *
 *     skin ──┬──────┬──┬──────┬─── along   force = K (s - tip), no more than J (d - D)
 *            │ torn │▒ tip    s            d: depth of the blade
 *       ─────┘  D   └──┴      ▼ d          D: of the tip's place, half a millimetre: as deep as the tip left it, or 0;
 *                                             of the part ▒ of it that is torn now as deep as that is
 *
 * A blade that goes aside tears a line beside the last, 2 mm away; one that was torn holds it within 1 mm and 30° of
 * its direction.
 */

/* The line through a place and along a direction: a torn line, or a new one. Returns whether it is reversed. */
static bool take_line(struct T(tears) *tears, const num from[3], num s,
		      const dir along[3], const dir normal[3])
{
	num at[3], off[3], across[3];
	struct T(line) *line;

	v_add(at, from, s, along);
	for (int i = 0; i < tears->n; i++) {
		line = &tears->kept[i].line;
		off_line(off, line, at);
		v_across(across, off, normal);
		tears->in = i;
		if (v_is_short(across, BESIDE) &&
		    d_below(ALONG, d_abs(d_dot(along, line->along))))
			return d_below(d_dot(along, line->along), 0);
	}
	tears->in = tears->newest =
		tears->n < T_FRONT_CUTS ? tears->n++ : (tears->newest + 1) % T_FRONT_CUTS;
	tears->kept[tears->in] = (struct T(tear)){.line = {.from = -HALF, .to = HALF}};
	v_copy(tears->kept[tears->in].line.at, from);
	d_copy(tears->kept[tears->in].line.along, along);
	return false;
}

/* Move the tip towards @s, place by place. @gives: the spring's stretch at most, by uncut depth. */
static void tear(struct T(tears) *tears, num s, num depth, num gives)
{
	int step = n_below(s, tears->tip) ? -1 : 1;
	num *torn = &tears->torn[step > 0], *before = &tears->torn[step < 0];
	num tip = n_multiple(step, tears->tip), goal = n_multiple(step, s), next;

	for (; n_below(tip, goal); tip = next) {
		int k = place_of(tip);
		stored *deep =
			&tears->kept[tears->in].depth[step < 0 ? PLACES - 1 - k : k];
		bool again = n_below(tip, *torn);
		num border = k < PLACES - 1 ? edge_of(k + 1) : goal;
		num open = again ? n_max(*deep, tears->depth) : *deep;
		num most = n_sub(goal, n_times(gives, n_max(n_sub(depth, open), 0)));

		if (!n_below(tip, most))
			break;
		next = n_min(most, again ? *torn : border);
		if (!again) {
			/* As it comes there: a place is as deep as where the tip left it. */
			tears->depth = n_between(tears->depth, depth, n_sub(next, tip),
						 n_sub(most, tip));
			*torn = next;
		}
		if (n_below(next, border))
			continue;
		if (n_below(*deep, n_keep(tears->depth)) &&
		    !n_below(edge_of(k), n_neg(*before)))
			*deep = n_keep(tears->depth);
		*torn = next;
		*before = n_neg(next);
	}
	tears->tip = n_multiple(step, tip);
}

void T(stage_fracture)(const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	struct T(tears) *tears = &state->tears;
	struct T(line) *line = &tears->kept[tears->in].line;
	num at[3], off[3], s = 0, stretch = 0, aside = N(2);
	dir along[3], across[3];

	if (tick->phase != INCISE_PHASE_CUTTING || !n_below(0, plan->numbers.fracture))
		return;
	if (state->proxy.began) {
		v_copy(at, state->p0);
		T(line_along)(along, state->entry, state->side);
	} else {
		d_copy(along, line->along);
		s = place_along(line, tick->tool);
		stretch = n_sub(s, tears->tip);
		d_cross(across, state->entry, along);
		v_sub(off, tick->tool, line->at);
		aside = v_along(off, across);
		v_add(at, line->at, n_below(aside, 0) ? -N(2) : N(2), across);
	}
	/* More than half of the way to the next line: noise does not take it back. */
	if (n_below(N_OF(3, 2), n_abs(aside))) {
		if (take_line(tears, at, s, along, state->entry))
			stretch = n_neg(stretch);
		line = &tears->kept[tears->in].line;
		s = place_along(line, tick->tool);
		tears->tip = tears->torn[1] = n_sub(s, stretch);
		tears->torn[0] = n_neg(tears->tip);
	}
	tear(tears, s, state->depth, plan->numbers.gives);
	v_add(state->force, state->force,
	      n_neg(n_times(plan->numbers.fracture, n_sub(s, tears->tip))), line->along);
}
