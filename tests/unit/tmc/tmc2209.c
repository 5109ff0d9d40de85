// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/tmc/tmc2209.c and tmc_driver.c against chips behind a pseudo terminal, and both compared
 * with the traffic of another implementation. A test waits for the fault that it needs to see.
 */
#include "../unit.h"
#include <time.h>
#include "../../../lib/rig/backends.h"
#include "../../../lib/device/tmc/tmc_driver.h"
#include "chip.h"
#include "pytmcstepper.h"

extern const struct incise_backend incise_driver_tmc2209;

static struct chip_line line;

static int begin(void **state)
{
	(void)state;
	memset(&line, 0, sizeof(line));
	return chip_begin(&line);
}

static int end(void **state)
{
	(void)state;
	chip_end(&line);
	return 0;
}

/* What PyTmcStepper was told to set: 937 and 500 clocks a microstep are 2 and 3.75 mm/s. */
static struct incise_actuator asked(int node)
{
	struct incise_actuator a = {
		.travel_mm = 20,
		.lead_mm = 8,
		.steps_per_turn = 200,
		.microsteps = 16,
		.velocity_mm_s = 10,
		.tmc = {.sense_ohm = 0.11,
			.run_A = 0.6,
			.hold_A = 0.3,
			.interpolate = true,
			.stealthchop = true,
			.stealthchop_mm_s = 3.75,
			.stall_mm_s = 2,
			.stall_threshold = 75,
			.answer_s = 0.5},
	};

	snprintf(a.driver, sizeof(a.driver), "tmc2209:%s:%d", line.path, node);
	return a;
}

static struct incise_driver *open_chip(const struct incise_actuator *a,
				       struct incise_driver *const *others, int n)
{
	return incise_driver_tmc2209.open(
		&(struct incise_backend_request){.arguments = a->driver + 8,
						 .where = "rig.conf:1: stepper: driver",
						 .actuator = a,
						 .drivers = others,
						 .n_drivers = n},
		&err);
}

static struct incise_driver *open_asked(void)
{
	struct incise_actuator a = asked(0);
	struct incise_driver *driver = open_chip(&a, NULL, 0);

	succeeds(driver);
	return driver;
}

static void close_chip(struct incise_driver *driver)
{
	driver->ops->close(driver);
}

static size_t from_hex(const char *text, unsigned char *bytes)
{
	size_t n = strlen(text) / 2;

	for (size_t i = 0; i < n; i++)
		assert_int_equal(sscanf(text + 2 * i, "%2hhx", &bytes[i]), 1);
	return n;
}

#define RECORDED (sizeof(pytmcstepper) / sizeof(*pytmcstepper))

/* The chips of these tests give the answers that PyTmcStepper accepted. */
TEST(emulator_answers_as_recorded, begin, end)
{
	static struct chip_line other;
	unsigned char ask[8], answer[8], got[8];
	uint32_t bit = 1;

	chip_reset(&other, 0);
	for (size_t i = 0; i < RECORDED; i++) {
		size_t n = from_hex(pytmcstepper[i].request, ask);
		size_t m = from_hex(pytmcstepper[i].answer, answer);

		/* Its flags were set one after the other. */
		if (m && ask[2] == CHIP_DRV_STATUS) {
			other.reg[0][CHIP_DRV_STATUS] = bit;
			bit = bit == 0x80 ? 0x40000000 : bit << 1;
		}
		assert_int_equal(chip_obey(&other, ask, n, got), m);
		assert_memory_equal(got, answer, m);
	}
}

/* The bytes of a setting are those of PyTmcStepper, to which the same was told. */
TEST(settings_are_the_bytes_of_another_implementation, begin, end)
{
	static const char *const same[] = {"050080000001c0f6", "050090000813094e",
					   "050093000001f474", "050094000003a93b",
					   "0500c00000004bbd"};
	struct incise_driver *driver = open_asked();
	unsigned char bytes[8];

	close_chip(driver);
	for (size_t i = 0; i < sizeof(same) / sizeof(*same); i++) {
		bool recorded = false, sent = false;

		for (size_t k = 0; k < RECORDED; k++)
			recorded |= !strcmp(same[i], pytmcstepper[k].request);
		from_hex(same[i], bytes);
		for (int k = 0; k < line.frames; k++)
			sent |= !memcmp(line.frame[k], bytes, 8);
		assert_true(recorded);
		if (!sent)
			fail_msg("%s was not sent", same[i]);
	}
	/* Less than the chopper's: blank time, slow decay and hysteresis are its own. */
	assert_int_equal(line.reg[0][CHIP_CHOPCONF] & ~0x187ffu, 0x14020000);
	assert_int_equal(line.reg[0][CHIP_GSTAT], 0);
}

TEST(state_is_read, begin, end)
{
	struct incise_driver *driver = open_asked();
	struct incise_stepper_chip chip;

	line.reg[0][CHIP_DRV_STATUS] = 0x40000001;
	line.reg[0][CHIP_SG_RESULT] = 412;
	assert_int_equal(driver->ops->read(driver, &chip), 0);
	assert_string_equal(strrchr(chip.name, ':'), ":0");
	assert_int_equal(chip.microsteps, 16);
	assert_int_equal(chip.load, 412);
	assert_int_equal(chip.threshold, 75);
	assert_int_equal(chip.threshold_load, 2);
	assert_true(chip.warm && chip.stealthchop && !chip.standstill);
	/* PyTmcStepper computes 612 mA of IRUN 19 and 0.18 V over 0.11 and 0.02 Ω. */
	assert_float_equal(chip.run_A, 0.612, 5e-4);
	assert_float_equal(chip.hold_A, 0.306, 5e-4);
	close_chip(driver);
}

/* A chip that was off since the last program says so once. */
TEST(restart_is_told, begin, end)
{
	for (int i = 0; i < 2; i++) {
		struct incise_driver *driver = open_asked();

		assert_int_equal(driver->restarted, !i);
		close_chip(driver);
	}
}

TEST(without_an_echo, begin, end)
{
	line.mute_echo = true;
	close_chip(open_asked());
}

/* A node that misses datagrams, or whose answers arrive damaged, is asked again. */
TEST(lost_datagrams_are_sent_again, begin, end)
{
	struct incise_stepper_counter counter;
	struct incise_driver *driver;

	line.deaf = 1;
	line.garbled = 1;
	line.lost_writes = 2;
	driver = open_asked();
	assert_int_equal(driver->ops->counter(driver, 1, &counter), 0);
	assert_string_equal(counter.key, "chip_repeats");
	assert_true(counter.value >= 4);
	assert_int_equal(driver->ops->counter(driver, 2, &counter), -ENOENT);
	close_chip(driver);
}

/* They have their own settings, and one lock. */
TEST(two_nodes_share_a_line, begin, end)
{
	struct incise_actuator a = asked(0), b = asked(3);
	struct incise_driver *first, *second;
	struct incise_stepper_chip chip;

	chip_reset(&line, 3);
	b.microsteps = 64;
	first = open_chip(&a, NULL, 0);
	succeeds(first);
	second = open_chip(&b, &first, 1);
	succeeds(second);
	assert_int_equal(second->ops->read(second, &chip), 0);
	assert_int_equal(chip.microsteps, 64);
	assert_int_equal(first->ops->read(first, &chip), 0);
	assert_int_equal(chip.microsteps, 16);
	assert_error(open_chip(&a, &first, 1), EINVAL, &err, a.driver, "already");
	close_chip(second);
	close_chip(first);
}

/* Refused with a reason, and the line is free again. */
TEST(refused, begin, end)
{
	struct {
		uint32_t ioin, stuck;
		int code, deaf;
		const char *text;
	} cases[] = {
		{.deaf = 1000, .code = ENODEV, .text = "no TMC2209 answers"},
		{.ioin = 0x20000040, .code = ENODEV, .text = "0x20"},
		{.stuck = 0xf000000, .code = EIO, .text = "256 microsteps"},
		{.stuck = 0x10000, .code = EIO, .text = "register 0x6c"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_actuator a = asked(0);

		chip_reset(&line, 0);
		if (cases[i].ioin)
			line.reg[0][CHIP_IOIN] = cases[i].ioin;
		line.deaf = cases[i].deaf;
		line.chopconf_stuck = cases[i].stuck;
		assert_error(open_chip(&a, NULL, 0), cases[i].code, &err, a.driver,
			     cases[i].text);
		line.deaf = 0;
		line.chopconf_stuck = 0;
	}
	close_chip(open_asked());
}

static void refuse_setting(struct incise_actuator a, int code, const char *text)
{
	assert_error(open_chip(&a, NULL, 0), code, &err, text);
}

TEST(settings_that_the_chip_lacks, begin, end)
{
	struct incise_actuator a = asked(0);

	a.tmc.run_A = 2.5;
	refuse_setting(a, ERANGE, "1.768");
	a = asked(0);
	a.tmc.stall_threshold = -1;
	refuse_setting(a, ERANGE, "0 to 255");
	a = asked(0);
	a.tmc.stealthchop = false;
	refuse_setting(a, ERANGE, "StealthChop");
	a = asked(4);
	refuse_setting(a, EINVAL, "0 to 3");
	a = asked(0);
	strcpy(a.driver, "tmc2209:0");
	refuse_setting(a, EINVAL, "tmc2209:TTY:NODE");
	strcpy(a.driver, "tmc2209:/nowhere:0");
	refuse_setting(a, ENODEV, "/nowhere");
}

static unsigned int wait_for_fault(struct incise_driver *driver)
{
	while (!driver->ops->faults(driver))
		nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
	return driver->ops->faults(driver);
}

/* Each is latched with its text, is refused while it lasts, and clearing sets the chip up again. */
TEST(faults, begin, end)
{
	static const struct {
		uint32_t state, status, fault;
		const char *text;
		bool ends; /* by a write to GSTAT */
	} cases[] = {
		{1, 0, INCISE_STEPPER_FAULT_LOST, "restarted", true},
		{2, 0x04, INCISE_STEPPER_FAULT_ALARM, "short circuit", false},
		{2, 0x08, INCISE_STEPPER_FAULT_ALARM, "short circuit", false},
		{2, 0x10, INCISE_STEPPER_FAULT_ALARM, "short circuit", false},
		{2, 0x20, INCISE_STEPPER_FAULT_ALARM, "short circuit", false},
		{2, 0x03, INCISE_STEPPER_FAULT_ALARM, "too hot", false},
		{2, 0, INCISE_STEPPER_FAULT_ALARM, "heat or a short", true},
		{4, 0, INCISE_STEPPER_FAULT_ALARM, "supply is too low", true},
		{0, 0x40, INCISE_STEPPER_FAULT_ALARM, "a coil of the motor is open",
		 false},
		{0, 0x80, INCISE_STEPPER_FAULT_ALARM, "a coil of the motor is open",
		 false},
	};
	struct incise_driver *driver = open_asked();
	char text[300];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		/* It moves slowly; and has lost a setting. */
		line.reg[0][CHIP_DRV_STATUS] = cases[i].status;
		line.reg[0][CHIP_CHOPCONF] = 0x10000053;
		line.reg[0][CHIP_GSTAT] = cases[i].state;
		assert_int_equal(wait_for_fault(driver), cases[i].fault);
		assert_true(driver->ops->cause(driver, text, sizeof(text)) > 0);
		assert_says(text, cases[i].text, ", then clear, enable and home");
		if (!cases[i].ends && cases[i].state) {
			assert_error(driver->ops->clear(driver, &err), EBUSY, &err,
				     cases[i].text);
		}
		line.reg[0][CHIP_DRV_STATUS] = 0x80000000;
		assert_int_equal(driver->ops->clear(driver, &err), 0);
		assert_int_equal(driver->ops->faults(driver), 0);
		assert_int_equal(driver->ops->cause(driver, text, sizeof(text)), 0);
		assert_int_equal(line.reg[0][CHIP_CHOPCONF], 0x14030053);
	}
	close_chip(driver);
}

/* One look after another by hand: a watching driver has no thread. */
static struct tmc_driver *open_watched(const struct incise_actuator *a)
{
	struct tmc_driver *d = incise_driver_tmc2209.open(
		&(struct incise_backend_request){.arguments = a->driver + 8,
						 .where = "rig.conf:1",
						 .actuator = a,
						 .watch = true},
		&err);

	succeeds(d);
	return d;
}

static int looks_until_fault(struct tmc_driver *d)
{
	for (int i = 1; i < 10; i++) {
		tmc_driver_look(d);
		if (d->faults)
			return i;
	}
	return 0;
}

static void passing_look(struct tmc_driver *d)
{
	tmc_driver_look(d);
	assert_int_equal(d->faults, 0);
}

/* A warning is counted at its begin, and an open coil or a stall must last and be of that speed. */
TEST(conditions_that_must_last, begin, end)
{
	struct incise_actuator a = asked(0);
	struct tmc_driver *d = open_watched(&a);

	assert_int_equal(line.frames, 0); /* it changes nothing */
	line.reg[0][CHIP_GSTAT] = 0;
	line.reg[0][CHIP_DRV_STATUS] = 0x00000001;
	passing_look(d);
	passing_look(d);
	line.reg[0][CHIP_DRV_STATUS] = 0;
	passing_look(d);
	line.reg[0][CHIP_DRV_STATUS] = 1;
	passing_look(d);
	assert_int_equal(d->warnings, 2);

	/* 750 clocks are 2.5 mm/s, a quarter of the largest speed. */
	line.reg[0][CHIP_DRV_STATUS] = 0x80;
	line.reg[0][CHIP_TSTEP] = 749;
	assert_int_equal(looks_until_fault(d), 0);
	line.reg[0][CHIP_TSTEP] = 750;
	for (int i = 0; i < 4; i++)
		passing_look(d);
	line.reg[0][CHIP_DRV_STATUS] = 0;
	passing_look(d);
	line.reg[0][CHIP_DRV_STATUS] = 0x80000080; /* at rest it means nothing */
	assert_int_equal(looks_until_fault(d), 0);
	line.reg[0][CHIP_DRV_STATUS] = 0x80;
	assert_int_equal(looks_until_fault(d), 5);
	d->faults = d->open = 0;

	line.reg[0][CHIP_DRV_STATUS] = 0;
	line.reg[0][CHIP_SG_RESULT] = 150; /* 2 · 75 */
	line.reg[0][CHIP_TSTEP] = 938;	   /* slower than 2 mm/s */
	assert_int_equal(looks_until_fault(d), 0);
	line.reg[0][CHIP_TSTEP] = 937;
	line.reg[0][CHIP_SG_RESULT] = 151;
	assert_int_equal(looks_until_fault(d), 0);
	line.reg[0][CHIP_SG_RESULT] = 150;
	d->actuator.tmc.stall_home = true;
	assert_int_equal(looks_until_fault(d), 0);
	d->actuator.tmc.stall_home = false;
	d->stalled = 0;
	assert_int_equal(looks_until_fault(d), 2);
	assert_int_equal(d->faults, INCISE_STEPPER_FAULT_FOLLOWING);
	close_chip(&d->driver);
}

TEST(a_chip_that_does_not_answer_any_more, begin, end)
{
	struct incise_actuator a = asked(0);
	struct tmc_driver *d = open_watched(&a);

	line.reg[0][CHIP_GSTAT] = 0;
	line.nodes = 0;
	tmc_driver_look(d);
	line.nodes = 1;
	passing_look(d);
	line.nodes = 0;
	assert_int_equal(looks_until_fault(d), 3);
	assert_int_equal(d->faults, INCISE_STEPPER_FAULT_LOST);
	assert_says(d->cause, "does not answer any more");
	close_chip(&d->driver);
}

GROUP(NULL, NULL);
