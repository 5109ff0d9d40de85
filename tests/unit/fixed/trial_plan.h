/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Random good plans, and a hand that moves a tool over their surface, for unit tests and a fuzzer:
 * the same from a seed on each machine. A plan has any surface, reaction and membrane, any forces, up to three axes, a
 * texture or none; one in four has numbers anywhere in their ranges, at the ends of them too.
 *
 *   incise_fx_trial_plan() ─▶ incise_fixed_plan_open() ─▶ _begin()
 *   incise_fx_trial_hand() ─▶ incise_fixed_plan_pose() ─▶ _tick()
 */
#ifndef INCISE_FX_TRIAL_PLAN_H
#define INCISE_FX_TRIAL_PLAN_H

#include "../../../lib/fixed/layout.h"
#include "../../../lib/fixed/plan.h"
#include "../../../driver/kunit/trial.h"
#include "../../../lib/fixed/vector.h"

/* The longest plan: the header, a model of 17 × 17 knots, a grid of 33 × 33, a texture. */
#define INCISE_FX_TRIAL_CELLS 16
#define INCISE_FX_TRIAL_KNOTS 33
#define INCISE_FX_TRIAL_PLAN_SIZE                                                    \
	(sizeof(struct incise_fixed_plan_header) + sizeof(struct incise_fx_header) + \
	 8 * (INCISE_FX_TRIAL_CELLS + 1) * (INCISE_FX_TRIAL_CELLS + 1) +             \
	 4 * INCISE_FX_TRIAL_KNOTS * INCISE_FX_TRIAL_KNOTS +                         \
	 sizeof(struct incise_fixed_texture) + 24)

struct incise_fx_trial {
	uint64_t seed;
	bool wide; /* numbers anywhere in their ranges */
};

static inline int32_t incise_fx_trial_in(struct incise_fx_trial *t, int32_t least,
					 int32_t most)
{
	uint64_t range = (uint64_t)((int64_t)most - least) + 1;

	return (int32_t)(least +
			 (int64_t)((incise_fx_trial_next(&t->seed) >> 32) * range >> 32));
}

static inline bool incise_fx_trial_one_in(struct incise_fx_trial *t, int32_t n)
{
	return !incise_fx_trial_in(t, 0, n - 1);
}

/* A number from low to high, or with `wide` from least to most, the ends more often. */
static inline int32_t incise_fx_trial_of(struct incise_fx_trial *t, int32_t low,
					 int32_t high, int32_t least, int32_t most)
{
	if (!t->wide)
		return incise_fx_trial_in(t, low, high);
	switch (incise_fx_trial_in(t, 0, 3)) {
	case 0:
		return least;
	case 1:
		return most;
	case 2:
		return incise_fx_trial_in(t, least, most);
	default:
		return incise_fx_trial_in(t, low, high);
	}
}

static inline void incise_fx_trial_unit(struct incise_fx_trial *t, int32_t *unit, int n)
{
	int64_t any[4];

	do {
		for (int i = 0; i < n; i++)
			any[i] = incise_fx_trial_number(&t->seed);
	} while (!incise_fx_unit(unit, any, n, 1 << 20));
}

/* Two more, across it and each other, to the last bit. */
static inline void incise_fx_trial_across(struct incise_fx_trial *t,
					  const int32_t unit[3], int32_t side[3],
					  int32_t third[3])
{
	int32_t any[3], cross[3];
	int64_t wide[3];

	do {
		incise_fx_trial_unit(t, any, 3);
		incise_fx_cross(cross, any, unit);
		for (int i = 0; i < 3; i++)
			wide[i] = cross[i];
	} while (!incise_fx_unit(side, wide, 3, 1 << 28));
	incise_fx_cross(cross, unit, side);
	for (int i = 0; i < 3; i++)
		wide[i] = cross[i];
	incise_fx_unit(third, wide, 3, 0);
}

#define INCISE_FX_TRIAL_MM (1 << 16)

static inline void incise_fx_trial_filter(struct incise_fx_trial *t,
					  struct incise_fixed_filter *filter)
{
	const int32_t most = INCISE_FIXED_AHEAD_MAX_NS;

	*filter = (struct incise_fixed_filter){
		.alpha = incise_fx_trial_of(t, 1 << 28, 1 << 30, 0, 1 << 30),
		.beta = incise_fx_trial_of(t, 0, 1 << 22, 0, INT32_MAX),
		.gamma = incise_fx_trial_of(t, 0, 1 << 21, 0, INT32_MAX),
		.period_ns = incise_fx_trial_of(t, 4000000, 20000000,
						INCISE_FIXED_PERIOD_MIN_NS,
						INCISE_FIXED_PERIOD_MAX_NS),
		.latency_ns = incise_fx_trial_of(t, 0, 20000000, 0, 1000000000),
		.gap_ns = incise_fx_trial_of(t, 20000000, 100000000, 0, most),
		.ahead_ns = incise_fx_trial_of(t, 20000000, 100000000, 0, most),
	};
}

static inline void incise_fx_trial_scalpel(struct incise_fx_trial *t,
					   struct incise_fixed_numbers *numbers)
{
	const int32_t far = 1 << 28, mm = INCISE_FX_TRIAL_MM;
	int32_t third[3];

	for (int i = 0; i < 3; i++)
		numbers->tip[i] = incise_fx_trial_of(t, -100 * mm, 100 * mm, -far, far);
	incise_fx_trial_unit(t, numbers->axis, 3);
	incise_fx_trial_across(t, numbers->axis, numbers->side, third);
	numbers->handle = incise_fx_trial_of(t, 0, 150 * mm, 0, far);
	numbers->inserts = incise_fx_trial_in(t, 0, 1);
	numbers->tube = numbers->inserts && incise_fx_trial_in(t, 0, 1);
	incise_fx_trial_unit(t, numbers->up, 3);
	numbers->leave = incise_fx_trial_of(t, 0, 2 * mm, 0, far);
	numbers->average_ticks =
		incise_fx_trial_of(t, 1, 16, 1, INCISE_FIXED_AVERAGE_MAX);
}

static inline void incise_fx_trial_shape(struct incise_fx_trial *t,
					 struct incise_fixed_shape *shape)
{
	const int32_t far = INCISE_FX_AWAY_MAX / 2, mm = INCISE_FX_TRIAL_MM;

	shape->kind = incise_fx_trial_in(t, INCISE_FIXED_PLANE, INCISE_FIXED_GRID);
	for (int i = 0; i < 3; i++)
		shape->point[i] = incise_fx_trial_of(t, -200 * mm, 200 * mm, -far, far);
	incise_fx_trial_unit(t, shape->normal, 3);
	if (shape->kind != INCISE_FIXED_CAPSULE)
		return;
	shape->length = incise_fx_trial_of(t, 0, 200 * mm, 0, far);
	shape->radius = incise_fx_trial_of(t, mm, 100 * mm, 1, far);
}

static inline void incise_fx_trial_grid(struct incise_fx_trial *t,
					struct incise_fixed_grid_frame *frame)
{
	const int32_t far = INCISE_FX_AWAY_MAX / 2, mm = INCISE_FX_TRIAL_MM;

	for (int i = 0; i < 3; i++)
		frame->origin[i] = incise_fx_trial_of(t, -200 * mm, 200 * mm, -far, far);
	incise_fx_trial_unit(t, frame->axis[0], 3);
	incise_fx_trial_across(t, frame->axis[0], frame->axis[1], frame->axis[2]);
	frame->cell_shift = incise_fx_trial_of(t, 14, 18, 8, 18);
	frame->columns =
		incise_fx_trial_of(t, 4, INCISE_FX_TRIAL_KNOTS, 2, INCISE_FX_TRIAL_KNOTS);
	frame->rows =
		incise_fx_trial_of(t, 4, INCISE_FX_TRIAL_KNOTS, 2, INCISE_FX_TRIAL_KNOTS);
	frame->reach = incise_fx_trial_of(t, 5 * mm, 50 * mm, 0, 1 << 28);
}

/* The sum of a walk along the first row and one along the first column: as steep as it may be. */
static inline void incise_fx_trial_heights(struct incise_fx_trial *t,
					   const struct incise_fixed_grid_frame *frame,
					   int32_t *height)
{
	int32_t most = (t->wide ? INCISE_FIXED_GRID_SLOPE_MAX << frame->cell_shift
				: 1 << frame->cell_shift >> 2);
	int32_t n = frame->columns * frame->rows;

	height[0] = 0;
	for (int32_t k = 1; k < n; k++) {
		int32_t i = k % frame->columns, j = k / frame->columns;
		const int32_t *before = height + k - (i ? 1 : frame->columns);
		int32_t step = incise_fx_trial_in(t, -most, most);

		if (i && j)
			step = height[i] - height[i - 1];
		height[k] = *before + step;
	}
	for (int32_t k = 0; k < n; k++)
		height[k] = t->wide && incise_fx_trial_one_in(t, 64)
				    ? INCISE_FIXED_GRID_NONE
				    : incise_fx_int32(height[k]);
}

static inline void incise_fx_trial_tissue(struct incise_fx_trial *t,
					  struct incise_fixed_numbers *numbers)
{
	const int32_t one = 1 << 16, most = INT32_MAX;

	numbers->reaction = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->gain = incise_fx_trial_of(t, one / 2, 2 * one, 0, most);
	numbers->support = incise_fx_trial_of(t, one, 20 * one, 0, INCISE_FX_AWAY_MAX);
	numbers->beyond = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->plane = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->damping = incise_fx_trial_of(t, 0, 1 << 19, 0, most);
	numbers->insertion = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->aligned = incise_fx_trial_of(t, 0, one, 0, one);
	numbers->printed = incise_fx_trial_one_in(t, 4);
	numbers->spread = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->skin = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->skin_friction = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->fracture = incise_fx_trial_of(t, 0, one, 0, most);
	numbers->gives = incise_fx_trial_of(t, 0, 2 * one, 0, most);
	/* Without a model there is no front: the caller sets these back to 0. */
	numbers->unloading = incise_fx_trial_in(t, 0, 1)
				     ? incise_fx_trial_of(t, one / 8, 2 * one, 1, most)
				     : 0;
	numbers->friction = incise_fx_trial_of(t, 0, one / 2, 0, one);
}

static inline void incise_fx_trial_incision(struct incise_fx_trial *t,
					    struct incise_fixed_incision_setup *setup)
{
	const int32_t mm = INCISE_FX_TRIAL_MM, most = INCISE_FIXED_DEPTH_MAX;

	*setup = (struct incise_fixed_incision_setup){
		.cuts_most = incise_fx_trial_of(t, 0, INCISE_FIXED_CUTS_MAX, 0,
						INCISE_FIXED_CUTS_MAX),
		.cut_from = incise_fx_trial_of(t, 0, 2 * mm, 0, most),
		.stretch = incise_fx_trial_of(t, 0, 3 * mm, 0, most),
		.handle_width = incise_fx_trial_of(t, 5 * mm, 15 * mm, 0, most),
		.handle_thickness = incise_fx_trial_of(t, mm, 5 * mm, 0, most),
		.tube = incise_fx_trial_of(t, 3 * mm, 10 * mm, 0, most),
	};
}

static inline void incise_fx_trial_limits(struct incise_fx_trial *t,
					  struct incise_fixed_numbers *numbers)
{
	const int32_t one = 1 << 16;

	numbers->pose_age_ns = incise_fx_trial_of(t, 20000000, 100000000, 0, INT32_MAX);
	numbers->tick_ns = incise_fx_trial_of(t, 100000, 2000000, 50000, 20000000);
	numbers->small = incise_fx_trial_of(t, 0, one / 4, 0, INT32_MAX);
	numbers->ramp_ns = incise_fx_trial_of(t, 0, 50000000, 0, INT32_MAX);
	numbers->fade_ns = incise_fx_trial_of(t, 0, 100000000, 0, INT32_MAX);
	numbers->force = incise_fx_trial_of(t, one, 8 * one, 0, INCISE_FIXED_FORCE_MAX);
	numbers->slew = incise_fx_trial_of(t, one / 64, one, 1, INCISE_FIXED_FORCE_MAX);
}

/* Directions at right angles: each axis is its own dual. */
static inline void incise_fx_trial_axes(struct incise_fx_trial *t,
					struct incise_fixed_numbers *numbers)
{
	const int32_t far = INCISE_FX_AWAY_MAX / 2, mm = INCISE_FX_TRIAL_MM;
	int32_t direction[3][3];

	numbers->n_axes = incise_fx_trial_in(t, 1, INCISE_FIXED_AXES_MAX);
	incise_fx_trial_unit(t, direction[0], 3);
	incise_fx_trial_across(t, direction[0], direction[1], direction[2]);
	for (int i = 0; i < numbers->n_axes; i++) {
		struct incise_fixed_axis *axis = &numbers->axes[i];

		incise_fx_copy(axis->direction, direction[i]);
		for (int k = 0; k < 3; k++)
			axis->dual[k] = incise_fx_trial_of(t, direction[i][k] / 64,
							   direction[i][k] / 64,
							   INT32_MIN, INT32_MAX);
		axis->compliance = incise_fx_trial_of(t, 1 << 19, 4 << 20, 1, INT32_MAX);
		axis->steps_per_mm =
			incise_fx_trial_of(t, 10 << 16, 800 << 16, 1, INT32_MAX);
		axis->origin = incise_fx_trial_of(t, -200 * mm, 200 * mm, -far, far);
		axis->travel = incise_fx_trial_of(t, 10 * mm, 400 * mm, 0, far);
		axis->rest = incise_fx_trial_in(t, 0, axis->travel);
	}
}

/* A table of forces by depth, or by depth and speed, that rises. Returns its size. */
static inline uint32_t incise_fx_trial_model(struct incise_fx_trial *t, void *bytes)
{
	struct incise_fx_header *head = bytes;
	int32_t *value = (int32_t *)(void *)(head + 1);
	int32_t n = 1, rise = incise_fx_trial_in(t, 0, 1 << 22);
	uint32_t size;

	*head = (struct incise_fx_header){
		.version = incise_fx_le32(INCISE_FX_VERSION),
		.arithmetic = incise_fx_le32(INCISE_FIXED_FORCE),
		.n_inputs = incise_fx_le32((uint32_t)incise_fx_trial_in(t, 1, 2)),
		.n_rules = incise_fx_le32(1),
		.shift_a = incise_fx_int32(t->wide ? 17 : 24),
		.bound = incise_fx_le64(1),
		.data = incise_fx_le32(sizeof(*head)),
		.name = "trial",
		.output = "force",
	};
	for (int i = 0; i < 8; i++)
		head->magic[i] = INCISE_FX_MAGIC[i];
	for (int i = 0; i < (int)incise_fx_le32(head->n_inputs); i++) {
		int32_t cells = incise_fx_trial_in(t, 1, INCISE_FX_TRIAL_CELLS);

		head->input[i] = (struct incise_fx_input){
			.max = incise_fx_int32((cells << 16) - 1),
			.n_mfs = incise_fx_le32(1),
			.cell_shift = incise_fx_le32(16),
			.cells = incise_fx_le32((uint32_t)cells),
			.name = "in",
		};
		n *= cells + 1;
	}
	for (int32_t k = 0; k < n; k++)
		value[k] = t->wide ? incise_fx_trial_number(&t->seed)
				   : incise_fx_int32(k * (rise / n) * 16);
	size = (uint32_t)(sizeof(*head) + (uint32_t)n * sizeof(*value));
	head->size = incise_fx_le32(size);
	head->crc = incise_fx_le32(incise_fx_crc(
		(const uint8_t *)head + INCISE_FX_CRC_FROM, size - INCISE_FX_CRC_FROM));
	return size;
}

/* Make a plan's checksum that of its bytes. */
static inline void incise_fx_trial_seal(void *bytes, uint32_t size)
{
	struct incise_fixed_plan_header *head = bytes;

	head->crc = incise_fx_crc((const uint8_t *)bytes + INCISE_FIXED_PLAN_CRC_FROM,
				  size - INCISE_FIXED_PLAN_CRC_FROM);
}

/* The numbers of a plan, without those that a model or a grid adds. */
static inline void incise_fx_trial_numbers(struct incise_fx_trial *t,
					   struct incise_fixed_numbers *numbers)
{
	const int32_t mm = INCISE_FX_TRIAL_MM, far = INCISE_FX_AWAY_MAX / 2;

	*numbers = (struct incise_fixed_numbers){.bound = 1 << 16};
	incise_fx_trial_filter(t, &numbers->filter);
	incise_fx_trial_scalpel(t, numbers);
	incise_fx_trial_shape(t, &numbers->shape);
	if (numbers->shape.kind == INCISE_FIXED_GRID)
		incise_fx_trial_grid(t, &numbers->grid);
	incise_fx_trial_tissue(t, numbers);
	incise_fx_trial_incision(t, &numbers->incision);
	incise_fx_trial_limits(t, numbers);
	incise_fx_trial_axes(t, numbers);
	if (incise_fx_trial_in(t, 0, 1)) {
		struct incise_fixed_membrane *membrane = &numbers->membrane;

		for (int i = 0; i < 3; i++)
			membrane->point[i] =
				incise_fx_trial_of(t, -200 * mm, 200 * mm, -far, far);
		incise_fx_trial_unit(t, membrane->normal, 3);
		membrane->radius = incise_fx_trial_of(t, 5 * mm, 300 * mm, 0, 1 << 28);
		membrane->thickness = incise_fx_trial_of(t, 1, 8 * mm, 1, 1 << 28);
		membrane->stiffness = incise_fx_trial_of(t, mm / 8, mm, 0, INT32_MAX);
		membrane->back_wall = incise_fx_trial_of(t, mm, 20 * mm, 0, 1 << 28);
	}
}

/*
 * A good plan. @bytes: INCISE_FX_TRIAL_PLAN_SIZE of them, aligned to 8. Returns its size.
 */
static inline uint32_t incise_fx_trial_plan(uint64_t seed, void *bytes)
{
	struct incise_fx_trial t = {.seed = seed};
	struct incise_fixed_plan_header *head = bytes;
	uint32_t size = sizeof(*head);

	/* A seed is a small number as a rule, and its first numbers are like its neighbours'. */
	for (int i = 0; i < 8; i++)
		incise_fx_trial_next(&t.seed);
	t.wide = incise_fx_trial_one_in(&t, 4);
	*head = (struct incise_fixed_plan_header){
		.name = "trial.scene",
		.surface = "trial",
	};
	for (int i = 0; i < 8; i++)
		head->magic[i] = INCISE_FIXED_PLAN_MAGIC[i];
	incise_fx_trial_numbers(&t, &head->numbers);
	if (incise_fx_trial_in(&t, 0, 1)) {
		head->model_at = size;
		head->model_size = incise_fx_trial_model(&t, (uint8_t *)bytes + size);
		size += (head->model_size + 7) & ~7u;
		for (uint32_t i = head->model_at + head->model_size; i < size; i++)
			((uint8_t *)bytes)[i] = 0;
	} else {
		head->numbers.unloading = head->numbers.friction = 0;
	}
	if (head->numbers.shape.kind == INCISE_FIXED_GRID) {
		const struct incise_fixed_grid_frame *frame = &head->numbers.grid;

		head->heights_at = size;
		head->heights_size = 4 * (uint32_t)(frame->columns * frame->rows);
		incise_fx_trial_heights(&t, frame,
					(int32_t *)(void *)((uint8_t *)bytes + size));
		size += (head->heights_size + 7) & ~7u;
	}
	if (head->numbers.unloading && incise_fx_trial_one_in(&t, 2)) {
		head->texture_at = size;
		incise_fx_trial_texture(&t.seed,
					incise_fx_trial_in(&t, 0, INCISE_TEXTURE_MOST),
					(void *)((uint8_t *)bytes + size));
		size += sizeof(struct incise_fixed_texture);
	}
	head->size = size;
	head->version = incise_fixed_plan_version(head);
	incise_fx_trial_seal(bytes, size);
	return size;
}

/* --- a hand ---------------------------------------------------------------------------- */

/* Begins with a seed and {0}. */
struct incise_fx_trial_hand {
	struct incise_fx_trial t;
	int64_t t_ns;
	int32_t place[3]; /* near which the surface is touched */
	int32_t depth;
	int32_t quaternion[4];
	int32_t tool;
	int32_t moved; /* has been */
};

/* A place so far below the surface as near to @place as may be. */
static inline void incise_fx_trial_below(const struct incise_fixed_plan *plan,
					 int32_t place[3], int32_t depth)
{
	static const int32_t up[3] = {0, 0, INCISE_FIXED_UNIT};
	struct incise_fixed_touch touch;

	if (incise_fixed_shape_nearest(&plan->numbers.shape, &plan->grid, place, up,
				       &touch))
		incise_fx_add(place, touch.point, -depth, touch.normal);
}

/* Somewhere on the surface. */
static inline void incise_fx_trial_begin(struct incise_fx_trial_hand *hand,
					 const struct incise_fixed_plan *plan)
{
	const struct incise_fixed_grid_frame *frame = &plan->grid.frame;
	const int32_t mm = INCISE_FX_TRIAL_MM;
	int32_t near = 30 * mm;

	incise_fx_copy(hand->place, plan->numbers.shape.point);
	if (plan->numbers.shape.kind == INCISE_FIXED_GRID) {
		incise_fx_copy(hand->place, frame->origin);
		for (int i = 0; i < 2; i++)
			incise_fx_add(hand->place, hand->place,
				      incise_fx_trial_in(
					      &hand->t, 0,
					      ((i ? frame->rows : frame->columns) - 1)
						      << frame->cell_shift),
				      frame->axis[i]);
		near = 0;
	}
	for (int i = 0; i < 3; i++)
		hand->place[i] =
			incise_fx_hold32((int64_t)hand->place[i] +
					 incise_fx_trial_in(&hand->t, -near, near));
	hand->depth = incise_fx_trial_in(&hand->t, -10 * mm, 0);
	incise_fx_trial_unit(&hand->t, hand->quaternion, 4);
	hand->moved = true;
}

/* The pose with which the scalpel's tip is so deep. */
static inline void incise_fx_trial_hold(const struct incise_fx_trial_hand *hand,
					const struct incise_fixed_plan *plan,
					struct incise_fixed_pose *pose)
{
	int32_t end[3], arm[3];

	incise_fx_copy(end, hand->place);
	incise_fx_trial_below(plan, end, hand->depth);
	incise_fx_rotate(arm, hand->quaternion, plan->numbers.tip);
	*pose = (struct incise_fixed_pose){.t_ns = hand->t_ns,
					   .tool = (uint32_t)hand->tool};
	for (int i = 0; i < 4; i++)
		pose->quaternion[i] = hand->quaternion[i];
	for (int i = 0; i < 3; i++)
		pose->position[i] = incise_fx_hold32((int64_t)end[i] - arm[i]);
}

/* The next pose: a step aside and in depth, seldom another place, turn or tool. */
static inline void incise_fx_trial_hand(struct incise_fx_trial_hand *hand,
					const struct incise_fixed_plan *plan,
					struct incise_fixed_pose *pose)
{
	const int32_t mm = INCISE_FX_TRIAL_MM;
	struct incise_fx_trial *t = &hand->t;

	if (!hand->moved || incise_fx_trial_one_in(t, 256))
		incise_fx_trial_begin(hand, plan);
	hand->t_ns += incise_fx_trial_in(t, 1, 2 * plan->numbers.filter.period_ns);
	for (int i = 0; i < 3; i++)
		hand->place[i] = incise_fx_hold32((int64_t)hand->place[i] +
						  incise_fx_trial_in(t, -mm, mm));
	hand->depth += incise_fx_trial_in(t, -mm, mm + mm / 8);
	if (hand->depth > 25 * mm)
		hand->depth = -5 * mm;
	if (incise_fx_trial_one_in(t, 64))
		incise_fx_trial_unit(t, hand->quaternion, 4);
	if (incise_fx_trial_one_in(t, 64))
		hand->tool = incise_fx_trial_in(t, INCISE_TOOL_AUTO, INCISE_TOOL_TUBE);
	incise_fx_trial_hold(hand, plan, pose);
	if (plan->numbers.tube && incise_fx_trial_in(t, 0, 1))
		pose->tool |= INCISE_FIXED_POSE_TUBE;
	if (incise_fx_trial_one_in(t, 64))
		pose->tool |= INCISE_FIXED_POSE_FADE;
}

#endif
