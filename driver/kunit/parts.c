// SPDX-License-Identifier: GPL-2.0-only
/*
 * The parts of the stepper module that need no hardware, as the kernel's own compiler and
 * barriers make them, under KUnit or kunit.h. tests/unit/driver has the large tables; here
 * are the page, the ring of events and the histogram once each, and the properties of a
 * firmware node, which only a kernel has.
 */
#include <dt-bindings/gpio/gpio.h>
#include <linux/module.h>

#include "../stepper_defaults.c"
#include "../stepper_event.c"
#include "../stepper_histogram.c"
#include "../stepper_latency.c"
#include "../stepper_node.c"
#include "../stepper_page.c"
#include "fixed.h"
#include "kunit.h"

/* No motor moves here. */
int stepper_setup_config(struct stepper_motor *motor,
			 const struct incise_stepper_config *config)
{
	return 0;
}

#if IS_ENABLED(CONFIG_INCISE_STEPPER_PLAN)
void stepper_plan_sweep(struct stepper *stepper)
{
}
#endif

bool stepper_setup_any_powered(struct stepper *stepper)
{
	return false;
}

static void parts_page(struct kunit *test)
{
	struct incise_stepper_setpoint *slot =
		kunit_kzalloc(test, sizeof(*slot), GFP_KERNEL);
	struct stepper_setpoint setpoint = {};

	if (!slot) {
		KUNIT_FAIL(test, "no memory");
		return;
	}
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

	if (!stepper) {
		KUNIT_FAIL(test, "no memory");
		return;
	}
	stepper_event_init(stepper);
	KUNIT_EXPECT_EQ(test, stepper_event_take(stepper, &after, got, 8), 0U);
	for (i = 1; i <= STEPPER_EVENTS + 10; i++) {
		event.position = i;
		stepper_event_put(stepper, &event);
	}
	KUNIT_EXPECT_EQ(test, stepper_event_take(stepper, &after, got, 8), 8U);
	KUNIT_EXPECT_EQ(test, got[0].seq, 11ULL);
	KUNIT_EXPECT_EQ(test, got[0].position, 11LL);
	KUNIT_EXPECT_EQ(test, got[7].seq, 18ULL);
	KUNIT_EXPECT_EQ(test, after, 18ULL);
}

static void parts_histogram(struct kunit *test)
{
	struct stepper_histogram *h = kunit_kzalloc(test, sizeof(*h), GFP_KERNEL);

	if (!h) {
		KUNIT_FAIL(test, "no memory");
		return;
	}
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

/* Reads one property of a motor's node: 0 or the error that fails the bind. */
static int parts_read(struct kunit *test, struct property_entry entry,
		      struct incise_stepper_config *config)
{
	const struct property_entry properties[] = {entry, {}};
	struct stepper_defaults from = {};
	struct fwnode_handle *node;
	struct device *dev;
	int ret;

	dev = root_device_register("incise-kunit");
	if (IS_ERR(dev)) {
		KUNIT_FAIL(test, "no device");
		return PTR_ERR(dev);
	}
	node = fwnode_create_software_node(properties, NULL);
	from.dev = dev;
	from.node = node;
	ret = IS_ERR(node) ? PTR_ERR(node) : stepper_defaults_of(&from, config);
	if (!IS_ERR(node))
		fwnode_remove_software_node(node);
	root_device_unregister(dev);
	return ret;
}

/* A property of one cell in place of two, or the other way round, gets no default. */
static void parts_properties(struct kunit *test)
{
	static const u32 two[] = {0, 5};
	static const struct property_entry good[] = {
		PROPERTY_ENTRY_U32("reg", 0),
		PROPERTY_ENTRY_U32("incise,deadman-us", 50),
		PROPERTY_ENTRY_U64("incise,jerk", 1ULL << 40),
	};
	static const struct property_entry bad[] = {
		PROPERTY_ENTRY_U32("incise,jerk", 5),
		PROPERTY_ENTRY_U64("incise,deadman-us", 50),
		PROPERTY_ENTRY_U32_ARRAY("incise,velocity", two),
		PROPERTY_ENTRY_STRING("incise,velocity", "5"),
		PROPERTY_ENTRY_U64("incise,deadman-ns", 50000),
		PROPERTY_ENTRY_U64("incise,enable-ns", 50000),
	};
	struct incise_stepper_config c = {};
	unsigned int i;

	KUNIT_EXPECT_EQ(test, parts_read(test, good[0], &c), 0);
	KUNIT_EXPECT_EQ(test, c.deadman_ns, 100000000ULL);
	KUNIT_EXPECT_EQ(test, c.enable_ns, 1000000ULL);
	KUNIT_EXPECT_EQ(test, c.jerk, 0ULL);
	KUNIT_EXPECT_EQ(test, parts_read(test, good[1], &c), 0);
	KUNIT_EXPECT_EQ(test, c.deadman_ns, 50000ULL);
	KUNIT_EXPECT_EQ(test, parts_read(test, good[2], &c), 0);
	KUNIT_EXPECT_EQ(test, c.jerk, 1ULL << 40);
	for (i = 0; i < ARRAY_SIZE(bad); i++)
		KUNIT_EXPECT_EQ(test, parts_read(test, bad[i], &c), -EINVAL);
}

/* To write an open-drain line is to change its direction, which may sleep. */
static void parts_push_pull(struct kunit *test)
{
	static const struct property_entry cells[] = {
		PROPERTY_ENTRY_U32("#gpio-cells", 2), {}};
	static const struct software_node chip = {.name = "incise-kunit-chip",
						  .properties = cells};
	static const struct software_node_ref_args
		low = SOFTWARE_NODE_REFERENCE(&chip, 4, GPIO_ACTIVE_LOW),
		drain = SOFTWARE_NODE_REFERENCE(&chip, 5, GPIO_OPEN_DRAIN),
		source = SOFTWARE_NODE_REFERENCE(&chip, 6, GPIO_OPEN_SOURCE);
	static const struct property_entry properties[] = {
		PROPERTY_ENTRY_REF_ARRAY_LEN("step-gpios", &low, 1),
		PROPERTY_ENTRY_REF_ARRAY_LEN("dir-gpios", &drain, 1),
		PROPERTY_ENTRY_REF_ARRAY_LEN("enable-gpio", &source, 1),
		{}};
	struct fwnode_handle *node;

	if (software_node_register(&chip)) {
		KUNIT_FAIL(test, "no node");
		return;
	}
	node = fwnode_create_software_node(properties, NULL);
	if (IS_ERR(node)) {
		KUNIT_FAIL(test, "no node");
	} else {
		KUNIT_EXPECT_EQ(test, stepper_node_push_pull(node, "step"), true);
		KUNIT_EXPECT_EQ(test, stepper_node_push_pull(node, "dir"), false);
		KUNIT_EXPECT_EQ(test, stepper_node_push_pull(node, "enable"), false);
		KUNIT_EXPECT_EQ(test, stepper_node_push_pull(node, "home"), true);
		fwnode_remove_software_node(node);
	}
	software_node_unregister(&chip);
}

static struct kunit_case parts_cases[] = {KUNIT_CASE(parts_page),
					  KUNIT_CASE(parts_config),
					  KUNIT_CASE(parts_events),
					  KUNIT_CASE(parts_histogram),
					  KUNIT_CASE(parts_properties),
					  KUNIT_CASE(parts_push_pull),
					  KUNIT_CASE(fixed_bits),
					  KUNIT_CASE(fixed_damage),
					  {}};

static struct kunit_suite parts_suite = {
	.name = "incise_stepper",
	.test_cases = parts_cases,
};

#if IS_ENABLED(CONFIG_KUNIT)
kunit_test_suite(parts_suite);
#else
static int __init parts_init(void)
{
	return kunit_run(&parts_suite);
}
module_init(parts_init);

static void __exit parts_exit(void)
{
}
module_exit(parts_exit);
#endif

MODULE_DESCRIPTION("KUnit tests of incise_stepper");
MODULE_AUTHOR("The incise authors");
MODULE_LICENSE("GPL");
