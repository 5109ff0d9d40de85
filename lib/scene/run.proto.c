// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The ticks of a plan in a kind of numbers: included by doubles.c and integers.c, behind their
 *
 *   OWN(plan)    plan, state and tick of this kind          STAGE    of a struct incise_stage_pair
 *   n_from(), d_from(), n_to(), d_to()                      conversions of numbers and directions
 *   D_LEAST      the smallest part of a direction          set_tip()  of struct incise_plan_ops
 */
static INCISE_REALTIME void take_pose(struct incise_plan *plan, bool tube,
				      const struct incise_tracker_sample *sample,
				      int64_t now_ns)
{
	struct T(pose) pose = {
		.t_ns = sample->t_ns,
		.tool = (uint32_t)plan->wanted | (tube ? INCISE_FIXED_POSE_TUBE : 0) |
			(plan->fading || plan->off ? INCISE_FIXED_POSE_FADE : 0),
	};
	double size = 0;

	if (!v3_finite(sample->position_mm))
		return;
	for (int i = 0; i < 3; i++)
		pose.position[i] = n_from(sample->position_mm[i]);
	/* An invalid quaternion leaves the attitude as it was; 0 would be no pose. */
	for (int i = 0; i < 4; i++)
		size += fabs(sample->quaternion[i]);
	for (int i = 0; i < 4; i++)
		pose.quaternion[i] = isfinite(size) ? d_from(sample->quaternion[i]) : 0;
	if (!(pose.quaternion[0] > 0 || pose.quaternion[0] < 0))
		pose.quaternion[0] = D_LEAST;
	T(plan_pose)(&OWN(plan)->plan, &OWN(plan)->state, &pose, now_ns);
}

/* All that a tick found. */
static void finish_tick(struct incise_plan *plan, struct incise_tick *tick)
{
	const struct T(tick) *from = &OWN(plan)->tick;

	for (int i = 0; i < 4; i++)
		tick->quaternion[i] = d_to(from->attitude[i]);
	for (int i = 0; i < 3; i++) {
		tick->position_mm[i] = n_to(from->position[i]);
		tick->tool_mm[i] = n_to(from->tool[i]);
		tick->proxy_mm[i] = n_to(from->proxy[i]);
		tick->normal[i] = d_to(from->normal[i]);
		tick->command_N[i] = plan->last_N[i] = n_to(from->command[i]);
	}
	tick->depth_mm = n_to(from->depth);
	tick->velocity_mm_s = n_to(from->speed);
	tick->phase = (enum incise_phase)from->phase;
	tick->tool = plan->held = (enum incise_tool)from->held;
	/* The flags of the tube's station take the place of the scalpel's. */
	if (tick->tool == INCISE_TOOL_TUBE && OWN(plan)->plan.numbers.tube)
		tick->flags = plan->poses.tube_unusable ? INCISE_TICK_UNUSABLE : 0;
	tick->flags |= from->flags;
}

/* A tick at which the front met new tissue, where its texture is not 0. */
static void feel(struct incise_plan *plan, const struct incise_tick *tick)
{
	double texture_N = n_to(OWN(plan)->tick.textured);
	double tau = n_to(OWN(plan)->state.tooth) - 1;

	if (fabs(texture_N) > 0 && fabs(tau) > 0)
		incise_plan_feel(plan, tick, texture_N / tau, texture_N);
}

/* Inlined into both, so that the tick without times does not pay for them. */
static inline __attribute__((always_inline)) int run_stages(struct incise_plan *plan,
							    int64_t t_ns,
							    struct incise_tick *tick,
							    int64_t *stage_ns)
{
	bool found = false; /* since the tick was filled in */

	*tick = (struct incise_tick){.t_ns = t_ns, .tool = plan->held};
	if (plan->fault)
		return incise_plan_fail(plan, tick, plan->fault);
	OWN(plan)->tick = (struct T(tick)){.t_ns = t_ns};
	for (int i = 0; i < plan->n_stages; i++) {
		const struct incise_stage *stage = &plan->stage[i];
		int64_t begin = stage_ns ? incise_monotonic_ns() : 0;
		int rc = 0;

		if (!stage->run) {
			found = true;
			stage->numbers.STAGE(&OWN(plan)->plan, &OWN(plan)->state,
					     &OWN(plan)->tick);
		} else {
			if (found)
				finish_tick(plan, tick);
			found = false;
			rc = stage->run(plan, tick);
		}
		if (stage_ns)
			stage_ns[i] = incise_monotonic_ns() - begin;
		if (rc)
			return incise_plan_fail(plan, tick, rc);
	}
	if (found)
		finish_tick(plan, tick);
	if (plan->texture)
		feel(plan, tick);
	return 0;
}

static INCISE_REALTIME int run_tick(struct incise_plan *plan, int64_t t_ns,
				    struct incise_tick *tick, int64_t *stage_ns)
{
	return stage_ns ? run_stages(plan, t_ns, tick, stage_ns)
			: run_stages(plan, t_ns, tick, NULL);
}

static INCISE_REALTIME void hold_tool(struct incise_plan *plan)
{
	OWN(plan)->state.wanted = (int32_t)plan->wanted;
	OWN(plan)->state.fading = plan->fading || plan->off;
}

static INCISE_REALTIME bool has_faded(const struct incise_plan *plan)
{
	const struct T(state) *state = &OWN(plan)->state;

	/* A gain of 0 asks for nothing; the slew may still be on its way there. */
	return !(state->gain > 0) && v3_length(plan->last_N) == 0;
}

static INCISE_REALTIME void zero_force(struct incise_plan *plan)
{
	for (int i = 0; i < 3; i++)
		OWN(plan)->state.last[i] = 0;
}

static INCISE_REALTIME int32_t *puncture_of(struct incise_plan *plan)
{
	return &OWN(plan)->state.membrane.punctured;
}

/* A plan without handle and tube has no cuts. */
static struct T(incision) *cuts_of(struct incise_plan *plan)
{
	return plan->inserts ? T_PART(&OWN(plan)->state, incision) : NULL;
}

static INCISE_REALTIME bool get_cut(struct incise_plan *plan, int i,
				    struct incise_cut *cut)
{
	const struct T(incision) *cuts = cuts_of(plan);
	const struct T(cut) *from;

	if (!cuts || i < 0 || i >= cuts->n)
		return false;
	from = &cuts->cut[i];
	for (int k = 0; k < 3; k++) {
		cut->at_mm[k] = n_to(from->at_mm[k]);
		cut->along[k] = d_to(from->along[k]);
		cut->side[k] = d_to(from->side[k]);
		cut->normal[k] = d_to(from->normal[k]);
	}
	cut->from_mm = n_to(from->from_mm);
	cut->to_mm = n_to(from->to_mm);
	cut->incision = from->incision;
	for (int k = 0; k < INCISE_CUT_PLACES; k++) {
		cut->place[k].depth_mm = (float)n_to(from->place[k].depth_mm);
		cut->place[k].open_mm = (float)n_to(from->place[k].open_mm);
	}
	return true;
}

static INCISE_REALTIME void clear_cuts(struct incise_plan *plan)
{
	struct T(incision) *cuts = cuts_of(plan);

	if (!cuts)
		return;
	cuts->n = 0;
	T(incision_leave)(cuts);
}

static INCISE_REALTIME bool add_cut(struct incise_plan *plan,
				    const struct incise_cut *cut)
{
	struct T(incision) *cuts = cuts_of(plan);
	struct T(cut) *to;

	if (!cuts || cuts->n >= OWN(plan)->plan.numbers.incision.cuts_most)
		return false;
	to = &cuts->cut[cuts->n++];
	for (int k = 0; k < 3; k++) {
		to->at_mm[k] = n_from(cut->at_mm[k]);
		to->along[k] = d_from(cut->along[k]);
		to->side[k] = d_from(cut->side[k]);
		to->normal[k] = d_from(cut->normal[k]);
	}
	to->from_mm = n_from(cut->from_mm);
	to->to_mm = n_from(cut->to_mm);
	to->incision = cut->incision;
	for (int k = 0; k < INCISE_CUT_PLACES; k++) {
		to->place[k].depth_mm = (stored)n_from((double)cut->place[k].depth_mm);
		to->place[k].open_mm = (stored)n_from((double)cut->place[k].open_mm);
	}
	return true;
}

const struct incise_plan_ops T(ops) = {
	.tick = run_tick,
	.take_pose = take_pose,
	.hold = hold_tool,
	.faded = has_faded,
	.zero = zero_force,
	.set_tip = set_tip,
	.punctured = puncture_of,
	.cut = get_cut,
	.clear_cuts = clear_cuts,
	.add_cut = add_cut,
};
