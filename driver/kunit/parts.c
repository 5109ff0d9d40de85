// SPDX-License-Identifier: GPL-2.0-only
/*
 * KUnit, for kernels that have it: the parts of the stepper module that need no hardware,
 * as the kernel's own compiler and barriers make them. tests/unit/driver has the large
 * tables; here are the page, the ring of events and the histogram once each.
 */
#include <kunit/test.h>
#include <linux/module.h>

#include "../stepper_event.c"
#include "../stepper_histogram.c"
#include "../stepper_page.c"

static void parts_page(struct kunit *test)
{
	struct incise_stepper_setpoint *slot =
		kunit_kzalloc(test, sizeof(*slot), GFP_KERNEL);
	struct stepper_setpoint setpoint = {};

	KUNIT_ASSERT_NOT_ERR_OR_NULL(test, slot);
	KUNIT_EXPECT_EQ(test, stepper_page_take(slot, &setpoint), STEPPER_PAGE_NOTHING);
	slot->seq = 2;
	slot->target = -5;
	KUNIT_EXPECT_EQ(test, stepper_page_take(slot, &setpoint), STEPPER_PAGE_TAKEN);
	KUNIT_EXPECT_EQ(test, setpoint.target, -5LL);
	KUNIT_EXPECT_EQ(test, stepper_page_take(slot, &setpoint), STEPPER_PAGE_NOTHING);
	slot->seq = 3;
	KUNIT_EXPECT_EQ(test, stepper_page_take(slot, &setpoint), STEPPER_PAGE_NOTHING);
	slot->seq = 4;
	slot->reserved[4] = 1;
	KUNIT_EXPECT_EQ(test, stepper_page_take(slot, &setpoint), STEPPER_PAGE_GARBAGE);
	KUNIT_EXPECT_EQ(test, setpoint.target, -5LL);
}

static void parts_config(struct kunit *test)
{
	struct incise_stepper_controller info = {
		.n_motors = 1, .rate_max = 20000, .pulse_ns = 3000};
	struct incise_stepper_config config = {
		.tick_ns = 250000,
		.velocity = 20000,
		.acceleration = 1,
		.late_max = 1,
		.deadman_ns = 1000000,
		.high_ns = 25000,
		.low_ns = 25000,
	};

	KUNIT_EXPECT_EQ(test, stepper_page_config(&config, &info), 0);
	config.low_ns++;
	KUNIT_EXPECT_EQ(test, stepper_page_config(&config, &info), -ERANGE);
	config.low_ns = 2999;
	KUNIT_EXPECT_EQ(test, stepper_page_config(&config, &info), -ERANGE);
	config.low_ns = 499;
	KUNIT_EXPECT_EQ(test, stepper_page_config(&config, &info), -EINVAL);
}

/* A late reader finds the newest events, and a gap in seq. */
static void parts_events(struct kunit *test)
{
	struct stepper *stepper = kunit_kzalloc(test, sizeof(*stepper), GFP_KERNEL);
	struct incise_stepper_event event = {.type = INCISE_STEPPER_EVENT_STATE}, got[8];
	u64 after = 0;
	int i;

	KUNIT_ASSERT_NOT_ERR_OR_NULL(test, stepper);
	stepper_event_init(stepper);
	KUNIT_EXPECT_EQ(test, stepper_event_take(stepper, &after, got, 8), 0U);
	for (i = 1; i <= STEPPER_EVENTS + 10; i++) {
		event.position = i;
		stepper_event_put(stepper, &event);
	}
	irq_work_sync(&stepper->wake);
	KUNIT_EXPECT_EQ(test, stepper_event_take(stepper, &after, got, 8), 8U);
	KUNIT_EXPECT_EQ(test, got[0].seq, 11ULL);
	KUNIT_EXPECT_EQ(test, got[0].position, 11LL);
	KUNIT_EXPECT_EQ(test, got[7].seq, 18ULL);
	KUNIT_EXPECT_EQ(test, after, 18ULL);
}

static void parts_histogram(struct kunit *test)
{
	struct stepper_histogram *h = kunit_kzalloc(test, sizeof(*h), GFP_KERNEL);

	KUNIT_ASSERT_NOT_ERR_OR_NULL(test, h);
	stepper_histogram_add(h, -5);
	stepper_histogram_add(h, 999);
	stepper_histogram_add(h, 1000);
	stepper_histogram_add(h, 1999);
	stepper_histogram_add(h, 2000);
	stepper_histogram_add(h, S64_MAX);
	KUNIT_EXPECT_EQ(test, h->count[0], 2ULL);
	KUNIT_EXPECT_EQ(test, h->count[1], 2ULL);
	KUNIT_EXPECT_EQ(test, h->count[2], 1ULL);
	KUNIT_EXPECT_EQ(test, h->max_ns, (u64)S64_MAX);
}

static struct kunit_case parts_cases[] = {KUNIT_CASE(parts_page),
					  KUNIT_CASE(parts_config),
					  KUNIT_CASE(parts_events),
					  KUNIT_CASE(parts_histogram),
					  {}};

static struct kunit_suite parts_suite = {
	.name = "incise_stepper",
	.test_cases = parts_cases,
};

kunit_test_suite(parts_suite);

MODULE_DESCRIPTION("KUnit tests of incise_stepper");
MODULE_AUTHOR("The incise authors");
MODULE_LICENSE("GPL");
