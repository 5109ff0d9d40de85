// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The stages of a tick; see tick.proto.h. The forces follow Bhasin et al. (2005), with Song et al.'s model as the
 * first of them. P is the tool's end, P0 where the contact began, n the outward normal (the paper's Sn, or Snavg), d
 * the depth.
 *
 *   cutting     reaction    F += Kn d n                      §2.2, Fn; less in an open cut
 *               with a model F += F(d, |v|) n       Song et al. (2006), eq. (3), by the front
 *                                                            of front.proto.c
 *               plane       F -= Kx ((P-P0)·s) s             §2.2, Fx
 *               fracture    F -= min(K |z|, J (d-D)) c z/|z| along the cut; in no paper, see tear.proto.c
 *   insertion   insertion   F += Ky d n Fort                 §2.3, Fy
 *               spread      F -= Kxz (I - n0 n0ᵀ)(P-P0)      §2.3, Fxz
 *   both        damping     F -= Kd v                        §2.2, Fd
 *               skin        F -= min(K |x|, μ N) x/|x|       friction along the skin; in no paper
 *
 * Compared with the paper's print:
 *
 * - Fn and Fy print (P-P0)·Sn for the depth and call it the depth of penetration along Sn. On a plane the
 *   two are one. On a curved surface they part: the blade that glides along a neck without pressing has
 *   (P-P0)·Sn > 0, which would pull it in. Here d is the depth below the surface.
 * - Fd prints +Kd v. It is to damp, so it opposes v.
 * - Fxz prints a product of three distances along (Q0-P0), which is always zero when the contact starts on
 *   the surface. Its sentence asks for a force proportional to the distance of the instrument from where
 *   its contact began, as here.
 */

/*
 * sin of the angle between the scalpel and the surface, to either side, within which the held end does not change:
 * 12° are more than a hand's tremor.
 */
#define UNDECIDED D_OF(1, 5)

/* From here on the tube counts as nearer; a tracker's noise and a tremor are far less. */
#define NEARER N(5)

/* Share of the force in one tick: a ramp has at least ten ticks. */
#define RISE_MOST (W_ONE / 10)

/* Skin that was not cut before gives way over so much more depth: INCISE_PUNCTURE_MM. */
#define OPENS_OVER N_OF(1, 2)

/* --- poses ------------------------------------------------------------------------------ */

static enum incise_fixed_pose_answer add_pose(struct T(predict) *p,
					      const struct T(filter) *filter,
					      const num position[3],
					      const dir quaternion[4], int64_t t_ns)
{
	if (T(predict_add)(p, filter, position, quaternion, t_ns))
		return INCISE_FIXED_POSE_TAKEN;
	if (t_ns >= 0 && p->started && t_ns - (int64_t)filter->latency_ns <= p->t_ns)
		return INCISE_FIXED_POSE_OLD;
	return INCISE_FIXED_POSE_FAR;
}

static enum incise_fixed_pose_answer take_scalpel(const struct T(numbers) *numbers,
						  struct T(state) *state,
						  const struct T(pose) *pose,
						  int64_t t_ns)
{
	enum incise_fixed_pose_answer answer;
	num tip[3], end[3];
	dir q[4], along[3];

	/* An invalid quaternion leaves the attitude as it was. */
	if (!d_attitude(q, pose->quaternion))
		for (int i = 0; i < 4; i++)
			q[i] = state->scalpel.q[i];
	v_reach(tip, pose->position, q, numbers->tip);
	answer = add_pose(&state->scalpel, &numbers->filter, tip, q, t_ns);
	if (answer != INCISE_FIXED_POSE_TAKEN || !numbers->inserts)
		return answer;
	/*
	 * The handle's end is predicted by itself. It cannot be found from the tip's prediction: the
	 * attitude is not extrapolated, and on an arm of 120 mm its lag is more than 1 mm.
	 */
	d_turn(along, state->scalpel.q, numbers->axis);
	v_add(end, tip, numbers->handle, along);
	T(predict_add)(&T_PART(state, ends)->handle, &numbers->filter, end, q, t_ns);
	return answer;
}

enum incise_fixed_pose_answer T(plan_pose)(const struct T(plan) *plan,
					   struct T(state) *state,
					   const struct T(pose) *pose, int64_t now_ns)
{
	const struct T(numbers) *numbers = &plan->numbers;
	/* A timestamp from the future would keep all later poses out. */
	int64_t t_ns = pose->t_ns > now_ns ? now_ns : pose->t_ns;
	uint32_t tool = pose->tool & INCISE_FIXED_POSE_TOOL;
	bool none = true;

	if (pose->tool & ~INCISE_FIXED_POSE_KNOWN || tool > INCISE_TOOL_TUBE)
		return INCISE_FIXED_POSE_UNKNOWN;
	if (pose->tool & INCISE_FIXED_POSE_TUBE && !numbers->tube)
		return INCISE_FIXED_POSE_UNKNOWN;
	state->fading = !!(pose->tool & INCISE_FIXED_POSE_FADE);
	if (numbers->inserts)
		state->wanted = (int32_t)tool;
	for (int i = 0; i < 4; i++)
		none = none && !d_below(0, d_abs(pose->quaternion[i]));
	if (none)
		return INCISE_FIXED_POSE_NONE;
	if (!(pose->tool & INCISE_FIXED_POSE_TUBE))
		return take_scalpel(numbers, state, pose, t_ns);
	return add_pose(&T_PART(state, ends)->tube, &numbers->filter, pose->position,
			pose->quaternion, t_ns);
}

/* --- predict and tool ------------------------------------------------------------------- */

static bool is_stale_tick(const struct T(tick) *tick)
{
	return tick->flags & INCISE_TICK_STALE;
}

static bool is_stale(const struct T(plan) *plan, const struct T(predict) *p, int64_t t_ns)
{
	return T(predict_age)(p, t_ns) > plan->numbers.pose_age_ns;
}

void T(stage_predict)(const struct T(plan) *plan, struct T(state) *state,
		      struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;

	tick->age_ns = T(predict_age)(&state->scalpel, tick->t_ns);
	if (tick->age_ns > numbers->pose_age_ns)
		tick->flags |= INCISE_TICK_STALE;
	T(predict_at)
	(&state->scalpel, &numbers->filter, tick->t_ns, tick->position, state->velocity);
	T(predict_attitude)
	(&state->scalpel, &numbers->filter, tick->t_ns, state->attitude);
	for (int i = 0; i < 4; i++)
		tick->attitude[i] = state->attitude[i];
	v_copy(tick->tool, tick->position);
	tick->speed = v_length(state->velocity);
	tick->held = state->held;
}

/* Whether another tool is wanted than the held one, without a look at the scalpel's turn. */
static bool waits(const struct T(state) *state)
{
	if (state->wanted == INCISE_TOOL_AUTO)
		return (state->held == INCISE_TOOL_TUBE) != !!state->tube_nearer;
	return state->wanted != state->held;
}

/* Whether the tool that is held stays: in the tissue it does until the force has faded. */
static bool keeps_tool(struct T(state) *state)
{
	bool faded = !(state->gain > 0) && v_is_zero(state->last);

	state->changing = state->proxy.touching && waits(state);
	return state->proxy.touching && !(state->changing && faded);
}

/* A height above the surface, between two numbers; its own scale. */
struct height {
	wide low, high;
};

/* Since the surface was searched a height changed by no more than the end went, and its rounding. */
static struct height height_of(const struct T(above) *last, const num end[3])
{
	num way[3];
	wide went = w_of(FAR_MOST), above = w_of(last->above);

	v_sub(way, end, last->end);
	if (last->known)
		went = w_of(v_length(way)) + LEAST;
	return (struct height){above - went, above + went};
}

/* The surface is only searched where the known heights do not decide. */
static bool is_tube_nearer(const struct T(plan) *plan, struct T(state) *state,
			   const struct T(tick) *tick)
{
	const struct T(filter) *filter = &plan->numbers.filter;
	struct T(ends) *ends = T_PART(state, ends);
	bool tube_held = state->held == INCISE_TOOL_TUBE, searched = false;
	/* A nearer tube stays below the scalpel by so much. */
	wide nearer = w_of(tube_held ? n_neg(NEARER) : NEARER);
	num end[T(ENDS)][3], velocity[3];

	v_copy(end[T(TIP)], tick->position);
	T(predict_at)
	(&T_PART(state, ends)->handle, filter, tick->t_ns, end[T(HANDLE)], velocity);
	T(predict_at)
	(&T_PART(state, ends)->tube, filter, tick->t_ns, end[T(TUBE)], velocity);
	for (;;) {
		struct height h[T(ENDS)];
		wide low, high;

		for (int i = 0; i < T(ENDS); i++)
			h[i] = height_of(&ends->above[i], end[i]);
		low = w_min(h[T(TIP)].low, h[T(HANDLE)].low);
		high = w_min(h[T(TIP)].high, h[T(HANDLE)].high);
		if (h[T(TUBE)].high + nearer < low)
			return true;
		if (h[T(TUBE)].low + nearer > high || searched)
			return tube_held && searched && h[T(TUBE)].low + nearer <= high;
		for (int i = 0; i < T(ENDS); i++) {
			ends->above[i].known = true;
			ends->above[i].above = T(surface_above)(plan, end[i]);
			v_copy(ends->above[i].end, end[i]);
		}
		searched = true;
	}
}

/* A silent station counts as far away, also in the tissue. */
static bool find_tube(const struct T(plan) *plan, struct T(state) *state,
		      const struct T(tick) *tick)
{
	bool tube_stale = is_stale(plan, &T_PART(state, ends)->tube, tick->t_ns);
	bool stale = is_stale_tick(tick), keeps;

	if (tube_stale)
		state->tube_nearer = false;
	else if (stale)
		state->tube_nearer = true;
	keeps = keeps_tool(state);
	if (!keeps && state->wanted == INCISE_TOOL_AUTO && !tube_stale && !stale)
		state->tube_nearer = is_tube_nearer(plan, state, tick);
	return keeps;
}

static int32_t tool_by_place(const struct T(plan) *plan, const struct T(state) *state)
{
	dir axis[3], up;

	if (state->tube_nearer)
		return INCISE_TOOL_TUBE;
	d_turn(axis, state->attitude, plan->numbers.axis);
	up = d_dot(axis, plan->numbers.up);
	if (d_below(UNDECIDED, up))
		return INCISE_TOOL_BLADE;
	if (d_below(up, -UNDECIDED))
		return INCISE_TOOL_HANDLE;
	return state->held == INCISE_TOOL_TUBE ? INCISE_TOOL_BLADE : state->held;
}

static void choose_tool(const struct T(plan) *plan, struct T(state) *state)
{
	int32_t before = state->held;

	state->held = state->wanted == INCISE_TOOL_AUTO ? tool_by_place(plan, state)
							: state->wanted;
	if (state->held == before)
		return;
	/* The way from the end of one tool to the end of the other is no motion. */
	state->proxy = (struct T(proxy)){0};
	T(surface_restart)(plan);
	state->gain = 0;
	state->changing = false;
}

void T(stage_tool)(const struct T(plan) *plan, struct T(state) *state,
		   struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;

	if (!numbers->inserts)
		return;
	if (!(numbers->tube ? find_tube(plan, state, tick) : keeps_tool(state)))
		choose_tool(plan, state);
	tick->held = state->held;
	if (state->held == INCISE_TOOL_HANDLE)
		T(predict_at)
	(&T_PART(state, ends)->handle, &numbers->filter, tick->t_ns, tick->tool,
	 state->velocity);
	if (state->held == INCISE_TOOL_TUBE && numbers->tube) {
		/* The attitude stays the scalpel's. */
		T(predict_at)
		(&T_PART(state, ends)->tube, &numbers->filter, tick->t_ns, tick->tool,
		 state->velocity);
		tick->age_ns = T(predict_age)(&T_PART(state, ends)->tube, tick->t_ns);
		tick->flags &= ~(uint32_t)INCISE_TICK_STALE;
		if (tick->age_ns > numbers->pose_age_ns)
			tick->flags |= INCISE_TICK_STALE;
	}
}

/* --- contact ---------------------------------------------------------------------------- */

static void begin_contact(struct T(state) *state, int64_t t_ns)
{
	state->touched_ns = t_ns;
	state->deepest = 0;
	state->path = 0;
	state->path_ns = t_ns;
	state->skin_open = false;
	v_copy(state->p0, state->proxy.first.point);
	d_copy(state->entry, state->proxy.touch.normal);
	if (state->held == INCISE_TOOL_BLADE)
		d_copy(state->side, state->flat);
	state->averaged = false;
}

void T(stage_contact)(const struct T(plan) *plan, struct T(state) *state,
		      struct T(tick) *tick)
{
	struct T(proxy) *proxy = &state->proxy;

	if (proxy->touching) {
		state->path = T(input_path)(state->path, tick->speed, state->path_ns,
					    tick->t_ns);
		state->path_ns = tick->t_ns;
	}
	/* The last force stays, and fades. */
	if (is_stale_tick(tick))
		return;
	for (int i = 0; i < 3; i++)
		state->force[i] = state->late[i] = 0;
	T(surface_move)(plan, proxy, tick->tool);
	state->depth = 0;
	if (!proxy->touching)
		return;
	/* A cut that is not opened asks for it where it begins only. */
	if (proxy->began || plan->numbers.inserts)
		d_turn(state->flat, state->attitude, plan->numbers.side);
	if (proxy->began)
		begin_contact(state, tick->t_ns);
	d_copy(state->sn, proxy->touch.normal);
	d_copy(state->normal, state->sn);
	state->depth = n_max(proxy->touch.depth, 0);
	tick->flags |= INCISE_TICK_CONTACT;
	tick->phase = state->held == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
						       : INCISE_PHASE_INSERTION;
	tick->depth = state->depth;
	v_copy(tick->proxy, proxy->touch.point);
	d_copy(tick->normal, state->normal);
}

/*
 * Bhasin et al.'s Snavg: ΣSn / |ΣSn| over the last ticks, so that a force does not jerk where the normal
 * does. Rounding would pile up in a running sum of doubles, so after each turn of the ring it is replaced
 * by the sum of that turn alone. Where normals are opposed and their sum vanishes, the last average
 * counts on.
 */
void T(stage_normal)(const struct T(plan) *plan, struct T(state) *state,
		     struct T(tick) *tick)
{
	struct T(average) *average = T_PART(state, average);
	int32_t n = plan->numbers.average_ticks;
	dir *place;
	bool turned;

	if (n < 2 || tick->phase == INCISE_PHASE_FREE)
		return;
	if (!state->averaged)
		*average = (struct T(average)){0};
	state->averaged = true;
	place = average->ring[average->at];
	turned = average->at + 1 >= n;
	for (int i = 0; i < 3; i++) {
		if (average->n == n)
			average->sum[i] -= place[i];
		place[i] = state->sn[i];
		average->sum[i] += place[i];
		average->turn[i] += place[i];
		if (turned) {
			average->sum[i] = average->turn[i];
			average->turn[i] = 0;
		}
	}
	average->n += average->n < n;
	average->at = turned ? 0 : average->at + 1;
	d_mean(average->last, average->sum);
	d_copy(state->normal, average->last);
	d_copy(tick->normal, state->normal);
}

/*
 * Set D, the depth down to which the blade meets friction only: F = K (u min(d, D) + max(d - D, 0)), which is a potential of d. Where
 * the cut is deeper than D, D grows, and the tissue loses what it would give back; where it is not, D falls to d
 * and no further, as the force does not change by that. So no motion, along the cut or out of it, returns work.
 */
static void open_blade(struct T(state) *state, num open)
{
	num before = state->proxy.began ? 0 : n_min(state->open, state->depth);

	state->open = n_max(open, before);
}

/* An instrument meets the opening as it was when it went in: it makes the way easier for the next. */
void T(stage_incision)(const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	const struct T(incision_setup) *setup = &plan->numbers.incision;
	struct T(incision) *cuts = T_PART(state, incision);
	bool inserts = tick->phase == INCISE_PHASE_INSERTION;

	if (!plan->numbers.inserts)
		return;
	if (state->proxy.began)
		cuts->entered = false;
	if (tick->phase == INCISE_PHASE_FREE)
		T(incision_leave)(cuts);
	else if (inserts)
		T(incision_open)
	(cuts, setup, (enum incise_tool)state->held, tick->proxy, state->flat,
	 state->depth);
	else if (!T(incision_cut)(cuts, setup, tick->proxy, state->normal, state->flat,
				  state->depth)) tick->flags |= INCISE_TICK_FULL;
	if (inserts && (state->proxy.began || !state->opening.in)) {
		state->opening = cuts->met;
		state->tightness = T(incision_tightness)(setup, &state->opening,
							 (enum incise_tool)state->held);
	} else if (!inserts && !is_stale_tick(tick)) {
		state->opening.in = false;
	}
	if (tick->phase == INCISE_PHASE_CUTTING)
		open_blade(state, cuts->open);
	if (inserts && state->opening.in)
		tick->flags |= INCISE_TICK_IN_CUT;
}

/* --- forces ----------------------------------------------------------------------------- */

static void push(struct T(state) *state, num size, const dir unit[3])
{
	v_add(state->force, state->force, size, unit);
}

/* Along the normal. An average normal is late: this part of the force is due to its difference from Sn. */
static void push_out(const struct T(plan) *plan, struct T(state) *state, num size)
{
	push(state, size, state->normal);
	if (plan->numbers.average_ticks < 2)
		return;
	v_add(state->late, state->late, size, state->normal);
	v_add(state->late, state->late, n_neg(size), state->sn);
}

/* N against a tool so far beyond the plane of the membrane. */
static num membrane_force(const struct T(membrane) *membrane, struct T(state) *state,
			  struct T(tick) *tick, num beyond)
{
	if (!n_below(beyond, membrane->thickness))
		state->membrane.punctured = true;
	tick->flags |=
		state->membrane.punctured ? INCISE_TICK_LUMEN : INCISE_TICK_MEMBRANE;
	if (!state->membrane.punctured)
		return n_times(membrane->stiffness, beyond);
	if (!n_below(membrane->back_wall, beyond))
		return 0;
	tick->flags |= INCISE_TICK_BACK_WALL;
	return n_times(membrane->stiffness, n_sub(beyond, membrane->back_wall));
}

/* Whether a tool meets the membrane here, and not uncut skin above it or tissue beside it. */
static bool hits_membrane(const struct T(membrane) *membrane,
			  const struct T(state) *state, const struct T(tick) *tick,
			  const num off[3], num beyond)
{
	num across[3];

	v_add(across, off, beyond, membrane->normal);
	return v_is_short(across, membrane->radius) &&
	       (tick->phase == INCISE_PHASE_CUTTING || state->opening.in);
}

/* A membrane that leans more from the skin counts as if it leant by 78°. */
#define STEEPEST N_OF(1, 5)

/*
 * A membrane over an airway. Tissue in front of it holds the tool up to the depth that it has there, on the line
 * along the skin's normal through the tool, and no more beyond it; the membrane yields, and is open from then on.
 */
void T(stage_membrane)(const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	const struct T(membrane) *membrane = &plan->numbers.membrane;
	num off[3], beyond, slope;

	if (!n_below(0, membrane->thickness) || is_stale_tick(tick))
		return;
	v_sub(off, tick->tool, membrane->point);
	beyond = n_neg(v_along(off, membrane->normal));
	/* Another tool did not come there the way that the last one did. */
	if (state->proxy.began)
		state->membrane.met = state->membrane.hit = false;
	if (tick->phase == INCISE_PHASE_FREE || !n_below(0, beyond)) {
		state->membrane.met = state->membrane.hit = false;
		return;
	}
	if (!state->membrane.met) {
		state->membrane.met = true;
		state->membrane.hit = hits_membrane(membrane, state, tick, off, beyond);
	}
	if (!state->membrane.hit)
		return;
	slope = n_max(n_share_of(d_dot(state->sn, membrane->normal)),
		      n_max(plan->numbers.upright, STEEPEST));
	state->depth = n_max(n_sub(state->depth, n_over(beyond, slope)), 0);
	push(state, membrane_force(membrane, state, tick, beyond), membrane->normal);
}

static num find_input(const struct T(plan) *plan, const struct T(state) *state,
		      const struct T(tick) *tick, uint32_t kind)
{
	dir axis[3];
	wide hard[3];

	switch (kind) {
	case INCISE_FIXED_INPUT_SPEED:
		return tick->speed;
	case INCISE_FIXED_INPUT_ACCELERATION:
		T(predict_acceleration)
		(&state->scalpel, &plan->numbers.filter, tick->t_ns, hard);
		return T(input_acceleration)(state->velocity, hard);
	case INCISE_FIXED_INPUT_TILT:
		d_turn(axis, state->attitude, plan->numbers.axis);
		return T(input_tilt)(axis, state->normal);
	case INCISE_FIXED_INPUT_TIME:
		return T(input_time)(tick->t_ns, state->touched_ns);
	case INCISE_FIXED_INPUT_MEAN_SPEED:
		return T(input_mean_speed)(state->path, tick->speed, state->touched_ns,
					   tick->t_ns);
	case INCISE_FIXED_INPUT_DEEPEST:
		return state->deepest;
	default:
		return state->depth;
	}
}

/* The force of a phase's model, N. Only inputs that it has are computed. */
static num phase_force(const struct T(plan) *plan, const struct T(state) *state,
		       const struct T(tick) *tick, int32_t phase, bool *outside)
{
	num x[INCISE_FIXED_INPUTS_MAX] = {state->depth, tick->speed};
	uint32_t kinds = T(model_inputs)(plan, phase);

	for (int i = 0; kinds; i++, kinds >>= 4)
		x[i] = find_input(plan, state, tick, kinds & 15);
	return T(model_force)(plan, phase, x, outside);
}

/* Skin that was not cut before gives way from the depth of a cut on; the deepest depth only grows. */
static num open_share(const struct T(numbers) *numbers, const struct T(state) *state)
{
	num beyond = n_sub(state->deepest, numbers->incision.cut_from);

	return state->skin_open ? N(1) : n_within(n_over(beyond, OPENS_OVER), 0, N(1));
}

/* The model's force: of the puncture, of the cut, or between them. */
static num model_force(const struct T(plan) *plan, struct T(state) *state,
		       const struct T(tick) *tick, bool *outside)
{
	num share = N(1), cut = 0, skin;

	state->deepest = n_max(state->deepest, state->depth);
	if (plan->numbers.phases & T_PUNCTURES)
		share = open_share(&plan->numbers, state);
	if (n_below(0, share))
		cut = phase_force(plan, state, tick, INCISE_CUT, outside);
	if (!n_below(share, N(1)))
		return cut;
	skin = phase_force(plan, state, tick, INCISE_PUNCTURE, outside);
	return n_add(n_times(share, cut), n_times(n_sub(N(1), share), skin));
}

/*
 * Song et al. (2006), eq. (3), as the size of Bhasin et al.'s Fn; tissue does not pull. Beyond the depths
 * that the model knows the force goes on with the slope that it has there.
 */
static num cutting_force(const struct T(plan) *plan, struct T(state) *state,
			 struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	num beyond = n_max(n_sub(state->depth, numbers->support), 0), size;
	bool outside = false;

	if (!n_below(0, state->depth))
		return 0;
	size = model_force(plan, state, tick, &outside);
	/* With no gain the model is asked only to keep the stage, not for a force. */
	if (outside && n_below(0, numbers->gain))
		tick->flags |= INCISE_TICK_EXTRAPOLATED;
	size = n_max(n_times(numbers->gain, size), 0);
	return n_add(size, n_times(numbers->beyond, beyond));
}

/* New tissue that the blade meets at this tick. */
static num advance(struct T(state) *state)
{
	if (state->proxy.began)
		state->skin_open =
			!T(front_enter)(&state->front, state->p0, state->sn, state->side);
	/* Through a membrane it meets no tissue. */
	if (state->membrane.hit)
		return 0;
	return T(front_advance)(&state->front, state->proxy.touch.point, state->sn,
				state->side);
}

/*
 * Drag on a blade that comes out, as a part of the force of its cut: by the model of the withdrawal where that pulls,
 * else tissue.friction.
 */
static num front_friction(const struct T(plan) *plan, const struct T(state) *state,
			  const struct T(tick) *tick, num most)
{
	const struct T(numbers) *numbers = &plan->numbers;
	bool outside = false; /* of the cut only it is told */
	num drag;

	if (!(numbers->phases & T_WITHDRAWS) || !n_below(0, state->depth))
		return numbers->friction;
	drag = n_neg(n_times(numbers->gain,
			     phase_force(plan, state, tick, INCISE_WITHDRAW, &outside)));
	/* It goes to 0 at the surface, as the force that unloads does. */
	drag = n_min(drag, n_times(numbers->unloading, state->depth));
	return n_below(0, most) ? n_within(n_over(drag, most), 0, N(1)) : 0;
}

/*
 * The texture of a cut, a saw-tooth over the way of the front. It scales the force at which the tissue gives way,
 * before the front: a fall of that loses elastic energy, and a rise is as steep as the work pays for; see front.proto.c.
 */
void T(stage_texture)(const struct T(plan) *plan, struct T(state) *state,
		      struct T(tick) *tick)
{
	num before = state->tooth;

	if (!plan->texture || tick->phase != INCISE_PHASE_CUTTING)
		return;
	state->fresh = T_JOINED(state, advance(state));
	state->goes_on =
		!state->membrane.hit && T(front_way)(&state->front, state->depth);
	state->tooth = T(texture_at)(plan, &state->front.way, &state->factor);
	state->front.rises = n_below(before, state->tooth);
}

static num texture(const struct T(plan) *plan, const struct T(state) *state,
		   struct T(tick) *tick, num size)
{
	num to;

	if (!plan->texture)
		return size;
	size = n_times(size, state->factor);
	to = n_times(size, state->tooth);
	if (state->goes_on)
		tick->textured = n_sub(to, size);
	return to;
}

void T(stage_reaction)(const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	num size, fresh, friction, open = n_min(state->depth, state->open);

	if (tick->phase != INCISE_PHASE_CUTTING)
		return;
	if (!plan->has_model) {
		size = n_add(n_sub(state->depth, open), n_times(numbers->friction, open));
		size = n_times(numbers->reaction, size);
	} else if (!n_below(0, numbers->unloading)) {
		size = T_JOINED(state, cutting_force(plan, state, tick));
	} else {
		fresh = plan->texture ? state->fresh : T_JOINED(state, advance(state));
		size = texture(plan, state, tick,
			       T_JOINED(state, cutting_force(plan, state, tick)));
		friction = front_friction(plan, state, tick, size);
		size = T_JOINED(state,
				T(front_force)(&state->front, numbers->unloading,
					       friction, state->depth, fresh, size));
	}
	push_out(plan, state, size);
}

/* The blade stays in the plane of its cut: s is Sx(0), its side when the cut began. */
void T(stage_plane)(const struct T(plan) *plan, struct T(state) *state,
		    struct T(tick) *tick)
{
	num off[3];

	if (tick->phase != INCISE_PHASE_CUTTING)
		return;
	v_sub(off, tick->tool, state->p0);
	push(state, n_neg(n_times(plan->numbers.plane, v_along(off, state->side))),
	     state->side);
}

void T(stage_damping)(const struct T(plan) *plan, struct T(state) *state,
		      struct T(tick) *tick)
{
	for (int i = 0; i < 3 && tick->phase != INCISE_PHASE_FREE; i++) {
		state->force[i] = n_damp(state->force[i], plan->numbers.damping,
					 state->velocity[i]);
		state->late[i] =
			n_damp(state->late[i], plan->numbers.damping, state->velocity[i]);
	}
}

/*
 * Fort as Bhasin et al. (2005) print it, the scalar product of the directions of handle and cut: its flat
 * side, which lies along the cut, resists most. A tube is round: the product is of the handle.
 */
static bool is_printed(const struct T(numbers) *numbers, const struct T(state) *state)
{
	return numbers->printed && state->held == INCISE_TOOL_HANDLE;
}

static num printed(const struct T(numbers) *numbers, const struct T(state) *state)
{
	dir flat[3], lies[3];

	d_cross(flat, numbers->side, numbers->axis);
	d_turn(lies, state->attitude, flat);
	return n_share_of(d_dot(lies, state->opening.along));
}

/*
 * Fort, aligned … 1: easily, but not freely. A flat instrument goes in easily when its flat lies along the
 * cut: the flat's normal across the cut's direction then gives 0. A tube is round, it has no turn.
 */
static num eased(const struct T(numbers) *numbers, const struct T(state) *state)
{
	num across = N(1);

	if (state->held != INCISE_TOOL_TUBE)
		across = n_share_of(d_dot(state->flat, state->opening.along));
	return n_add(numbers->aligned,
		     n_times(n_times(n_sub(N(1), numbers->aligned), across),
			     state->tightness));
}

/* Below the cut, and outside of it, tissue holds up like skin. */
void T(stage_insertion)(const struct T(plan) *plan, struct T(state) *state,
			struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	const struct T(opening) *opening = &state->opening;
	num cut = opening->in ? n_min(state->depth, opening->depth_mm) : 0;
	num size = n_sub(state->depth, cut);

	if (tick->phase != INCISE_PHASE_INSERTION)
		return;
	if (opening->in && is_printed(numbers, state))
		size = n_times(printed(numbers, state), state->depth);
	else if (opening->in)
		size = n_add(size, n_times(eased(numbers, state), cut));
	push_out(plan, state, n_times(numbers->insertion, size));
}

/*
 * The tissue around an instrument gives way to a limited extent: across the normal n0 of the place where it went in.
 * Across the normal of now it would be no potential's on curved skin, and stiffer in the depth, by R / (R - d).
 */
void T(stage_spread)(const struct T(plan) *plan, struct T(state) *state,
		     struct T(tick) *tick)
{
	num off[3], across[3];

	if (tick->phase != INCISE_PHASE_INSERTION)
		return;
	v_sub(off, tick->tool, state->p0);
	v_across(across, off, state->entry);
	v_pull(state->force, state->force, plan->numbers.spread, across);
}

/*
 * Coulomb's friction of a tool along the skin, as an anchor that is dragged: a spring from the place where the
 * tool stuck, along the skin, that holds up to a share of the force along the normal; beyond it the anchor
 * follows. So it holds a hand that rests, which the sign of a velocity would not, and gives back only the work of the
 * spring.
 *
 *            stretch            force = min(K stretch, μ N) towards the anchor
 *   ────×─ ─ ─ ─ ─ ─○────       slips: the anchor moves by stretch - μ N / K
 *     anchor      tool
 *
 * The anchor has 32 bits behind the point, so that its rounding adds up to nothing in a contact. An error of the
 * tool's place does not add up along the way, where the anchor is set anew, nor across it, where its next place is a
 * mean of the places of tool and anchor; but a hand that circles at little more than R = μ N / K magnifies it, up to
 * √(2 R δ) for an error of δ: see ../scene/bound.cc.
 */
static void drag(struct T(state) *state, num way, const dir along[3])
{
	/* 2^31 · 2^30 in Q46 */
	for (int i = 0; i < 3; i++)
		state->anchor[i] += w_times(w_of(way), along[i], 14);
}

void T(stage_skin)(const struct T(plan) *plan, struct T(state) *state,
		   struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	num anchor[3], off[3], across[3], stretch, pull, most;
	dir along[3];

	if (tick->phase == INCISE_PHASE_FREE || !n_below(0, numbers->skin))
		return;
	for (int i = 0; i < 3; i++) {
		if (state->proxy.began)
			state->anchor[i] = w_place(state->p0[i]);
		anchor[i] = n_place(state->anchor[i]);
	}
	v_sub(off, tick->tool, anchor);
	v_across(across, off, state->normal);
	if (!v_direction(along, across))
		return;
	stretch = v_along(across, along);
	pull = n_times(numbers->skin, stretch);
	most = n_times(numbers->skin_friction,
		       n_max(v_along(state->force, state->normal), 0));
	if (n_below(most, pull)) {
		/* So far that its rounding does not slip again while the tool rests. */
		drag(state, n_add(n_sub(stretch, n_over(most, numbers->skin)), CREEP),
		     along);
		pull = most;
	}
	push(state, n_neg(pull), along);
}

/* --- start, work and limit --------------------------------------------------------------- */

/*
 * The share of a force that is let through. It waits for a small force, so that a scene that starts with the blade
 * deep in the tissue does not push the hand; then it ramps up, and fades out when poses stop.
 *
 *   wanted   ----.            .-------------------
 *                 '-. small  /
 *   gain  1           '-'  .------.        .------
 *         0   ____________/        \______/
 *             waits    ramp     fade       ramp
 *             poses ..............         ........
 *
 * However long a stall was, a tick brings back a tenth of the force at most; it may take all of it. After a
 * fade the gain rises again without waiting for a small force: the hand has not left, and would else feel nothing
 * until the blade is out of the tissue. The ramp is the protection.
 */
void T(stage_start)(const struct T(plan) *plan, struct T(state) *state,
		    struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	bool fresh = !is_stale_tick(tick) && !state->fading && !state->changing;
	/* Unsigned: two times may be farther apart than an int64_t holds. */
	uint64_t gone = (uint64_t)tick->t_ns - (uint64_t)state->last_ns;
	int64_t dt_ns = 0;

	if (state->last_ns && tick->t_ns > state->last_ns)
		dt_ns = gone < DT_MOST ? (int64_t)gone : DT_MOST;
	if (fresh && v_is_short(state->force, numbers->small))
		state->released = true;
	if (!state->released)
		state->gain = 0;
	else if (fresh && dt_ns > 0 && state->gain < W_ONE)
		state->gain = w_min(state->gain + w_min(w_ramp(dt_ns, numbers->ramp_ns),
							RISE_MOST),
				    W_ONE);
	else if (!fresh && dt_ns > 0)
		state->gain =
			w_within(state->gain - w_ramp(dt_ns, numbers->fade_ns), 0, W_ONE);
	state->last_ns = tick->t_ns;
	if (state->gain < W_ONE)
		tick->flags |= INCISE_TICK_STARTING;
	for (int i = 0; i < 3; i++)
		tick->command[i] = w_scale(state->gain, state->force[i]);
}

/* The forces at both ends of the last way are known. */
static void take_in(struct T(fund) *fund, const struct T(account) *account)
{
	fund->work2 = w_taken(fund->work2, fund->before, fund->last, account->way);
	v_copy(fund->before, fund->last);
}

/* Leave out the unpaid part of a force, also in the command that contains the force. Returns whether there is any. */
static bool leave_out(const struct T(fund) *fund, num stiffness, const dir unit[3],
		      num force[3], num command[3])
{
	num unpaid = n_sub(v_along(force, unit), w_stored(stiffness, fund->work2));

	if (!n_below(0, unpaid))
		return false;
	v_add(command, command, n_neg(unpaid), unit);
	if (force != command)
		v_add(force, force, n_neg(unpaid), unit);
	return true;
}

/*
 * The account of a contact's work: no more comes back than was put in. Springs that hold the energy E, all together
 * of the stiffness K, push with no more than √(2 K E): forces that are a potential's, or only take, are below that.
 * Others come to it: a handle that is turned in its cut, another place beyond a membrane, a force that is late, the
 * border of a mesh, a force that comes back in the tissue after a fade. The part of the force along the way that no
 * work has paid for is left out. Unlike a force that ends where E does, this one has no step there.
 *
 *     force ▲ ¦ .-·'' √(2 K E)
 *           | ¦·  left out above
 *           |·'
 *         0 '────────▶ E: put in, less what came back
 *
 * Late forces (a damper's, and the part due to an averaged normal) have a fund of their own: only they are left
 * out where they give work, and a tool at rest is held as by springs.
 *
 * After Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. Robotics and Automation
 * 18(1), 2002; the work between two ticks is by the mean of their forces, before the limit of their change: a slewed
 * force follows later, and stored work would seem to be unpaid for ever.
 */
void T(stage_work)(const struct T(plan) *plan, struct T(state) *state,
		   struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	struct T(account) *account = &state->account;
	num late[3], force[3];
	dir unit[3];
	wide within[3];
	bool unpaid = false;

	if (!n_below(0, numbers->account))
		return;
	take_in(&account->all, account);
	take_in(&account->late, account);
	if (state->proxy.began || tick->held != account->held)
		account->all.work2 = account->late.work2 = 0;
	account->held = tick->held;
	v_sub(account->way, tick->tool, account->at);
	v_copy(account->at, tick->tool);
	for (int i = 0; i < 3; i++) {
		late[i] = w_scale(state->gain, state->late[i]);
		within[i] = w_of(tick->command[i]);
	}
	/* The hand does not feel a force above the limit. */
	v_shorten(within, numbers->force);
	for (int i = 0; i < 3; i++)
		force[i] = n_of(within[i]);
	if (v_direction(unit, account->way)) {
		unpaid = leave_out(&account->late, numbers->account, unit, late, force);
		unpaid = leave_out(&account->all, numbers->account, unit, force, force) ||
			 unpaid;
	}
	v_copy(account->late.last, late);
	v_copy(account->all.last, force);
	if (!unpaid)
		return;
	v_copy(tick->command, force);
	tick->flags |= INCISE_TICK_UNPAID;
}

/*
 * The last word on a force: never larger than a limit, never changing faster than one, never anything but
 * numbers. A force that is held keeps its direction, a change that is held keeps the direction of the change.
 *
 *        .---force---.
 *      .'      o asked
 *     /      .'
 *    |     o' rendered      a step of slew towards it,
 *    |    / last            inside the ball
 *     '.     0     .'
 *
 * Where both limits cannot be kept, for example when the largest force is made smaller, the force's limit is kept.
 */
void T(stage_limit)(const struct T(plan) *plan, struct T(state) *state,
		    struct T(tick) *tick)
{
	const struct T(numbers) *numbers = &plan->numbers;
	wide force[3], change[3];

	/* A target that is not finite asks for no force, and the force goes at the rate of the slew. */
	if (!v_is_number(tick->command)) {
		tick->flags |= INCISE_TICK_NOT_FINITE;
		for (int i = 0; i < 3; i++)
			tick->command[i] = 0;
	}
	for (int i = 0; i < 3; i++)
		force[i] = w_of(tick->command[i]);
	if (v_shorten(force, numbers->force))
		tick->flags |= INCISE_TICK_CLAMPED;
	for (int i = 0; i < 3; i++)
		change[i] = force[i] - state->last[i];
	if (v_shorten(change, numbers->slew)) {
		tick->flags |= INCISE_TICK_SLEWED;
		for (int i = 0; i < 3; i++)
			force[i] = state->last[i] + change[i];
		/* Between two forces within the limit, but for rounding. */
		v_shorten(force, numbers->force);
	}
	for (int i = 0; i < 3; i++)
		tick->command[i] = state->last[i] = n_of(force[i]);
}
