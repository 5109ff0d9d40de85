// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Checks a plan in full: after this no pose makes a tick overflow, read outside of it or divide by
 * 0. The bounds that the products rest on stand beside them; here the numbers are kept to them.
 */
#include "layout.h"
#include "plan.h"
#include "vector.h"

/* Without errno.h, which a kernel does not have in this form. */
#define BAD (-EINVAL)
#define UNSUPPORTED (-EOPNOTSUPP)

#define ONE (1 << 16)
#define LENGTH_MAX (1 << 28) /* 4096 mm */
#define PLACE_MAX (INCISE_FX_AWAY_MAX / 2)
#define AGE_MAX_NS 10000000000

static bool in_range(int64_t v, int64_t least, int64_t most)
{
	return v >= least && v <= most;
}

static bool all_in_range(const int32_t *v, int n, int32_t most)
{
	for (int i = 0; i < n; i++)
		if (!in_range(v[i], -most, most))
			return false;
	return true;
}

static bool are_zero(const int32_t *v, int n)
{
	return all_in_range(v, n, 0);
}

bool incise_fixed_filter_good(const struct incise_fixed_filter *filter)
{
	return filter->alpha >= 0 && filter->alpha <= INCISE_FIXED_UNIT &&
	       filter->beta >= 0 && filter->gamma >= 0 &&
	       filter->period_ns >= INCISE_FIXED_PERIOD_MIN_NS &&
	       filter->period_ns <= INCISE_FIXED_PERIOD_MAX_NS &&
	       filter->latency_ns >= 0 && filter->latency_ns <= 1000000000 &&
	       filter->gap_ns >= 0 && filter->gap_ns <= INCISE_FIXED_AHEAD_MAX_NS &&
	       filter->ahead_ns >= 0 && filter->ahead_ns <= INCISE_FIXED_AHEAD_MAX_NS &&
	       !filter->reserved;
}

bool incise_fixed_incision_good(const struct incise_fixed_incision_setup *setup)
{
	const int32_t *length = &setup->cut_from;

	for (int i = 0; i < 5; i++)
		if (length[i] < 0 || length[i] > INCISE_FIXED_DEPTH_MAX)
			return false;
	return setup->cuts_most >= 0 && setup->cuts_most <= INCISE_FIXED_CUTS_MAX;
}

static bool is_scalpel(const struct incise_fixed_numbers *numbers)
{
	return all_in_range(numbers->tip, 3, LENGTH_MAX) &&
	       incise_fx_is_unit(numbers->axis, 3) &&
	       incise_fx_is_unit(numbers->side, 3) &&
	       in_range(numbers->handle, 0, LENGTH_MAX) &&
	       in_range(numbers->inserts, 0, 1) &&
	       in_range(numbers->tube, 0, numbers->inserts);
}

static bool is_surface(const struct incise_fixed_numbers *numbers)
{
	return incise_fixed_shape_good(&numbers->shape) &&
	       incise_fx_is_unit(numbers->up, 3) &&
	       in_range(numbers->leave, 0, LENGTH_MAX) &&
	       in_range(numbers->average_ticks, 1, INCISE_FIXED_AVERAGE_MAX);
}

static bool is_membrane(const struct incise_fixed_membrane *membrane)
{
	if (!membrane->thickness)
		return true;
	return membrane->stiffness >= 0 && all_in_range(membrane->point, 3, PLACE_MAX) &&
	       incise_fx_is_unit(membrane->normal, 3) &&
	       in_range(membrane->radius, 0, LENGTH_MAX) &&
	       in_range(membrane->thickness, 1, LENGTH_MAX) &&
	       in_range(membrane->back_wall, 0, LENGTH_MAX);
}

/* No spring pulls a tool in, and no damper drives it: no number of a force is below 0. */
#define FORCE(...)
#define NUMBER(row, i, member, ...) &&numbers->member >= 0
#define MORE(member)

static bool is_tissue(const struct incise_fixed_numbers *numbers)
{
	return numbers->gain >= 0 && in_range(numbers->support, 0, INCISE_FX_AWAY_MAX) &&
	       numbers->beyond >= 0 && in_range(numbers->friction, 0, ONE) &&
	       in_range(numbers->aligned, 0, ONE) && in_range(numbers->printed, 0, 1) &&
	       numbers->account >= 0 && in_range(numbers->upright, 0, ONE) &&
	       incise_fixed_incision_good(&numbers->incision) &&
	       is_membrane(&numbers->membrane)
#include "../tissue/forces.def"
		;
}

static bool are_limits(const struct incise_fixed_numbers *numbers)
{
	return numbers->small >= 0 && numbers->ramp_ns >= 0 && numbers->fade_ns >= 0 &&
	       in_range(numbers->force, 0, INCISE_FIXED_FORCE_MAX) &&
	       in_range(numbers->slew, 1, INCISE_FIXED_FORCE_MAX);
}

static bool is_axis(const struct incise_fixed_axis *axis)
{
	return incise_fx_is_unit(axis->direction, 3) && axis->compliance >= 1 &&
	       axis->steps_per_mm >= 1 && in_range(axis->origin, -PLACE_MAX, PLACE_MAX) &&
	       in_range(axis->travel, 0, PLACE_MAX) &&
	       in_range(axis->rest, 0, axis->travel) && !axis->reserved;
}

/* Number of inputs of a plan's model, -1 if they are not good; 2 at most where it does not say. */
static int count_inputs(int32_t inputs)
{
	uint32_t left = (uint32_t)inputs, found = 0;
	int n = 0;

	if (!inputs)
		return 2;
	for (; left; left >>= 4, n++) {
		uint32_t kind = left & 15;

		if (n == INCISE_FIXED_INPUTS_MAX || kind == INCISE_FIXED_INPUT_NONE ||
		    kind >= INCISE_FIXED_INPUT_KINDS || found >> kind & 1)
			return -1;
		found |= 1U << kind;
	}
	return n;
}

bool incise_fixed_numbers_good(const struct incise_fixed_numbers *numbers)
{
	if (numbers->bound < 0 || !in_range(numbers->pose_age_ns, 0, AGE_MAX_NS) ||
	    !in_range(numbers->tick_ns, 50000, 20000000) ||
	    !in_range(numbers->n_axes, 0, INCISE_FIXED_AXES_MAX) ||
	    !incise_fixed_filter_good(&numbers->filter) || !is_scalpel(numbers) ||
	    !is_surface(numbers) || !is_tissue(numbers) || !are_limits(numbers) ||
	    count_inputs(numbers->inputs) < 0 || numbers->phases ||
	    !are_zero(numbers->reserved,
		      sizeof(numbers->reserved) / sizeof(*numbers->reserved)))
		return false;
	for (int i = 0; i < numbers->n_axes; i++)
		if (!is_axis(&numbers->axes[i]))
			return false;
	return true;
}

bool incise_fixed_texture_good(const struct incise_fixed_texture *texture)
{
	if (!in_range(texture->step_shift, 8, 20) ||
	    !in_range(texture->most, 0, INCISE_TEXTURE_MOST) ||
	    !in_range(texture->factor_most, 1, INCISE_TEXTURE_FACTOR_MOST) ||
	    texture->reserved)
		return false;
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		if (!in_range(texture->factor[i], 1, texture->factor_most) ||
		    texture->start[i] >= INCISE_TEXTURE_KNOTS)
			return false;
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		if (!in_range(texture->knot[i], -texture->most, texture->most))
			return false;
	return true;
}

int64_t incise_fixed_plan_fade_ns(const struct incise_fixed_numbers *numbers)
{
	/* 2^28 · 2^25 */
	int64_t slews =
		div64_s64((int64_t)numbers->force + numbers->slew - 1, numbers->slew);

	return numbers->pose_age_ns + numbers->fade_ns + slews * numbers->tick_ns;
}

/* True if n bytes at an offset lie in the plan, behind its header, aligned; or if n is 0. */
static bool is_within_plan(uint32_t at, uint32_t n, uint32_t size)
{
	if (!n)
		return !at;
	return at >= sizeof(struct incise_fixed_plan_header) && at % 8 == 0 &&
	       at <= size && n <= size - at;
}

static int open_parts(struct incise_fixed_plan *plan, const uint8_t *bytes,
		      const struct incise_fixed_plan_header *head)
{
	int rc = 0;

	if (!is_within_plan(head->model_at, head->model_size, head->size) ||
	    !is_within_plan(head->heights_at, head->heights_size, head->size) ||
	    !is_within_plan(head->texture_at,
			    head->texture_at ? sizeof(*plan->texture) : 0, head->size) ||
	    !head->heights_size == (head->numbers.shape.kind == INCISE_FIXED_GRID))
		return BAD;
	plan->has_model = head->model_size > 0;
	if (plan->has_model)
		rc = incise_fixed_open(&plan->model, bytes + head->model_at,
				       head->model_size);
	if (!rc && plan->has_model &&
	    (plan->model.n_inputs > count_inputs(head->numbers.inputs) ||
	     (head->numbers.inputs &&
	      plan->model.n_inputs < count_inputs(head->numbers.inputs))))
		return BAD;
	if (!plan->has_model && head->numbers.inputs)
		return BAD;
	if (!rc && head->heights_size)
		rc = incise_fixed_grid_open(
			&plan->grid, &head->numbers.grid,
			(const int32_t *)(const void *)(bytes + head->heights_at),
			head->heights_size);
	if (!rc && head->numbers.unloading && !plan->has_model)
		return BAD;
	if (!rc && head->texture_at) {
		plan->texture = (const void *)(bytes + head->texture_at);
		/* A rise of it is as steep as the tissue unloads. */
		if (!head->numbers.unloading || !incise_fixed_texture_good(plan->texture))
			return BAD;
	}
	return rc;
}

#undef NUMBER
#undef MORE
#define NUMBER(...)
#define MORE(member) || numbers->member

uint32_t incise_fixed_plan_version(const struct incise_fixed_plan_header *head)
{
	const struct incise_fixed_numbers *numbers = &head->numbers;

	if (head->texture_at)
		return INCISE_FIXED_PLAN_VERSION_TEXTURE;
	if (numbers->account || numbers->upright
#include "../tissue/forces.def"
	)
		return INCISE_FIXED_PLAN_VERSION_MORE;
	return numbers->inputs ? INCISE_FIXED_PLAN_VERSION_INPUTS
			       : INCISE_FIXED_PLAN_VERSION;
}

int incise_fixed_plan_open(struct incise_fixed_plan *plan, const void *blob,
			   uint32_t size)
{
	const struct incise_fixed_plan_header *head = blob;
	const uint8_t *bytes = blob;

#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
	return UNSUPPORTED;
#endif
	if (size < sizeof(*head) || size > INCISE_FIXED_PLAN_SIZE_MAX)
		return BAD;
	for (int i = 0; i < 8; i++)
		if (head->magic[i] != INCISE_FIXED_PLAN_MAGIC[i])
			return BAD;
	if (head->version < INCISE_FIXED_PLAN_VERSION ||
	    head->version > INCISE_FIXED_PLAN_VERSION_TEXTURE)
		return UNSUPPORTED;
	if (head->version != incise_fixed_plan_version(head) || head->size != size ||
	    head->crc != incise_fx_crc(bytes + INCISE_FIXED_PLAN_CRC_FROM,
				       size - INCISE_FIXED_PLAN_CRC_FROM) ||
	    !incise_fx_is_name(head->name, sizeof(head->name)) ||
	    !incise_fx_is_name(head->surface, sizeof(head->surface)) ||
	    !incise_fixed_numbers_good(&head->numbers))
		return BAD;
	*plan = (struct incise_fixed_plan){.numbers = head->numbers};
	return open_parts(plan, bytes, head);
}
