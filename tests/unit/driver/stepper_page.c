// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The kernel module's page of set-points and check of configs, outside of a kernel: an owner
 * that writes between any two reads, in all ways there are, and a config that is wrong in one
 * field at a time.
 */
#include "../unit.h"

/*
 * Before each read of the page the owner does what its schedule says. A read without
 * READ_ONCE() would not be seen here: there shall be none.
 */
static void owner_acts(void);
#define READ_ONCE(x) (owner_acts(), *(volatile __typeof__(x) *)&(x))
#include "../../../driver/stepper_page.c"

/*
 * Two set-points, each of 5 stores; 10 reads take one: seq, 8 words, seq. Store i is done
 * before read before[i], or after all: as many schedules as there are ways to merge the two,
 * 20 over 10.
 */
#define STORES 10
#define READS 10
#define SCHEDULES 184756

static struct {
	struct incise_stepper_setpoint page;
	int before[STORES];
	int read, stored;
} owner;

/* The setpoint of a seq: a mixture of two shows in every field. */
static void fill(struct incise_stepper_setpoint *slot, __u32 seq)
{
	slot->mode = seq / 2 % 2;
	slot->target = seq * 1000;
	slot->t_ns = -(__s64)seq;
}

static void store(int i)
{
	__u32 seq = 6 + i / 5 * 2;
	struct incise_stepper_setpoint right = {0};

	fill(&right, seq);
	switch (i % 5) {
	case 0:
		owner.page.seq = seq - 1;
		break;
	case 1:
		owner.page.mode = right.mode;
		break;
	case 2:
		owner.page.target = right.target;
		break;
	case 3:
		owner.page.t_ns = right.t_ns;
		break;
	case 4:
		owner.page.seq = seq;
		break;
	}
}

static void owner_acts(void)
{
	while (owner.stored < STORES && owner.before[owner.stored] <= owner.read)
		store(owner.stored++);
	owner.read++;
}

/* One schedule. Returns whether a set-point was taken while the owner wrote. */
static bool merged(void)
{
	struct stepper_setpoint setpoint = {.seq = 4};
	struct incise_stepper_setpoint right = {0};
	enum stepper_page_answer answer;
	bool taken;

	memset(&owner.page, 0, sizeof(owner.page));
	owner.page.seq = 4;
	fill(&owner.page, 4);
	owner.read = owner.stored = 0;
	answer = stepper_page_take(&owner.page, &setpoint);
	assert_int_not_equal(answer, STEPPER_PAGE_GARBAGE);
	taken = answer == STEPPER_PAGE_TAKEN;
	if (taken) {
		/* All of one set-point, and not of one that is being written. */
		assert_true(setpoint.seq == 6 || setpoint.seq == 8);
		fill(&right, setpoint.seq);
		assert_int_equal(setpoint.mode, right.mode);
		assert_int_equal(setpoint.target, right.target);
		assert_int_equal(setpoint.t_ns, right.t_ns);
	}
	/* Once more, when the owner is done: the last is never lost. */
	owner.read = READS;
	stepper_page_take(&owner.page, &setpoint);
	assert_int_equal(setpoint.seq, 8);
	assert_int_equal(setpoint.target, 8000);
	return taken;
}

TEST(test_any_merge)
{
	int n = 0, taken = 0, i;

	memset(&owner, 0, sizeof(owner));
	for (;;) {
		taken += merged();
		n++;
		/* The next of the sequences that do not fall. */
		for (i = STORES - 1; i >= 0 && owner.before[i] == READS; i--)
			;
		if (i < 0)
			break;
		owner.before[i]++;
		for (int k = i + 1; k < STORES; k++)
			owner.before[k] = owner.before[i];
	}
	assert_int_equal(n, SCHEDULES);
	assert_in_range(taken, 1, n - 1);
}

TEST(test_answers)
{
	static const struct {
		struct incise_stepper_setpoint slot;
		enum stepper_page_answer answer;
	} rows[] = {
		{{.seq = 4}, STEPPER_PAGE_NOTHING}, /* as before */
		{{.seq = 5}, STEPPER_PAGE_NOTHING}, /* being written */
		{{.seq = 6, .target = -7, .t_ns = 8}, STEPPER_PAGE_TAKEN},
		{{.seq = 2, .target = INT64_MIN}, STEPPER_PAGE_TAKEN}, /* wrapped */
		{{.seq = 0, .mode = 1}, STEPPER_PAGE_TAKEN},
		{{.seq = 6, .mode = 3}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 0xffff}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .reserved0 = 1}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .reserved = {1}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .reserved = {0, 0, 0, 0, 1ull << 63}}, STEPPER_PAGE_GARBAGE},
		/* A pose: any position, any quaternion, the tools that there are. */
		{{.seq = 6, .mode = 2, .t_ns = -1}, STEPPER_PAGE_TAKEN},
		{{.seq = 6,
		  .mode = 2,
		  .pose = {{INT32_MIN, 1, INT32_MAX}, {INT32_MIN, 0, 1, 2}, 3 | 1 << 9}},
		 STEPPER_PAGE_TAKEN},
		{{.seq = 6, .mode = 2, .pose = {.tool = 4}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .pose = {.tool = 1 << 8}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .pose = {.tool = 1 << 10}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .pose = {.tool = 1u << 31}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .pose = {.reserved = 1}}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .target = 1}, STEPPER_PAGE_GARBAGE},
		{{.seq = 6, .mode = 2, .reserved0 = 1}, STEPPER_PAGE_GARBAGE},
	};

	owner.stored = STORES; /* it writes no more */
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct stepper_setpoint setpoint = {
			.seq = 4, .mode = 1, .target = 123, .t_ns = 456};

		assert_int_equal(stepper_page_take(&rows[i].slot, &setpoint),
				 rows[i].answer);
		if (rows[i].answer == STEPPER_PAGE_TAKEN) {
			assert_int_equal(setpoint.mode, rows[i].slot.mode);
			assert_int_equal(setpoint.target, rows[i].slot.target);
			assert_int_equal(setpoint.t_ns, rows[i].slot.t_ns);
			assert_memory_equal(&setpoint.pose, &rows[i].slot.pose,
					    sizeof(setpoint.pose));
		} else {
			assert_int_equal(setpoint.mode, 1);
			assert_int_equal(setpoint.target, 123);
			assert_int_equal(setpoint.t_ns, 456);
		}
		/* The same once more is nothing: garbage is reported once. */
		assert_int_equal(stepper_page_take(&rows[i].slot, &setpoint),
				 STEPPER_PAGE_NOTHING);
	}
}

TEST(test_clamp)
{
	static const struct incise_stepper_config config = {
		.velocity = 1000, .position_min = -50, .position_max = 70};
	static const struct {
		__u16 mode;
		__s64 target, right;
	} rows[] = {
		{0, 70, 70},	       {0, 71, 70},	    {0, -51, -50},
		{0, INT64_MAX, 70},    {0, INT64_MIN, -50}, {1, 1000, 1000},
		{1, 1001, 1000},       {1, -1001, -1000},   {1, INT64_MAX, 1000},
		{1, INT64_MIN, -1000},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct stepper_setpoint setpoint = {.mode = rows[i].mode,
						    .target = rows[i].target};

		assert_int_equal(stepper_page_clamp(&setpoint, &config), rows[i].right);
	}
}

static const struct incise_stepper_controller machine = {
	.n_motors = 2,
	.rate_max = 100000,
	.pulse_ns = 600,
	.tick_min_ns = 60000,
	.step_ns = 3000,
	.wait_step_ns = 1000,
};

static const struct incise_stepper_config good = {
	.motor = 1,
	.tick_ns = 1000000,
	.velocity = 20000,
	.acceleration = 400000,
	.late_max = 10,
	.position_min = -100,
	.position_max = 100,
	.safe_position = -100,
	.deadman_ns = 20000000,
	.high_ns = 5000,
	.low_ns = 5000,
};

/* One field at a time. */
TEST(test_config)
{
	static const struct {
		size_t offset, size;
		__s64 value;
		int result;
	} rows[] = {
#define FIELD(name) offsetof(struct incise_stepper_config, name), sizeof(good.name)
		{FIELD(motor), 0, 0},
		{FIELD(motor), 2, -EINVAL},
		{FIELD(flags), 31, 0},
		{FIELD(flags), 32, -EINVAL},
		{FIELD(tick_ns), 60000, 0}, /* what the self-test found */
		{FIELD(tick_ns), 59999, -ERANGE},
		{FIELD(tick_ns), 50000, -ERANGE},
		{FIELD(tick_ns), 49999, -EINVAL},
		{FIELD(tick_ns), 2000000, 0},
		{FIELD(tick_ns), 2000001, -EINVAL},
		{FIELD(velocity), 1, 0},
		{FIELD(velocity), 0, -EINVAL},
		{FIELD(velocity), 76923, 0}, /* 10 µs of a pulse, 3 of the machine */
		{FIELD(velocity), 76924, -ERANGE},
		{FIELD(velocity), 100001, -ERANGE},
		{FIELD(velocity), 0xffffffff, -ERANGE},
		{FIELD(acceleration), 0, -EINVAL},
		{FIELD(acceleration), 0xffffffff, 0},
		{FIELD(late_max), 0, -EINVAL},
		{FIELD(late_max), 1000, 0},
		{FIELD(late_max), 1001, -EINVAL},
		{FIELD(jerk), -1, 0},
		{FIELD(position_min), -1000000000, 0},
		{FIELD(position_min), -1000000001, -EINVAL},
		{FIELD(position_min), INT64_MIN, -EINVAL},
		/* -100 in the lower 32 bits */
		{FIELD(position_min), 0xffffff9c, -EINVAL},
		{FIELD(position_min), 101, -EINVAL},
		{FIELD(position_max), 1000000000, 0},
		{FIELD(position_max), 1000000001, -EINVAL},
		{FIELD(position_max), INT64_MAX, -EINVAL},
		{FIELD(safe_position), 100, 0},
		{FIELD(safe_position), 101, -EINVAL},
		{FIELD(safe_position), -101, -EINVAL},
		{FIELD(deadman_ns), 1000000, 0},
		{FIELD(deadman_ns), 999999, -EINVAL},
		{FIELD(deadman_ns), 10000000000, 0},
		{FIELD(deadman_ns), 10000000001, -EINVAL},
		{FIELD(deadman_ns), -1, -EINVAL},
		{FIELD(high_ns), 600, 0}, /* what the self-test found */
		{FIELD(high_ns), 599, -ERANGE},
		{FIELD(high_ns), 499, -EINVAL},
		{FIELD(high_ns), 42000, 0}, /* 50 µs are a step at 20000 steps/s */
		{FIELD(high_ns), 42001, -ERANGE},
		{FIELD(high_ns), 0xffffffff, -EINVAL},
		{FIELD(low_ns), 600, 0},
		{FIELD(low_ns), 599, -ERANGE},
		{FIELD(low_ns), 499, -EINVAL},
		{FIELD(low_ns), 42001, -ERANGE},
		{FIELD(setup_ns), 1000000, 0},
		{FIELD(setup_ns), 1000001, -EINVAL},
		{FIELD(hold_ns), 1000000, 0},
		{FIELD(hold_ns), 1000001, -EINVAL},
		{FIELD(enable_ns), 1000000000, 0},
		{FIELD(enable_ns), -1, -EINVAL},
		{FIELD(reserved[0]), 1, -EINVAL},
		{FIELD(reserved[2]), 1, -EINVAL},
		{FIELD(lost_steps_max), 1000000000, 0},
		{FIELD(lost_steps_max), 1000000001, -EINVAL},
		{FIELD(debounce_ns), 100000000, 0},
		{FIELD(debounce_ns), 100000001, -EINVAL},
	};

	struct incise_stepper_config brief = good;

	/* A short pulse is waited for, unless that is switched off. */
	brief.high_ns = brief.low_ns = INCISE_STEPPER_WAIT_MAX_NS;
	assert_int_equal(stepper_page_velocity(&brief, &machine), 200000);
	assert_int_equal(stepper_page_busy_ns(&brief, &machine),
			 INCISE_STEPPER_WAIT_MAX_NS + machine.wait_step_ns);
	brief.flags |= INCISE_STEPPER_CONFIG_NO_WAIT;
	assert_int_equal(stepper_page_velocity(&brief, &machine), 142857);
	assert_int_equal(stepper_page_busy_ns(&brief, &machine), machine.step_ns);
	assert_int_equal(stepper_page_config(&good, &machine), 0);
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_stepper_config config = good;

		/* Little-endian machines only, as all that run these tests. */
		memcpy((char *)&config + rows[i].offset, &rows[i].value, rows[i].size);
		if (stepper_page_config(&config, &machine) != rows[i].result)
			fail_msg("row %zu", i);
	}
}

/* The profile's own limit holds where a machine could do more. */
TEST(test_fast_machine)
{
	const struct incise_stepper_controller fast = {.n_motors = 2,
						       .rate_max = UINT32_MAX};
	struct incise_stepper_config config = good;

	config.high_ns = config.low_ns = 500;
	config.velocity = INCISE_PROFILE_VELOCITY_MAX;
	assert_int_equal(stepper_page_config(&config, &fast), 0);
	config.velocity++;
	assert_int_equal(stepper_page_config(&config, &fast), -ERANGE);
}
