// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_session.c: how a drive is found and set up, what prevents that, and how a
 * drive is watched.
 */
#include "../unit.h"
#include "rig.h"

#define MS DRIVE_MS
#define COUNTS_PER_MM 12800 /* 51200 a turn of 4 mm */

static struct can_rig rig;

/*
 * The drive loses or refuses the k-th request of the start, for every k: it ends with a message, or
 * goes on without an object that it may lack. What it may refuse for another reason are hints,
 * inputs and why it has a fault.
 */
TEST(no_step_of_the_start_hangs_or_gives_power)
{
	static const uint32_t codes[] = {0, /* lost */
					 0x08000000, ABORT_NO_OBJECT, ABORT_NO_SUB,
					 0x08000022, ABORT_VALUE};
	uint32_t requests;

	can_rig_init(&rig);
	can_rig_open_or_fail(&rig);
	requests = (uint32_t)rig.drive.requests;
	can_rig_close(&rig);
	assert_true(requests > 40);
	for (size_t c = 0; c < sizeof(codes) / sizeof(*codes); c++)
		for (uint32_t k = 1; k <= requests; k++) {
			bool absent =
				codes[c] == ABORT_NO_OBJECT || codes[c] == ABORT_NO_SUB;
			struct incise_error err = {0};
			struct drive *d = &rig.drive;
			int64_t begin;

			can_rig_init(&rig);
			*(codes[c] ? &d->abort_at : &d->drop_at) = k;
			d->abort_code = codes[c];
			begin = d->now_ns;
			if (can_rig_open(&rig, &err)) {
				if (!absent && d->aborted != 0x1006 &&
				    d->aborted != 0x1007 && d->aborted != 0x1a01 &&
				    k != requests)
					fail_msg("request %u of %u of %x: goes on", k,
						 requests, d->aborted);
				can_rig_enable_or_fail(&rig);
				can_rig_close(&rig);
			} else if (!strstr(err.text, "rig.conf:3: stepper: ") || !errno) {
				fail_msg("request %u: \"%s\"", k, err.text);
			}
			if (!codes[c])
				assert_int_equal(d->master_abort, ABORT_TIMEOUT);
			assert_false(drive_powered(d));
			assert_int_equal(d->enabled_unasked, 0);
			/* An SDO times out after 0.2 s; other waits are shorter. */
			if (d->now_ns - begin > 3000 * MS)
				fail_msg("request %u took %lld ms", k,
					 (long long)((d->now_ns - begin) / MS));
		}
}

/* The refusals of a drive name what to do. */
TEST(a_drive_that_does_not_fit_is_refused)
{
	static const struct {
		bool echoes;
		int64_t answer_ns;
		uint32_t feed, increments;
		const char *says;
	} cases[] = {
		{true, 0, 51200, 51200, "switch its echo off"},
		{false, 350 * MS, 51200, 51200, "larger actuator.can.answer_ms"},
		{false, 0, 1, 51200, "give counts_per_turn"},
		{false, 0, 79, 79, "at most 0.05 mm"},
		{false, 0, 81, 81, NULL},
		{false, 150 * MS, 51200, 51200, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		can_rig_init(&rig);
		rig.drive.echoes = cases[i].echoes;
		rig.drive.answer_ns = cases[i].answer_ns;
		drive_set(&rig.drive, 0x6092, 1, cases[i].feed);
		drive_set(&rig.drive, 0x608f, 1, cases[i].increments);
		can_rig_open(&rig, &err);
		if (!rig.stepper != !!cases[i].says ||
		    (cases[i].says && !strstr(err.text, cases[i].says)))
			fail_msg("case %zu: %s", i, err.text);
		if (rig.stepper)
			can_rig_close(&rig);
	}
}

TEST(why_it_cannot_begin_is_said)
{
	static const struct {
		const char *arguments;
		int master;
		double deadman_s;
		uint32_t bitrate;
		int code;
		const char *says;
	} cases[] = {
		{"can0", 127, 0.1, 1000000, EINVAL, "can:DEVICE:NODE"},
		{"can0:", 127, 0.1, 1000000, EINVAL, "can:DEVICE:NODE"},
		{"can0:0", 127, 0.1, 1000000, EINVAL, "1 to 127"},
		{"can0:128", 127, 0.1, 1000000, EINVAL, "1 to 127"},
		{"can0:-1", 127, 0.1, 1000000, EINVAL, "1 to 127"},
		{"can0:0x10x", 127, 0.1, 1000000, EINVAL, "1 to 127"},
		{":0x10", 127, 0.1, 1000000, EINVAL, "can:DEVICE:NODE"},
		{"c:0x10", 16, 0.1, 1000000, EINVAL, "actuator.can.master"},
		{"c:0x11", 127, 0.1, 1000000, ENODEV, "0x11"},
		{"c:0x10", 127, 0.01, 1000000, EINVAL, "20"},
		/* 305 bits of 1 kHz, by the lengths of three frames, are 122 % … */
		{"c:0x10", 127, 0.1, 250000, ERANGE, "80 %"},
		/* … and fit into twice that. */
		{"c:0x10", 127, 0.1, 500000, 0, ""},
		{"c:0x10", 127, 0.1, 0, 0, ""},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		can_rig_init(&rig);
		rig.arguments = cases[i].arguments;
		rig.actuator.can.master = cases[i].master;
		rig.actuator.deadman_s = cases[i].deadman_s;
		rig.drive.bus.bitrate = cases[i].bitrate;
		if (can_rig_open(&rig, &err))
			can_rig_close(&rig);
		if (err.code != cases[i].code || !strstr(err.text, cases[i].says))
			fail_msg("case %zu: %d, \"%s\"", i, err.code, err.text);
	}
}

TEST(another_master_is_not_disturbed)
{
	const struct can_frame sync = {.can_id = CANOPEN_SYNC};

	can_rig_init(&rig);
	drive_say(&rig.drive, &sync);
	assert_null(can_rig_open(&rig, &err));
	assert_int_equal(err.code, EBUSY);
	assert_non_null(strstr(err.text, "another master"));
	assert_int_equal(rig.drive.requests, 0);
}

/* Only an orderly close switches the drive's watch off. */
TEST(who_goes_leaves_it_stopped_or_watched)
{
	static const struct {
		bool unplugged, mute;
		uint32_t consumer;
	} cases[] = {
		{false, false, 0},
		{true, false, 127 << 16 | 100},
		{false, true, 127 << 16 | 100},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		can_rig_init(&rig);
		can_rig_open_or_fail(&rig);
		can_rig_enable_or_fail(&rig);
		can_rig_hold(&rig, 15, 200 * MS);
		rig.drive.unplugged = cases[i].unplugged;
		rig.drive.mute = cases[i].mute;
		can_rig_close(&rig);
		assert_int_equal(rig.drive.od[OD_CONSUMER].value, cases[i].consumer);
		drive_advance(&rig.drive, 500 * MS);
		assert_false(drive_powered(&rig.drive));
		assert_int_equal(rig.drive.velocity, 0);
		assert_int_equal(rig.drive.enabled_unasked, 0);
	}
}

TEST(a_watcher_looks_and_writes_nothing)
{
	struct incise_stepper_status s;
	uint64_t enables;

	can_rig_init(&rig);
	rig.drive.absolute = true;
	drive_reboot(&rig.drive);
	rig.drive.position = 3 * COUNTS_PER_MM;
	rig.actuator.can.absolute = true;
	rig.watch = true;
	can_rig_open_or_fail(&rig);
	enables = rig.drive.enables;
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_DISABLED);
	assert_true(s.homed && fabs(s.position_mm - 3) < 1e-3);
	assert_int_equal(incise_stepper_set(rig.stepper, 1), -EPERM);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), -EPERM);
	/* Limit switches pressed by hand. */
	rig.drive.inputs = CIA402_AT_MAX | CIA402_AT_HOME;
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.inputs,
			 INCISE_STEPPER_LINE_LIMIT_MAX | INCISE_STEPPER_LINE_HOME);
	drive_fault(&rig.drive, 0x4310);
	can_rig_advance(&rig, 100 * MS);
	s = can_rig_look(&rig);
	assert_int_equal(s.state, INCISE_STEPPER_STATE_FAULT);
	assert_int_equal(s.faults, INCISE_STEPPER_FAULT_ALARM);
	rig.drive.mute = true;
	can_rig_advance(&rig, 1000 * MS);
	assert_int_equal(can_rig_look(&rig).faults, INCISE_STEPPER_FAULT_LOST);
	assert_int_equal(rig.drive.enables, enables);
	assert_int_equal(rig.drive.master_beats, 0);
	can_rig_close(&rig);
}
