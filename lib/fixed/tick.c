// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A tick of a plan in integers: the stages of lib/scene in their order; see plan.h. Where a stage is
 * not plain, its counterpart in lib/scene/stages.c and forces.c has the reasons.
 */
#include "arithmetic.h"
#include "plan.h"
#include "spring.h"

#define ONE (1 << 16)

/* sin of the angle to either side within which a scalpel stays what it was: 0.2. */
#define UNDECIDED 214748365

/* From here on the tube counts as nearer. */
#define NEARER (5 * ONE)

/* Of the force, in one tick: ticks are to be at least ten in a ramp. */
#define RISE_MOST (((int64_t)1 << 30) / 10)
#define GAIN_ONE ((int64_t)1 << 30)

/* A sum of normals this short is nothing but rounding. */
#define VANISHED 64

/* --- poses ------------------------------------------------------------------------------ */

void incise_fixed_plan_begin(const struct incise_fixed_plan *plan,
			     struct incise_fixed_state *state)
{
	*state = (struct incise_fixed_state){.held = INCISE_TOOL_BLADE};
	state->wanted = plan->numbers.inserts ? INCISE_TOOL_AUTO : INCISE_TOOL_BLADE;
	incise_fixed_predict_init(&state->scalpel);
	incise_fixed_predict_init(&state->handle);
	incise_fixed_predict_init(&state->tube);
	for (int i = 0; i < plan->numbers.n_axes; i++)
		state->place[i] = plan->numbers.axes[i].rest;
	if (plan->surface)
		plan->surface->restart(plan->surface->context);
}

/* from + length × (a vector turned by q) */
static void reach_out(int32_t to[3], const int32_t from[3], const int32_t q[4],
		      const int32_t arm[3])
{
	int32_t turned[3];

	incise_fx_rotate(turned, q, arm);
	for (int i = 0; i < 3; i++)
		to[i] = incise_fx_hold32((int64_t)from[i] + turned[i]);
}

static enum incise_fixed_pose_answer add_pose(struct incise_fixed_predict *p,
					      const struct incise_fixed_filter *filter,
					      const int32_t position[3],
					      const int32_t quaternion[4], int64_t t_ns)
{
	if (incise_fixed_predict_add(p, filter, position, quaternion, t_ns))
		return INCISE_FIXED_POSE_TAKEN;
	if (t_ns >= 0 && p->started && t_ns - filter->latency_ns <= p->t_ns)
		return INCISE_FIXED_POSE_OLD;
	return INCISE_FIXED_POSE_FAR;
}

static enum incise_fixed_pose_answer take_scalpel(
	const struct incise_fixed_numbers *numbers, struct incise_fixed_state *state,
	const struct incise_fixed_pose *pose, int64_t t_ns)
{
	enum incise_fixed_pose_answer answer;
	int32_t q[4], tip[3], along[3], end[3];

	/* One that is none leaves the attitude as it was. */
	if (!incise_fixed_attitude(q, pose->quaternion))
		for (int i = 0; i < 4; i++)
			q[i] = state->scalpel.q[i];
	reach_out(tip, pose->position, q, numbers->tip);
	answer = add_pose(&state->scalpel, &numbers->filter, tip, q, t_ns);
	if (answer != INCISE_FIXED_POSE_TAKEN || !numbers->inserts)
		return answer;
	/*
	 * The handle's end is predicted by itself. It cannot be found from the tip's prediction:
	 * the attitude is not extrapolated.
	 */
	incise_fx_rotate(along, state->scalpel.q, numbers->axis);
	incise_fx_add(end, tip, numbers->handle, along);
	incise_fixed_predict_add(&state->handle, &numbers->filter, end, q, t_ns);
	return answer;
}

enum incise_fixed_pose_answer incise_fixed_plan_pose(const struct incise_fixed_plan *plan,
						     struct incise_fixed_state *state,
						     const struct incise_fixed_pose *pose,
						     int64_t now_ns)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;
	/* A timestamp from the future would keep all later poses out. */
	int64_t t_ns = pose->t_ns > now_ns ? now_ns : pose->t_ns;
	uint32_t tool = pose->tool & INCISE_FIXED_POSE_TOOL;

	if (pose->tool & ~INCISE_FIXED_POSE_KNOWN || tool > INCISE_TOOL_TUBE)
		return INCISE_FIXED_POSE_UNKNOWN;
	if (pose->tool & INCISE_FIXED_POSE_TUBE && !numbers->tube)
		return INCISE_FIXED_POSE_UNKNOWN;
	state->fading = !!(pose->tool & INCISE_FIXED_POSE_FADE);
	if (numbers->inserts)
		state->wanted = (int32_t)tool;
	if (!pose->quaternion[0] && !pose->quaternion[1] && !pose->quaternion[2] &&
	    !pose->quaternion[3])
		return INCISE_FIXED_POSE_NONE;
	if (!(pose->tool & INCISE_FIXED_POSE_TUBE))
		return take_scalpel(numbers, state, pose, t_ns);
	return add_pose(&state->tube, &numbers->filter, pose->position, pose->quaternion,
			t_ns);
}

/* --- predict and tool ------------------------------------------------------------------- */

static bool is_stale(const struct incise_fixed_plan *plan,
		     const struct incise_fixed_predict *p, int64_t t_ns)
{
	return incise_fixed_predict_age(p, t_ns) > plan->numbers.pose_age_ns;
}

void incise_fixed_stage_predict(const struct incise_fixed_plan *plan,
				struct incise_fixed_state *state,
				struct incise_fixed_tick *tick)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;

	tick->age_ns = incise_fixed_predict_age(&state->scalpel, tick->t_ns);
	if (tick->age_ns > numbers->pose_age_ns)
		tick->flags |= INCISE_TICK_STALE;
	incise_fixed_predict_at(&state->scalpel, &numbers->filter, tick->t_ns,
				tick->position, state->velocity);
	incise_fixed_predict_attitude(&state->scalpel, &numbers->filter, tick->t_ns,
				      state->attitude);
	for (int i = 0; i < 4; i++)
		tick->attitude[i] = state->attitude[i];
	incise_fx_rotate(state->flat, state->attitude, numbers->side);
	incise_fx_copy(tick->tool, tick->position);
	tick->speed = incise_fx_hold32(incise_fx_length(state->velocity));
	tick->held = state->held;
}

/* Whether another tool is wanted than the held one, without a look at the scalpel's turn. */
static bool waits(const struct incise_fixed_state *state)
{
	if (state->wanted == INCISE_TOOL_AUTO)
		return (state->held == INCISE_TOOL_TUBE) != !!state->tube_nearer;
	return state->wanted != state->held;
}

static bool is_zero(const int32_t v[3])
{
	return !v[0] && !v[1] && !v[2];
}

/* Whether the tool that is held stays: in the tissue it does until the force has faded. */
static bool keeps_tool(struct incise_fixed_state *state)
{
	bool faded = state->gain <= 0 && is_zero(state->last);

	state->changing = state->proxy.touching && waits(state);
	return state->proxy.touching && !(state->changing && faded);
}

static int64_t above(const struct incise_fixed_plan *plan, const int32_t place[3])
{
	struct incise_fixed_touch touch;

	if (plan->surface)
		return plan->surface->above(plan->surface->context, place);
	if (!incise_fixed_shape_nearest(&plan->numbers.shape, &plan->grid, place,
					plan->numbers.up, &touch))
		return INT32_MAX;
	return -(int64_t)touch.depth;
}

/* A height above the surface, between two numbers. */
struct height {
	int64_t low, high;
};

/* Since the surface was searched a height changed by no more than the end went. */
static struct height height_of(const struct incise_fixed_above *last,
			       const int32_t end[3])
{
	int32_t way[3];
	int64_t went = INT32_MAX;

	incise_fx_sub(way, end, last->end);
	if (last->known)
		went = incise_fx_length(way) + 1; /* its rounding */
	return (struct height){last->above - went, last->above + went};
}

static int64_t less(int64_t a, int64_t b)
{
	return a < b ? a : b;
}

/* The surface is only searched where what is known of the heights does not decide it. */
static bool is_tube_nearer(const struct incise_fixed_plan *plan,
			   struct incise_fixed_state *state,
			   const struct incise_fixed_tick *tick)
{
	const struct incise_fixed_filter *filter = &plan->numbers.filter;
	bool tube_held = state->held == INCISE_TOOL_TUBE, searched = false;
	/* Of how much a tube that is nearer stays below the scalpel. */
	int64_t nearer = tube_held ? -NEARER : NEARER;
	int32_t end[INCISE_FIXED_ENDS][3], velocity[3];

	incise_fx_copy(end[INCISE_FIXED_TIP], tick->position);
	incise_fixed_predict_at(&state->handle, filter, tick->t_ns,
				end[INCISE_FIXED_HANDLE], velocity);
	incise_fixed_predict_at(&state->tube, filter, tick->t_ns, end[INCISE_FIXED_TUBE],
				velocity);
	for (;;) {
		struct height h[INCISE_FIXED_ENDS];
		int64_t low, high;

		for (int i = 0; i < INCISE_FIXED_ENDS; i++)
			h[i] = height_of(&state->above[i], end[i]);
		low = less(h[INCISE_FIXED_TIP].low, h[INCISE_FIXED_HANDLE].low);
		high = less(h[INCISE_FIXED_TIP].high, h[INCISE_FIXED_HANDLE].high);
		if (h[INCISE_FIXED_TUBE].high + nearer < low)
			return true;
		if (h[INCISE_FIXED_TUBE].low + nearer > high || searched)
			return tube_held && searched &&
			       h[INCISE_FIXED_TUBE].low + nearer <= high;
		for (int i = 0; i < INCISE_FIXED_ENDS; i++) {
			state->above[i].known = true;
			state->above[i].above = above(plan, end[i]);
			incise_fx_copy(state->above[i].end, end[i]);
		}
		searched = true;
	}
}

/* One of the two stations that is silent is far away, also in the tissue. */
static bool find_tube(const struct incise_fixed_plan *plan,
		      struct incise_fixed_state *state,
		      const struct incise_fixed_tick *tick)
{
	bool tube_stale = is_stale(plan, &state->tube, tick->t_ns);
	bool stale = tick->flags & INCISE_TICK_STALE, keeps;

	if (tube_stale)
		state->tube_nearer = false;
	else if (stale)
		state->tube_nearer = true;
	keeps = keeps_tool(state);
	if (!keeps && state->wanted == INCISE_TOOL_AUTO && !tube_stale && !stale)
		state->tube_nearer = is_tube_nearer(plan, state, tick);
	return keeps;
}

static int32_t by_place(const struct incise_fixed_plan *plan,
			const struct incise_fixed_state *state)
{
	int32_t axis[3], up;

	if (state->tube_nearer)
		return INCISE_TOOL_TUBE;
	incise_fx_rotate(axis, state->attitude, plan->numbers.axis);
	up = incise_fx_dot(axis, plan->numbers.up);
	if (up > UNDECIDED)
		return INCISE_TOOL_BLADE;
	if (up < -UNDECIDED)
		return INCISE_TOOL_HANDLE;
	return state->held == INCISE_TOOL_TUBE ? INCISE_TOOL_BLADE : state->held;
}

static void choose_tool(const struct incise_fixed_plan *plan,
			struct incise_fixed_state *state)
{
	int32_t before = state->held;

	state->held =
		state->wanted == INCISE_TOOL_AUTO ? by_place(plan, state) : state->wanted;
	if (state->held == before)
		return;
	/* The way from the end of one to that of the other is no motion. */
	state->proxy = (struct incise_fixed_proxy){0};
	if (plan->surface)
		plan->surface->restart(plan->surface->context);
	state->gain = 0;
	state->changing = false;
}

void incise_fixed_stage_tool(const struct incise_fixed_plan *plan,
			     struct incise_fixed_state *state,
			     struct incise_fixed_tick *tick)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;

	if (!numbers->inserts)
		return;
	if (!(numbers->tube ? find_tube(plan, state, tick) : keeps_tool(state)))
		choose_tool(plan, state);
	tick->held = state->held;
	if (state->held == INCISE_TOOL_HANDLE)
		incise_fixed_predict_at(&state->handle, &numbers->filter, tick->t_ns,
					tick->tool, state->velocity);
	if (state->held == INCISE_TOOL_TUBE && numbers->tube) {
		/* The attitude stays the scalpel's. */
		incise_fixed_predict_at(&state->tube, &numbers->filter, tick->t_ns,
					tick->tool, state->velocity);
		tick->age_ns = incise_fixed_predict_age(&state->tube, tick->t_ns);
		tick->flags &= ~(uint32_t)INCISE_TICK_STALE;
		if (tick->age_ns > numbers->pose_age_ns)
			tick->flags |= INCISE_TICK_STALE;
	}
}

/* --- contact ---------------------------------------------------------------------------- */

static void contact_begins(struct incise_fixed_state *state, int64_t t_ns)
{
	state->touched_ns = t_ns;
	incise_fx_copy(state->p0, state->proxy.first.point);
	incise_fx_copy(state->sn, state->proxy.first.normal);
	if (state->held == INCISE_TOOL_BLADE)
		incise_fx_copy(state->side, state->flat);
	state->average.n = state->average.at = 0;
	for (int i = 0; i < 3; i++)
		state->average.sum[i] = 0;
}

static bool is_stale_tick(const struct incise_fixed_tick *tick)
{
	return tick->flags & INCISE_TICK_STALE;
}

void incise_fixed_stage_contact(const struct incise_fixed_plan *plan,
				struct incise_fixed_state *state,
				struct incise_fixed_tick *tick)
{
	struct incise_fixed_proxy *proxy = &state->proxy;

	/* The last force stays, and fades. */
	if (is_stale_tick(tick))
		return;
	for (int i = 0; i < 3; i++)
		state->force[i] = 0;
	if (plan->surface)
		plan->surface->move(plan->surface->context, tick->tool, proxy);
	else
		incise_fixed_proxy_move(proxy, &plan->numbers.shape, &plan->grid,
					plan->numbers.leave, tick->tool);
	state->depth = 0;
	if (!proxy->touching)
		return;
	if (proxy->began)
		contact_begins(state, tick->t_ns);
	incise_fx_copy(state->sn, proxy->touch.normal);
	incise_fx_copy(state->normal, state->sn);
	state->depth = proxy->touch.depth > 0 ? proxy->touch.depth : 0;
	tick->flags |= INCISE_TICK_CONTACT;
	tick->phase = state->held == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
						       : INCISE_PHASE_INSERTION;
	tick->depth = state->depth;
	incise_fx_copy(tick->proxy, proxy->touch.point);
	incise_fx_copy(tick->normal, state->normal);
}

/* Bhasin et al.'s Snavg. Sums of integers are exact: nothing adds up. */
void incise_fixed_stage_normal(const struct incise_fixed_plan *plan,
			       struct incise_fixed_state *state,
			       struct incise_fixed_tick *tick)
{
	int32_t n = plan->numbers.average_ticks, *place;

	if (n < 2 || tick->phase == INCISE_PHASE_FREE)
		return;
	place = state->average.ring[state->average.at];
	for (int i = 0; i < 3; i++) {
		if (state->average.n == n)
			state->average.sum[i] -= place[i];
		state->average.sum[i] += state->sn[i];
		place[i] = state->sn[i];
	}
	state->average.n += state->average.n < n;
	state->average.at = state->average.at + 1 < n ? state->average.at + 1 : 0;
	incise_fx_unit(state->normal, state->average.sum, 3, VANISHED);
	incise_fx_copy(tick->normal, state->normal);
}

/* An instrument meets the opening as it was when it went in: it makes the way easier for the next. */
void incise_fixed_stage_incision(const struct incise_fixed_plan *plan,
				 struct incise_fixed_state *state,
				 struct incise_fixed_tick *tick)
{
	const struct incise_fixed_incision_setup *setup = &plan->numbers.incision;
	struct incise_fixed_incision *cuts = &state->incision;
	bool inserts = tick->phase == INCISE_PHASE_INSERTION;

	if (!plan->numbers.inserts)
		return;
	if (tick->phase == INCISE_PHASE_FREE)
		incise_fixed_incision_leave(cuts);
	else if (inserts)
		incise_fixed_incision_open(cuts, setup, (enum incise_tool)state->held,
					   tick->proxy, state->flat, state->depth);
	else if (!incise_fixed_incision_cut(cuts, setup, tick->proxy, state->normal,
					    state->flat, state->depth))
		tick->flags |= INCISE_TICK_FULL;
	if (inserts && (state->proxy.began || !state->opening.in)) {
		state->opening = cuts->met;
		state->tightness = incise_fixed_incision_tightness(
			setup, &state->opening, (enum incise_tool)state->held);
	} else if (!inserts && !is_stale_tick(tick)) {
		state->opening.in = false;
	}
	if (inserts && state->opening.in)
		tick->flags |= INCISE_TICK_IN_CUT;
}

/* --- forces ----------------------------------------------------------------------------- */

/* state->force += size × unit */
static void push(struct incise_fixed_state *state, int32_t size, const int32_t unit[3])
{
	incise_fx_add(state->force, state->force, size, unit);
}

/* N against a tool so far beyond the plane of the membrane. */
static int32_t membrane_force(const struct incise_fixed_membrane *membrane,
			      struct incise_fixed_state *state,
			      struct incise_fixed_tick *tick, int32_t beyond)
{
	if (beyond >= membrane->thickness)
		state->membrane.punctured = true;
	tick->flags |=
		state->membrane.punctured ? INCISE_TICK_LUMEN : INCISE_TICK_MEMBRANE;
	if (!state->membrane.punctured)
		return incise_fx_times(membrane->stiffness, beyond);
	if (beyond <= membrane->back_wall)
		return 0;
	tick->flags |= INCISE_TICK_BACK_WALL;
	return incise_fx_times(membrane->stiffness,
			       (int64_t)beyond - membrane->back_wall);
}

void incise_fixed_stage_membrane(const struct incise_fixed_plan *plan,
				 struct incise_fixed_state *state,
				 struct incise_fixed_tick *tick)
{
	const struct incise_fixed_membrane *membrane = &plan->numbers.membrane;
	int32_t off[3], across[3], beyond, depth;

	if (!membrane->stiffness || is_stale_tick(tick))
		return;
	incise_fx_sub(off, tick->tool, membrane->point);
	beyond = -incise_fx_along(off, membrane->normal);
	/* Another tool did not come there the way that the last one did. */
	if (state->proxy.began)
		state->membrane.met = state->membrane.hit = false;
	if (tick->phase == INCISE_PHASE_FREE || beyond <= 0) {
		state->membrane.met = state->membrane.hit = false;
		return;
	}
	if (!state->membrane.met) {
		state->membrane.met = true;
		incise_fx_add(across, off, beyond, membrane->normal);
		/* Not uncut skin above it, or tissue beside it. */
		state->membrane.hit =
			incise_fx_length(across) <= (uint32_t)membrane->radius &&
			(tick->phase == INCISE_PHASE_CUTTING || state->opening.in);
		depth = (int32_t)incise_fx_hold((int64_t)state->depth - beyond,
						INT32_MAX);
		state->membrane.depth = depth > 0 ? depth : 0;
	}
	if (!state->membrane.hit)
		return;
	if (state->depth > state->membrane.depth)
		state->depth = state->membrane.depth;
	push(state, membrane_force(membrane, state, tick, beyond), membrane->normal);
}

static int32_t acceleration(const struct incise_fixed_plan *plan,
			    const struct incise_fixed_state *state,
			    const struct incise_fixed_tick *tick)
{
	int64_t hard[3];

	incise_fixed_predict_acceleration(&state->scalpel, &plan->numbers.filter,
					  tick->t_ns, hard);
	return incise_fixed_input_acceleration(state->velocity, hard);
}

static int32_t find_input(const struct incise_fixed_plan *plan,
			  const struct incise_fixed_state *state,
			  const struct incise_fixed_tick *tick, uint32_t kind)
{
	int32_t axis[3];

	switch (kind) {
	case INCISE_FIXED_INPUT_SPEED:
		return tick->speed;
	case INCISE_FIXED_INPUT_ACCELERATION:
		return acceleration(plan, state, tick);
	case INCISE_FIXED_INPUT_TILT:
		incise_fx_rotate(axis, state->attitude, plan->numbers.axis);
		return incise_fixed_input_tilt(axis, state->normal);
	case INCISE_FIXED_INPUT_TIME:
		return incise_fixed_input_time(tick->t_ns, state->touched_ns);
	default:
		return state->depth;
	}
}

/* Song et al. (2006), eq. (3); tissue does not pull. */
static int32_t cutting_force(const struct incise_fixed_plan *plan,
			     const struct incise_fixed_state *state,
			     struct incise_fixed_tick *tick)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;
	const struct incise_fixed *model = &plan->model;
	int32_t x[INCISE_FIXED_INPUTS_MAX] = {state->depth, tick->speed}, size;
	int32_t beyond = state->depth - numbers->support;
	uint32_t kinds = (uint32_t)numbers->inputs;

	for (int i = 0; kinds; i++, kinds >>= 4)
		x[i] = find_input(plan, state, tick, kinds & 15);
	for (int i = 0; i < model->n_inputs && numbers->gain > 0; i++)
		if (x[i] < model->input[i].min || x[i] > model->input[i].max)
			tick->flags |= INCISE_TICK_EXTRAPOLATED;
	size = incise_fx_times(numbers->gain, incise_fixed_eval(model, x));
	size = size > 0 ? size : 0;
	if (beyond > 0)
		size = incise_fx_hold32((int64_t)size +
					incise_fx_times(numbers->beyond, beyond));
	return size;
}

/* New tissue that the blade meets at this tick. */
static int32_t advance(struct incise_fixed_state *state)
{
	const int32_t *at = state->proxy.touch.point;
	bool fresh;

	if (state->proxy.began) {
		fresh = !incise_fixed_line_holds(&state->line, state->p0);
		/* The work of an earlier visit pays for nothing now. */
		state->front =
			(struct incise_fixed_front){.cut = fresh ? 0 : state->front.cut};
		if (fresh)
			incise_fixed_line_begin(&state->line, state->p0, state->sn,
						state->side);
	}
	/* Through a membrane it meets none. */
	if (state->membrane.hit)
		return 0;
	return incise_fixed_line_advance(&state->line, at, state->sn, state->side);
}

static int32_t reaction_force(const struct incise_fixed_plan *plan,
			      struct incise_fixed_state *state,
			      struct incise_fixed_tick *tick)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;
	int32_t new_tissue, most;

	if (!plan->has_model)
		return incise_fx_times(numbers->reaction, state->depth);
	if (!numbers->unloading)
		return state->depth > 0 ? cutting_force(plan, state, tick) : 0;
	new_tissue = advance(state);
	most = state->depth > 0 ? cutting_force(plan, state, tick) : 0;
	return incise_fixed_front_force(&state->front, numbers->unloading,
					numbers->friction, state->depth, new_tissue,
					most);
}

/* A tube is round: the paper's product is of the handle's flat side. */
static bool is_printed(const struct incise_fixed_numbers *numbers,
		       const struct incise_fixed_state *state)
{
	return numbers->printed && state->held == INCISE_TOOL_HANDLE;
}

/* Fort, Q16: how much a tool in a cut is held up. */
static int32_t eased(const struct incise_fixed_numbers *numbers,
		     const struct incise_fixed_state *state)
{
	int32_t lies[3], flat[3], across = ONE;

	if (is_printed(numbers, state)) {
		incise_fx_cross(flat, numbers->side, numbers->axis);
		incise_fx_rotate(lies, state->attitude, flat);
		across = incise_fx_dot(lies, state->opening.along);
	} else if (state->held != INCISE_TOOL_TUBE) {
		across = incise_fx_dot(state->flat, state->opening.along);
	} else {
		across = INCISE_FIXED_UNIT;
	}
	across = (int32_t)incise_fx_within(
		incise_fx_rounded(across < 0 ? -across : across, 14), 0, ONE);
	if (is_printed(numbers, state))
		return across;
	return numbers->aligned +
	       incise_fx_times(incise_fx_times(ONE - numbers->aligned, across),
			       state->tightness);
}

/* Below the cut, and outside of it, tissue holds up like skin. */
static int32_t insertion_force(const struct incise_fixed_numbers *numbers,
			       const struct incise_fixed_state *state)
{
	const struct incise_fixed_opening *opening = &state->opening;
	int32_t cut = 0, size;

	if (opening->in)
		cut = state->depth < opening->depth ? state->depth : opening->depth;
	size = state->depth - cut;
	if (opening->in && is_printed(numbers, state))
		size = incise_fx_times(eased(numbers, state), state->depth);
	else if (opening->in)
		size += incise_fx_times(eased(numbers, state), cut);
	return incise_fx_times(numbers->insertion, size);
}

void incise_fixed_stage_reaction(const struct incise_fixed_plan *plan,
				 struct incise_fixed_state *state,
				 struct incise_fixed_tick *tick)
{
	if (tick->phase == INCISE_PHASE_CUTTING)
		push(state, reaction_force(plan, state, tick), state->normal);
}

void incise_fixed_stage_plane(const struct incise_fixed_plan *plan,
			      struct incise_fixed_state *state,
			      struct incise_fixed_tick *tick)
{
	struct incise_fixed_spring spring = {.stiffness = plan->numbers.plane};

	if (tick->phase != INCISE_PHASE_CUTTING)
		return;
	incise_fx_copy(spring.anchor, state->p0);
	incise_fx_copy(spring.direction, state->side);
	incise_fixed_spring_pull(&spring, tick->tool, state->force);
}

void incise_fixed_stage_damping(const struct incise_fixed_plan *plan,
				struct incise_fixed_state *state,
				struct incise_fixed_tick *tick)
{
	/* 2^31 · 2^29.3 in Q44 */
	for (int i = 0; i < 3 && tick->phase != INCISE_PHASE_FREE; i++)
		state->force[i] = incise_fx_hold32(
			state->force[i] -
			incise_fx_rounded(
				(int64_t)plan->numbers.damping * state->velocity[i], 28));
}

void incise_fixed_stage_insertion(const struct incise_fixed_plan *plan,
				  struct incise_fixed_state *state,
				  struct incise_fixed_tick *tick)
{
	if (tick->phase == INCISE_PHASE_INSERTION)
		push(state, insertion_force(&plan->numbers, state), state->normal);
}

/* The tissue around an instrument gives way to a limited extent. */
void incise_fixed_stage_spread(const struct incise_fixed_plan *plan,
			       struct incise_fixed_state *state,
			       struct incise_fixed_tick *tick)
{
	int32_t off[3], across[3];

	if (tick->phase != INCISE_PHASE_INSERTION)
		return;
	incise_fx_sub(off, tick->tool, state->p0);
	incise_fx_add(across, off, -incise_fx_along(off, state->normal), state->normal);
	for (int i = 0; i < 3; i++)
		state->force[i] = incise_fx_hold32(
			(int64_t)state->force[i] -
			incise_fx_times(plan->numbers.spread, across[i]));
}

/* --- start, limit, targets -------------------------------------------------------------- */

void incise_fixed_stage_start(const struct incise_fixed_plan *plan,
			      struct incise_fixed_state *state,
			      struct incise_fixed_tick *tick)
{
	const struct incise_fixed_numbers *numbers = &plan->numbers;
	bool fresh =
		!(tick->flags & INCISE_TICK_STALE) && !state->fading && !state->changing;
	uint64_t gone = (uint64_t)tick->t_ns - (uint64_t)state->last_ns;
	int64_t dt_ns = 0, change;

	/* 2^31 << 30 */
	if (state->last_ns && tick->t_ns > state->last_ns)
		dt_ns = gone < INT32_MAX ? (int64_t)gone : INT32_MAX;
	if (fresh && incise_fx_is_short(state->force, numbers->small))
		state->released = true;
	if (!state->released) {
		state->gain = 0;
	} else if (fresh && dt_ns > 0) {
		change = numbers->ramp_ns ? div64_s64(dt_ns << 30, numbers->ramp_ns)
					  : GAIN_ONE;
		change = change < RISE_MOST ? change : RISE_MOST;
		state->gain = incise_fx_within(state->gain + change, 0, GAIN_ONE);
	} else if (!fresh && dt_ns > 0) {
		change = numbers->fade_ns ? div64_s64(dt_ns << 30, numbers->fade_ns)
					  : GAIN_ONE;
		state->gain = incise_fx_within(state->gain - change, 0, GAIN_ONE);
	}
	state->last_ns = tick->t_ns;
	if (state->gain < GAIN_ONE)
		tick->flags |= INCISE_TICK_STARTING;
	for (int i = 0; i < 3; i++)
		tick->command[i] =
			(int32_t)incise_fx_rounded(state->gain * state->force[i], 30);
}

/* Shorten to @most, never above. Each component is below 2^32; 2^32 · 2^28. */
static bool shorten(int64_t v[3], int32_t most)
{
	uint64_t sum = 0;
	int64_t length;
	int shift = 0;

	/* Squares of 31 bits: 3 · 2^62 < 2^64. */
	for (int i = 0; i < 3; i++)
		while ((v[i] < 0 ? -v[i] : v[i]) >> shift > INT32_MAX)
			shift++;
	for (int i = 0; i < 3; i++) {
		int64_t part = (v[i] < 0 ? -v[i] : v[i]) >> shift;

		part += shift ? 1 : 0;
		part = part < INT32_MAX ? part : INT32_MAX;
		sum += (uint64_t)(part * part);
	}
	/* Mostly it is: without a root. 2^28 squared. */
	if (!shift && sum <= (uint64_t)((int64_t)most * most))
		return false;
	length = incise_fx_root(sum);
	length += (uint64_t)length * (uint64_t)length < sum;
	length <<= shift;
	if (length <= most)
		return false;
	for (int i = 0; i < 3; i++)
		v[i] = div64_s64(v[i] * most, length);
	return true;
}

void incise_fixed_stage_limit(const struct incise_fixed_plan *plan,
			      struct incise_fixed_state *state,
			      struct incise_fixed_tick *tick)
{
	int64_t force[3], change[3];

	for (int i = 0; i < 3; i++)
		force[i] = tick->command[i];
	if (shorten(force, plan->numbers.force))
		tick->flags |= INCISE_TICK_CLAMPED;
	for (int i = 0; i < 3; i++)
		change[i] = force[i] - state->last[i];
	if (shorten(change, plan->numbers.slew)) {
		tick->flags |= INCISE_TICK_SLEWED;
		for (int i = 0; i < 3; i++)
			force[i] = state->last[i] + change[i];
		/* Between two forces within the limit, but for rounding. */
		shorten(force, plan->numbers.force);
	}
	for (int i = 0; i < 3; i++)
		tick->command[i] = state->last[i] = (int32_t)force[i];
}

/*
 * Where the handle is along the axis: the tracker's pose says it. Without a fresh one it is where it
 * was; before the first, where the spring is at rest.
 */
static void aim(const struct incise_fixed_axis *axis, int32_t *place,
		struct incise_fixed_tick *tick, int i)
{
	const int32_t no_origin[3] = {0};
	int32_t off[3];
	int64_t sum = 0, nut, held;

	if (!(tick->flags & INCISE_TICK_STALE)) {
		incise_fx_sub(off, tick->tool, no_origin);
		*place = incise_fx_hold32((int64_t)incise_fx_along(off, axis->direction) -
					  axis->origin);
	}
	/* 3 · 2^28 · 2^31 in Q40 */
	for (int k = 0; k < 3; k++)
		sum += (int64_t)tick->command[k] * axis->dual[k];
	tick->along[i] = incise_fx_hold32(incise_fx_rounded(sum, 24));
	/* 2^31 · 2^31 in Q36 */
	nut = *place + incise_fx_rounded((int64_t)tick->along[i] * axis->compliance, 20);
	held = incise_fx_within(nut, 0, axis->travel);
	/* Less than a step beyond is where its position is read to. */
	if ((nut > held ? nut - held : held - nut) >
	    div64_s64(1LL << 32, axis->steps_per_mm))
		tick->flags |= INCISE_TICK_TRAVEL;
	/* 2^31 · 2^31 in Q32 */
	tick->target[i] = (int32_t)incise_fx_rounded(held * axis->steps_per_mm, 32);
}

void incise_fixed_plan_tick(const struct incise_fixed_plan *plan,
			    struct incise_fixed_state *state, int64_t t_ns,
			    struct incise_fixed_tick *tick)
{
	*tick = (struct incise_fixed_tick){.t_ns = t_ns};
	incise_fixed_stage_predict(plan, state, tick);
	incise_fixed_stage_tool(plan, state, tick);
	incise_fixed_stage_contact(plan, state, tick);
	incise_fixed_stage_normal(plan, state, tick);
	incise_fixed_stage_incision(plan, state, tick);
	incise_fixed_stage_membrane(plan, state, tick);
	incise_fixed_stage_reaction(plan, state, tick);
	incise_fixed_stage_plane(plan, state, tick);
	incise_fixed_stage_damping(plan, state, tick);
	incise_fixed_stage_insertion(plan, state, tick);
	incise_fixed_stage_spread(plan, state, tick);
	incise_fixed_stage_start(plan, state, tick);
	incise_fixed_stage_limit(plan, state, tick);
	for (int i = 0; i < plan->numbers.n_axes; i++)
		aim(&plan->numbers.axes[i], &state->place[i], tick, i);
}
