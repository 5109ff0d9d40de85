// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Taking set-points from a page that somebody else writes, and judging configs: the part
 * of the kernel module that looks at what a user says, built without a kernel.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <pthread.h>
#include <string.h>
#include "../../../driver/stepper_page.c"

static const struct incise_stepper_info machine = {
	.n_motors = 2,
	.rate_max = 40000,
	.pulse_ns = 2000,
};

static struct incise_stepper_config good(void)
{
	return (struct incise_stepper_config){
		.motor = 1,
		.tick_ns = 250000,
		.velocity = 40000,
		.acceleration = 100000,
		.late_max = 10,
		.position_min = -1000,
		.position_max = 1000,
		.safe_position = 0,
		.deadman_ns = 100000000,
		.high_ns = 5000,
		.low_ns = 5000,
		.setup_ns = 5000,
		.hold_ns = 5000,
		.enable_ns = 1000000,
	};
}

/* One field of a good config is changed, each to the last value that is let pass and the
 * first that is not.
 */
#define FIELD(name)                                   \
	offsetof(struct incise_stepper_config, name), \
		sizeof(((struct incise_stepper_config *)0)->name)

static const struct {
	size_t offset, size;
	int64_t value;
	int rc;
} fields[] = {
	{FIELD(motor), 0, 0},
	{FIELD(motor), 2, -EINVAL},
	{FIELD(flags), 3, 0},
	{FIELD(flags), 4, -EINVAL},
	{FIELD(tick_ns), 50000, 0},
	{FIELD(tick_ns), 49999, -EINVAL},
	{FIELD(tick_ns), 2000000, 0},
	{FIELD(tick_ns), 2000001, -EINVAL},
	{FIELD(velocity), 1, 0},
	{FIELD(velocity), 0, -EINVAL},
	{FIELD(velocity), 40001, -ERANGE},
	{FIELD(velocity), UINT32_MAX, -ERANGE},
	{FIELD(acceleration), 1, 0},
	{FIELD(acceleration), 0, -EINVAL},
	{FIELD(acceleration), UINT32_MAX, 0},
	{FIELD(late_max), 1, 0},
	{FIELD(late_max), 0, -EINVAL},
	{FIELD(late_max), 1000, 0},
	{FIELD(late_max), 1001, -EINVAL},
	{FIELD(position_min), -1000000000, 0},
	{FIELD(position_min), -1000000001, -EINVAL},
	{FIELD(position_min), INT64_MIN, -EINVAL},
	{FIELD(position_min), 0, 0},
	{FIELD(position_min), 1, -EINVAL}, /* safe_position lies below */
	{FIELD(position_max), 1000000000, 0},
	{FIELD(position_max), 1000000001, -EINVAL},
	{FIELD(position_max), INT64_MAX, -EINVAL},
	{FIELD(position_max), -1001, -EINVAL},
	{FIELD(safe_position), -1000, 0},
	{FIELD(safe_position), -1001, -EINVAL},
	{FIELD(safe_position), 1000, 0},
	{FIELD(safe_position), 1001, -EINVAL},
	{FIELD(deadman_ns), 1000000, 0},
	{FIELD(deadman_ns), 999999, -EINVAL},
	{FIELD(deadman_ns), 10000000000, 0},
	{FIELD(deadman_ns), 10000000001, -EINVAL},
	{FIELD(high_ns), 2000, 0},
	{FIELD(high_ns), 1999, -ERANGE},
	{FIELD(high_ns), 499, -EINVAL},
	{FIELD(high_ns), 20000, 0}, /* 25 µs a step, less low */
	{FIELD(high_ns), 20001, -ERANGE},
	{FIELD(high_ns), 1000001, -EINVAL},
	{FIELD(low_ns), 2000, 0},
	{FIELD(low_ns), 1999, -ERANGE},
	{FIELD(low_ns), 499, -EINVAL},
	{FIELD(low_ns), 20000, 0},
	{FIELD(low_ns), 20001, -ERANGE},
	{FIELD(low_ns), 1000001, -EINVAL},
	{FIELD(setup_ns), 0, 0},
	{FIELD(setup_ns), 1000000, 0},
	{FIELD(setup_ns), 1000001, -EINVAL},
	{FIELD(hold_ns), 0, 0},
	{FIELD(hold_ns), 1000001, -EINVAL},
	{FIELD(enable_ns), 1000000000, 0},
	{FIELD(enable_ns), 1000000001, -EINVAL},
	{FIELD(enable_ns), -1, -EINVAL},
	{FIELD(reserved[0]), 1, -EINVAL},
	{FIELD(reserved[4]), -1, -EINVAL},
};

static void config_edges(void **state)
{
	struct incise_stepper_config c = good();

	assert_int_equal(stepper_page_config(&c, &machine), 0);
	for (size_t i = 0; i < sizeof(fields) / sizeof(*fields); i++) {
		c = good();
		/* Little-endian, as the machines of the tests are. */
		memcpy((char *)&c + fields[i].offset, &fields[i].value, fields[i].size);
		if (stepper_page_config(&c, &machine) != fields[i].rc)
			fail_msg("case %zu", i);
	}
}

/* The profile's own limit holds where a machine could do more. */
static void config_profile(void **state)
{
	struct incise_stepper_info fast = machine;
	struct incise_stepper_config c = good();

	fast.rate_max = UINT32_MAX;
	fast.pulse_ns = 500;
	c.high_ns = 500;
	c.low_ns = 500;
	c.velocity = INCISE_PROFILE_VELOCITY_MAX;
	assert_int_equal(stepper_page_config(&c, &fast), 0);
	c.velocity++;
	assert_int_equal(stepper_page_config(&c, &fast), -ERANGE);
}

static void slots(void **state)
{
	struct incise_stepper_setpoint slot = {
		.seq = 2, .mode = 1, .target = -7, .t_ns = 9};
	struct stepper_wish wish = {0};

	assert_int_equal(stepper_page_take(&slot, &wish), STEPPER_PAGE_TAKEN);
	assert_int_equal(wish.seq, 2);
	assert_int_equal(wish.mode, 1);
	assert_int_equal(wish.target, -7);
	assert_int_equal(wish.t_ns, 9);

	slot.target = 8; /* without a new seq */
	assert_int_equal(stepper_page_take(&slot, &wish), STEPPER_PAGE_NOTHING);
	slot.seq = 3; /* being written */
	assert_int_equal(stepper_page_take(&slot, &wish), STEPPER_PAGE_NOTHING);
	assert_int_equal(wish.target, -7);
	slot.seq = UINT32_MAX - 1;
	assert_int_equal(stepper_page_take(&slot, &wish), STEPPER_PAGE_TAKEN);
	assert_int_equal(wish.target, 8);
	slot.seq = 0; /* it wraps, and may go backwards */
	assert_int_equal(stepper_page_take(&slot, &wish), STEPPER_PAGE_TAKEN);
}

static void slots_garbage(void **state)
{
	struct stepper_wish wish = {.mode = 0, .target = 5};

	for (size_t byte = 0; byte < sizeof(struct incise_stepper_setpoint); byte++) {
		struct incise_stepper_setpoint slot = {.seq = 2};
		enum stepper_page_answer want = STEPPER_PAGE_GARBAGE;

		/* seq and the two free numbers may be anything; mode may be 1. */
		if (byte < 4)
			continue;
		if (byte >= 8 && byte < 24)
			want = STEPPER_PAGE_TAKEN;
		wish.seq = 0;
		((unsigned char *)&slot)[byte] = 0x82;
		assert_int_equal(stepper_page_take(&slot, &wish), want);
		if (want == STEPPER_PAGE_GARBAGE) {
			assert_int_equal(wish.seq, 2);
			/* Told once: the same slot again is nothing new. */
			assert_int_equal(stepper_page_take(&slot, &wish),
					 STEPPER_PAGE_NOTHING);
		}
	}
}

static void clamping(void **state)
{
	static const struct {
		uint16_t mode;
		int64_t target, want;
	} cases[] = {
		{0, 0, 0},
		{0, 1000, 1000},
		{0, 1001, 1000},
		{0, -1001, -1000},
		{0, INT64_MAX, 1000},
		{0, INT64_MIN, -1000},
		{1, 40000, 40000},
		{1, 40001, 40000},
		{1, -40001, -40000},
		{1, INT64_MIN, -40000},
	};
	struct incise_stepper_config c = good();

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct stepper_wish wish = {.mode = cases[i].mode,
					    .target = cases[i].target};

		assert_int_equal(stepper_page_clamp(&wish, &c), cases[i].want);
	}
}

#define WRITES 200000

/* A writer that never pauses: what is taken is always of one set-point. */
static void *writer(void *arg)
{
	struct incise_stepper_setpoint *slot = arg;

	for (uint32_t i = 1; i <= WRITES; i++) {
		__atomic_store_n(&slot->seq, 2 * i - 1, __ATOMIC_RELAXED);
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
		__atomic_store_n(&slot->target, (int64_t)i * 0x100000001,
				 __ATOMIC_RELAXED);
		__atomic_store_n(&slot->t_ns, -(int64_t)i, __ATOMIC_RELAXED);
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
		__atomic_store_n(&slot->seq, 2 * i, __ATOMIC_RELAXED);
	}
	return NULL;
}

static void slots_race(void **state)
{
	static struct incise_stepper_setpoint slot;
	struct stepper_wish wish = {0};
	pthread_t thread;

	assert_int_equal(pthread_create(&thread, NULL, writer, &slot), 0);
	while (wish.seq != 2 * WRITES) {
		if (stepper_page_take(&slot, &wish) != STEPPER_PAGE_TAKEN)
			continue;
		assert_int_equal(wish.target, (int64_t)(wish.seq / 2) * 0x100000001);
		assert_int_equal(wish.t_ns, -(int64_t)(wish.seq / 2));
	}
	pthread_join(thread, NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(config_edges), cmocka_unit_test(config_profile),
		cmocka_unit_test(slots),	cmocka_unit_test(slots_garbage),
		cmocka_unit_test(clamping),	cmocka_unit_test(slots_race),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
