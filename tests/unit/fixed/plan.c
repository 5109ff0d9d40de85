// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The check of plans: random good ones are accepted; with any one number beyond its range, any byte
 * changed, cut short or of another version they are refused.
 */
#include "../unit.h"
#include "trial_plan.h"

#define PLANS 400

static uint8_t *plan_bytes(uint64_t seed, uint32_t *size)
{
	uint8_t *bytes = calloc(1, INCISE_FX_TRIAL_PLAN_SIZE);

	assert_non_null(bytes);
	*size = incise_fx_trial_plan(seed, bytes);
	assert_true(*size <= INCISE_FX_TRIAL_PLAN_SIZE);
	return bytes;
}

static struct incise_fixed_plan_header *head_of(uint8_t *bytes)
{
	return (struct incise_fixed_plan_header *)(void *)bytes;
}

static int open_sealed(uint8_t *bytes, uint32_t size)
{
	struct incise_fixed_plan plan;

	incise_fx_trial_seal(bytes, size);
	return incise_fixed_plan_open(&plan, bytes, size);
}

/* All kinds of surfaces, with a model and without, as wide as may be and not. */
TEST(test_good_plans_are_accepted)
{
	int kinds[3] = {0}, models = 0, membranes = 0, tubes = 0, axes[4] = {0},
	    textures = 0;

	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		struct incise_fixed_plan plan;
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);

		assert_int_equal(incise_fixed_plan_open(&plan, bytes, size), 0);
		assert_true(incise_fixed_plan_fade_ns(&plan.numbers) >=
			    plan.numbers.pose_age_ns);
		kinds[plan.numbers.shape.kind]++;
		models += plan.has_model;
		textures += !!plan.texture;
		membranes += plan.numbers.membrane.thickness > 0;
		tubes += plan.numbers.tube;
		axes[plan.numbers.n_axes]++;
		free(bytes);
	}
	assert_true(kinds[0] && kinds[1] && kinds[2] && models && membranes && tubes &&
		    axes[1] && axes[2] && axes[3] && textures);
}

#define AT(field) offsetof(struct incise_fixed_numbers, field)

enum { ANY, CAPSULE, GRID, MEMBRANE, INSERTS };

/* A number and the ends of its range: both are accepted where they fit the others, and one more is not. */
static const struct {
	size_t at;
	int64_t least, most;
	int needs;
} ranges[] = {
	{AT(tick_ns), 50000, 20000000, ANY},
	{AT(n_axes), 0, INCISE_FIXED_AXES_MAX, ANY},
	{AT(filter.alpha), 0, 1 << 30, ANY},
	{AT(filter.beta), 0, INT32_MAX, ANY},
	{AT(filter.gamma), 0, INT32_MAX, ANY},
	{AT(filter.period_ns), INCISE_FIXED_PERIOD_MIN_NS, INCISE_FIXED_PERIOD_MAX_NS,
	 ANY},
	{AT(filter.latency_ns), 0, 1000000000, ANY},
	{AT(filter.gap_ns), 0, INCISE_FIXED_AHEAD_MAX_NS, ANY},
	{AT(filter.ahead_ns), 0, INCISE_FIXED_AHEAD_MAX_NS, ANY},
	{AT(filter.reserved), 0, 0, ANY},
	{AT(tip[0]), -(1 << 28), 1 << 28, ANY},
	{AT(tip[2]), -(1 << 28), 1 << 28, ANY},
	{AT(handle), 0, 1 << 28, ANY},
	{AT(inserts), 0, 1, INSERTS},
	{AT(tube), 0, 1, INSERTS},
	{AT(shape.point[1]), -(1 << 29), 1 << 29, ANY},
	{AT(shape.length), 0, 1 << 29, CAPSULE},
	{AT(shape.radius), 1, 1 << 29, CAPSULE},
	{AT(shape.reserved), 0, 0, ANY},
	{AT(grid.origin[0]), -(1 << 29), 1 << 29, GRID},
	{AT(grid.reach), 0, 1 << 28, GRID},
	{AT(leave), 0, 1 << 28, ANY},
	{AT(average_ticks), 1, INCISE_FIXED_AVERAGE_MAX, ANY},
	{AT(reaction), 0, INT32_MAX, ANY},
	{AT(gain), 0, INT32_MAX, ANY},
	{AT(support), 0, 1 << 30, ANY},
	{AT(beyond), 0, INT32_MAX, ANY},
	{AT(friction), 0, 1 << 16, ANY},
	{AT(plane), 0, INT32_MAX, ANY},
	{AT(damping), 0, INT32_MAX, ANY},
	{AT(insertion), 0, INT32_MAX, ANY},
	{AT(aligned), 0, 1 << 16, ANY},
	{AT(printed), 0, 1, ANY},
	{AT(spread), 0, INT32_MAX, ANY},
	{AT(incision.cuts_most), 0, INCISE_FIXED_CUTS_MAX, ANY},
	{AT(incision.cut_from), 0, INCISE_FIXED_DEPTH_MAX, ANY},
	{AT(incision.stretch), 0, INCISE_FIXED_DEPTH_MAX, ANY},
	{AT(incision.handle_width), 0, INCISE_FIXED_DEPTH_MAX, ANY},
	{AT(incision.handle_thickness), 0, INCISE_FIXED_DEPTH_MAX, ANY},
	{AT(incision.tube), 0, INCISE_FIXED_DEPTH_MAX, ANY},
	{AT(membrane.point[2]), -(1 << 29), 1 << 29, MEMBRANE},
	{AT(membrane.radius), 0, 1 << 28, MEMBRANE},
	{AT(membrane.thickness), 0, 1 << 28, MEMBRANE},
	{AT(membrane.stiffness), 0, INT32_MAX, MEMBRANE},
	{AT(membrane.back_wall), 0, 1 << 28, MEMBRANE},
	{AT(small), 0, INT32_MAX, ANY},
	{AT(ramp_ns), 0, INT32_MAX, ANY},
	{AT(fade_ns), 0, INT32_MAX, ANY},
	{AT(force), 0, INCISE_FIXED_FORCE_MAX, ANY},
	{AT(slew), 1, INCISE_FIXED_FORCE_MAX, ANY},
	{AT(axes[0].compliance), 1, INT32_MAX, ANY},
	{AT(axes[0].steps_per_mm), 1, INT32_MAX, ANY},
	{AT(axes[0].origin), -(1 << 29), 1 << 29, ANY},
	{AT(axes[0].reserved), 0, 0, ANY},
	{AT(phases), 0, 0, ANY},
	{AT(skin), 0, INT32_MAX, ANY},
	{AT(skin_friction), 0, INT32_MAX, ANY},
	{AT(fracture), 0, INT32_MAX, ANY},
	{AT(gives), 0, INT32_MAX, ANY},
	{AT(reserved[0]), 0, 0, ANY},
	{AT(account), 0, INT32_MAX, ANY},
	{AT(upright), 0, 1 << 16, ANY},
};

static bool has(const struct incise_fixed_numbers *numbers, int needs)
{
	switch (needs) {
	case CAPSULE:
		return numbers->shape.kind == INCISE_FIXED_CAPSULE;
	case GRID:
		return numbers->shape.kind == INCISE_FIXED_GRID;
	case MEMBRANE:
		return numbers->membrane.thickness > 0;
	case INSERTS:
		return numbers->inserts && !numbers->tube;
	}
	return numbers->n_axes == INCISE_FIXED_AXES_MAX;
}

static int with(uint8_t *bytes, uint32_t size, size_t at, int64_t value)
{
	uint8_t *place = bytes + offsetof(struct incise_fixed_plan_header, numbers) + at;
	int32_t number = (int32_t)value, was;
	int rc;

	memcpy(&was, place, sizeof(was));
	memcpy(place, &number, sizeof(number));
	head_of(bytes)->version = incise_fixed_plan_version(head_of(bytes));
	rc = open_sealed(bytes, size);
	memcpy(place, &was, sizeof(was));
	head_of(bytes)->version = incise_fixed_plan_version(head_of(bytes));
	return rc;
}

TEST(test_ends_of_ranges)
{
	for (size_t k = 0; k < sizeof(ranges) / sizeof(*ranges); k++) {
		uint8_t *bytes = NULL;
		uint32_t size = 0;
		int bad = 0;

		for (uint64_t seed = 1;
		     !bytes || !has(&head_of(bytes)->numbers, ranges[k].needs); seed++) {
			free(bytes);
			bytes = plan_bytes(seed, &size);
		}
		bad |= with(bytes, size, ranges[k].at, ranges[k].least);
		bad |= with(bytes, size, ranges[k].at, ranges[k].most);
		if (bad)
			fail_msg("number at %zu: an end of its range is refused",
				 ranges[k].at);
		if (ranges[k].least > INT32_MIN)
			bad |= !with(bytes, size, ranges[k].at, ranges[k].least - 1);
		if (ranges[k].most < INT32_MAX)
			bad |= !with(bytes, size, ranges[k].at, ranges[k].most + 1);
		bad |= ranges[k].least > INT32_MIN &&
		       !with(bytes, size, ranges[k].at, INT32_MIN);
		if (bad)
			fail_msg("number at %zu: beyond its range it is accepted",
				 ranges[k].at);
		free(bytes);
	}
}

/* A direction that is none: shorter, longer, or all 0. */
TEST(test_directions_are_unit)
{
	static const struct {
		size_t at;
		int n, needs;
	} directions[] = {
		{AT(axis), 3, ANY},
		{AT(side), 3, ANY},
		{AT(up), 3, ANY},
		{AT(shape.normal), 3, CAPSULE},
		{AT(grid.axis[0]), 3, GRID},
		{AT(grid.axis[1]), 3, GRID},
		{AT(grid.axis[2]), 3, GRID},
		{AT(membrane.normal), 3, MEMBRANE},
		{AT(axes[0].direction), 3, ANY},
		{AT(axes[2].direction), 3, ANY},
	};

	for (size_t k = 0; k < sizeof(directions) / sizeof(*directions); k++) {
		uint8_t *bytes = NULL;
		uint32_t size = 0;

		for (uint64_t seed = 1;
		     !bytes || !has(&head_of(bytes)->numbers, directions[k].needs);
		     seed++) {
			free(bytes);
			bytes = plan_bytes(seed, &size);
		}
		for (int i = 0; i < 3; i++) {
			const size_t at = directions[k].at + (size_t)i * 4;
			int32_t was;

			memcpy(&was,
			       bytes +
				       offsetof(struct incise_fixed_plan_header,
						numbers) +
				       at,
			       4);
			assert_int_equal(with(bytes, size, at, INT32_MIN), -EINVAL);
			assert_int_equal(with(bytes, size, at, INT32_MAX), -EINVAL);
			if (abs(was) > 1 << 28)
				assert_int_equal(with(bytes, size, at, was / 2), -EINVAL);
		}
		free(bytes);
	}
}

/* Numbers that are good one by one. */
TEST(test_numbers_fit_together)
{
	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);
		const struct incise_fixed_numbers *n = &head_of(bytes)->numbers;

		assert_int_equal(with(bytes, size, AT(axes[0].rest),
				      (int64_t)n->axes[0].travel + 1),
				 -EINVAL);
		assert_int_equal(with(bytes, size, AT(axes[0].travel),
				      n->axes[0].rest - 1),
				 -EINVAL);
		if (!n->inserts)
			assert_int_equal(with(bytes, size, AT(tube), 1), -EINVAL);
		if (!head_of(bytes)->model_size)
			assert_int_equal(with(bytes, size, AT(unloading), 1), -EINVAL);
		/* A grid without heights, or heights without a grid. */
		assert_int_equal(with(bytes, size, AT(shape.kind),
				      n->shape.kind == INCISE_FIXED_GRID
					      ? INCISE_FIXED_PLANE
					      : INCISE_FIXED_GRID),
				 -EINVAL);
		assert_int_equal(with(bytes, size, AT(shape.kind), INCISE_FIXED_GRID + 1),
				 -EINVAL);
		if (n->shape.kind == INCISE_FIXED_GRID) {
			assert_int_equal(with(bytes, size, AT(grid.columns),
					      n->grid.columns + 1),
					 -EINVAL);
			assert_int_equal(with(bytes, size, AT(grid.cell_shift), 19),
					 -EINVAL);
			assert_int_equal(with(bytes, size, AT(grid.cell_shift), 7),
					 -EINVAL);
		}
		free(bytes);
	}
}

/* A height that is a cliff, or too high; one that is none is good. */
TEST(test_heights)
{
	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);
		const struct incise_fixed_plan_header *head = head_of(bytes);
		int32_t *height = (int32_t *)(void *)(bytes + head->heights_at), was;

		if (head->numbers.shape.kind == INCISE_FIXED_GRID) {
			was = height[1];
			height[1] = INCISE_FIXED_GRID_NONE;
			assert_int_equal(open_sealed(bytes, size), 0);
			height[1] = (1 << 28) + 1;
			assert_int_equal(open_sealed(bytes, size), -EINVAL);
			if (height[0] != INCISE_FIXED_GRID_NONE) {
				height[1] = height[0] +
					    (INCISE_FIXED_GRID_SLOPE_MAX
					     << head->numbers.grid.cell_shift) +
					    1;
				assert_int_equal(open_sealed(bytes, size), -EINVAL);
			}
			height[1] = was;
		}
		free(bytes);
	}
}

TEST(test_bytes)
{
	struct incise_fixed_plan plan;

	for (uint64_t seed = 1; seed <= 20; seed++) {
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);
		struct incise_fixed_plan_header *head = head_of(bytes);

		/* Any bit, without a checksum that is right again. */
		for (uint32_t at = 0; at < size; at += 1 + at / 64) {
			bytes[at] ^= (uint8_t)(1u << at % 8);
			assert_int_not_equal(incise_fixed_plan_open(&plan, bytes, size),
					     0);
			bytes[at] ^= (uint8_t)(1u << at % 8);
		}
		for (uint32_t n = 0; n < size; n += 1 + n / 64)
			assert_int_not_equal(incise_fixed_plan_open(&plan, bytes, n), 0);
		head->version += 8;
		assert_int_equal(open_sealed(bytes, size), -ENOTSUP);
		head->version -= 8;
		head->size--;
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		head->size++;
		memset(head->name, 'x', sizeof(head->name));
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		head->name[sizeof(head->name) - 1] = 0;
		assert_int_equal(open_sealed(bytes, size), 0);
		head->name[3] = '\n';
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		head->name[3] = 'x';
		head->surface[0] = '\x1b';
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		free(bytes);
	}
}

/* Parts lie behind the header and before the end, at multiples of 8. */
TEST(test_parts)
{
	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		uint32_t size, at;
		uint8_t *bytes = plan_bytes(seed, &size);
		struct incise_fixed_plan_header *head = head_of(bytes);
		uint32_t *part[] = {&head->model_at, &head->heights_at,
				    &head->texture_at};

		for (int i = 0; i < 3; i++) {
			const uint32_t bad[] = {at = *part[i],	at + 4,
						at - 4,		0,
						size,		size - 8,
						UINT32_MAX - 7, 8};

			if (!at)
				continue;
			for (size_t k = 1; k < sizeof(bad) / sizeof(*bad); k++) {
				/* The last part may begin elsewhere only if it ends within. */
				*part[i] = bad[k];
				assert_int_equal(open_sealed(bytes, size), -EINVAL);
			}
			*part[i] = at;
			assert_int_equal(open_sealed(bytes, size), 0);
		}
		free(bytes);
	}
}

/* The model's inputs: known ones, once each, as many as it has, in a version of their own. */
TEST(test_inputs)
{
	const int32_t depth = INCISE_FIXED_INPUT_DEPTH, tilt = INCISE_FIXED_INPUT_TILT,
		      time = INCISE_FIXED_INPUT_TIME;
	bool seen[3] = {false};

	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);
		struct incise_fixed_plan_header *head = head_of(bytes);
		const int32_t inputs[] = {depth,
					  time | depth << 4,
					  depth | tilt << 4 | time << 8,
					  depth | depth << 4,
					  depth << 4,
					  INCISE_FIXED_INPUT_KINDS,
					  -1};
		struct incise_fixed_plan plan;
		int n = 0;

		/* So has a texture. */
		if (head->texture_at) {
			assert_int_equal(head->version,
					 INCISE_FIXED_PLAN_VERSION_TEXTURE);
			head->version = INCISE_FIXED_PLAN_VERSION_MORE;
			assert_int_equal(open_sealed(bytes, size), -EINVAL);
			head->texture_at = 0;
			head->version = incise_fixed_plan_version(head);
		}
		/* Forces that came later have a version of their own, which no other takes. */
		if (head->numbers.skin || head->numbers.skin_friction ||
		    head->numbers.fracture || head->numbers.gives) {
			assert_int_equal(head->version, INCISE_FIXED_PLAN_VERSION_MORE);
			head->version = INCISE_FIXED_PLAN_VERSION;
			assert_int_equal(open_sealed(bytes, size), -EINVAL);
			head->numbers.skin = head->numbers.skin_friction = 0;
			head->numbers.fracture = head->numbers.gives = 0;
		}
		assert_int_equal(open_sealed(bytes, size), 0);
		assert_int_equal(incise_fixed_plan_open(&plan, bytes, size), 0);
		if (plan.has_model)
			n = plan.model.n_inputs;
		assert_in_range(n, 0, 2);
		seen[n] = true;
		head->version = INCISE_FIXED_PLAN_VERSION_INPUTS;
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		for (int k = 0; k < (int)(sizeof(inputs) / sizeof(*inputs)); k++) {
			head->numbers.inputs = inputs[k];
			assert_int_equal(open_sealed(bytes, size),
					 k < 2 && k + 1 == n ? 0 : -EINVAL);
		}
		head->version = INCISE_FIXED_PLAN_VERSION;
		head->numbers.inputs = depth;
		assert_int_equal(open_sealed(bytes, size), -EINVAL);
		free(bytes);
	}
	assert_true(seen[0] && seen[1] && seen[2]);
}

/* Each number of a texture within its range, and only where a front dissipates. */
TEST(test_texture)
{
	int tried = 0;

	for (uint64_t seed = 1; seed <= PLANS; seed++) {
		uint32_t size;
		uint8_t *bytes = plan_bytes(seed, &size);
		struct incise_fixed_plan_header *head = head_of(bytes);
		struct incise_fixed_texture *t = (void *)(bytes + head->texture_at),
					    was = *t;
		int cut = (int)(seed % INCISE_TEXTURE_CUTS),
		    knot = (int)(seed * 97 % INCISE_TEXTURE_KNOTS);
		const struct {
			int32_t *at, bad[3], good;
		} wrong[] = {
			{&t->step_shift, {7, 21, INT32_MIN}, 20},
			{&t->most,
			 {-1, INCISE_TEXTURE_MOST + 1, INT32_MAX},
			 INCISE_TEXTURE_MOST},
			{&t->factor_most,
			 {0, INCISE_TEXTURE_FACTOR_MOST + 1, -1},
			 INCISE_TEXTURE_FACTOR_MOST},
			{&t->reserved, {1, -1, INT32_MAX}, 0},
			{&t->factor[cut],
			 {0, was.factor_most + 1, INT32_MIN},
			 was.factor_most},
			{&head->numbers.unloading, {0, 0, -1}, 1},
		};

		if (head->texture_at) {
			tried++;
			for (size_t i = 0; i < sizeof(wrong) / sizeof(*wrong); i++) {
				int32_t before = *wrong[i].at;

				for (int k = 0; k < 3; k++) {
					*wrong[i].at = wrong[i].bad[k];
					assert_int_equal(open_sealed(bytes, size),
							 -EINVAL);
				}
				*wrong[i].at = wrong[i].good;
				assert_int_equal(open_sealed(bytes, size), 0);
				*wrong[i].at = before;
			}
			t->start[cut] = INCISE_TEXTURE_KNOTS;
			assert_int_equal(open_sealed(bytes, size), -EINVAL);
			t->start[cut] = INCISE_TEXTURE_KNOTS - 1;
			for (int sign = -1; sign <= 1; sign += 2) {
				t->knot[knot] = (int16_t)(sign * (was.most + 1));
				assert_int_equal(open_sealed(bytes, size), -EINVAL);
				t->knot[knot] = (int16_t)(sign * was.most);
				assert_int_equal(open_sealed(bytes, size), 0);
			}
		}
		free(bytes);
	}
	assert_true(tried > PLANS / 20);
}
